"""What pressures and their changes may be: limits of each muscle, and of the supply that they share.

A limit is a row [whether it is of changes, bound, n weights]: the weighted sum of the n pressures, or of
how they change in a step, stays at or below the bound. A row with one weight is a muscle's own.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.kernels import SLACK, kernel


def limit_rows(
    low: Array, high: Array, change: float, total: float, draw: float, volumes: Array
) -> Array:
    """Return all limits, shape (rows, 2 + n); those that are infinite are left out.

    Parameters
    ----------
    low, high : array, shape (n,)
        Of pressures [bar].
    change : float
        Furthest change in a step [bar].
    total : float
        Highest sum of pressures [bar].
    draw : float
        Most air drawn in a step, volume by pressure. Only rises draw: what one muscle vents is lost to
        the others, so every set of muscles has a row.
    volumes : array, shape (n,)
        Of muscles.
    """
    n = low.size
    found: list[list[float]] = []
    for k in range(n):
        own = np.eye(n)[k]
        found += [[0.0, high[k], *own], [0.0, -low[k], *-own]]
        found += [[1.0, change, *own], [1.0, change, *-own]]
    found.append([0.0, total, *np.ones(n)])
    for size in range(1, n + 1):
        for some in combinations(range(n), size):
            drawing = np.zeros(n)
            drawing[list(some)] = volumes[list(some)]
            found.append([1.0, draw, *drawing])
    table = np.array(found)
    table[:, 1:] /= np.linalg.norm(table[:, 2:], axis=1, keepdims=True)
    return table[np.isfinite(table[:, 1])]


@kernel
def weighed(row: Array, before: Array, p: Array) -> float:
    """Return the weighted sum that a row limits."""
    total = 0.0
    for k in range(p.size):
        total += row[2 + k] * (p[k] - (before[k] if row[0] > 0.0 else 0.0))
    return total


@kernel
def weighed_at(n: int, row: Array, before: Array, p: Array, t: int) -> float:
    """Return the weighted sum that a row limits, of sample t of pressures, n a sample."""
    now = p[t * n : (t + 1) * n]
    if t == 0:
        return weighed(row, before, now)
    return weighed(row, p[(t - 1) * n : t * n], now)


@kernel
def own_place(row: Array) -> int:
    """Return the muscle that a row is of, or -1 if of several."""
    found = -1
    for k in range(row.size - 2):
        if row[2 + k] != 0.0:
            if found >= 0:
                return -1
            found = k
    return found


@kernel
def allowed(rows: Array, before: Array, p: Array) -> bool:
    """Move pressures to where they may go from those before; return whether they were there already.

    Each goes to its own limits; what the supply cannot give is taken from all changes in one share.
    ``rows`` are limits in a row.
    """
    there, width = True, p.size + 2
    m = rows.size // width
    for turn in range(2):  # changes first: the range is what counts in the end
        for i in range(m):
            row = rows[i * width : (i + 1) * width]
            k = own_place(row)
            if k >= 0 and int(row[0]) == 1 - turn:
                over = weighed(row, before, p) - row[1]
                if over > 0.0:
                    p[k] -= over / row[2 + k]
                    there = there and over <= SLACK
    share = 1.0
    for i in range(m):
        limit = rows[i * width : (i + 1) * width]
        if own_place(limit) < 0:
            now, was = weighed(limit, before, p), weighed(limit, before, before)
            if now > limit[1]:
                there = there and now - limit[1] <= SLACK
                if now > was:
                    share = min(share, max(limit[1] - was, 0.0) / (now - was))
    if share < 1.0:
        for i in range(p.size):
            p[i] = before[i] + share * (p[i] - before[i])
    return there
