"""Horizon optimisation: pressures of all muscles, closest to a target within limits.

    min sum_t |G_t (p_t - q_t) - e_t|^2 / 2   where   low <= p_t <= high,  |p_t - p_{t-1}| <= change.

G_t (m by n) are the model's slopes along the pressures q_t, and e_t is the error there. The limits are
separate for every muscle, so block coordinate descent converges to the minimum (Tseng, "Convergence of a
block coordinate descent method for nondifferentiable minimization", 2001): each muscle in turn is
planned exactly, by dynamic programming, with the pressures of the others fixed.

Kernels take tables row after row. A *path* is the n pressures before the horizon, then those of its
samples, n each. Limits are [change, lowest (n), highest (n)].
"""

from __future__ import annotations

from mckibben.arrays import Array
from mckibben.blocks.kernels import SLACK, fill, kernel

MOST_SWEEPS = 40
"""Maximum number of sweeps over all muscles; weakly coupled muscles need about ten."""

CONVERGED = 1e-9
"""Change of pressures in a sweep that ends the descent [bar]."""

DAMPING = 1e-6
"""Weight on the change of a pressure, relative to the mean squared slope."""

SINGLE = {"CONVERGED": 1e-5, "DAMPING": 1e-6}


@kernel
def clip_path(limits: Array, path: Array) -> bool:
    """Clip a path to all limits, sample by sample; return whether it was feasible.

    Where rate and range contradict each other, the range holds.
    """
    n, feasible = limits.size // 2, True
    for i in range(n, path.size):
        low, high = limits[1 + i % n], limits[1 + n + i % n]
        reached = min(max(path[i], path[i - n] - limits[0]), path[i - n] + limits[0])
        reached = min(max(reached, low), high)
        feasible = feasible and abs(path[i] - reached) <= SLACK
        path[i] = reached
    return feasible


@kernel
def plan_scratch(length: int) -> int:
    """Return the length of the working memory of a plan."""
    return 11 * length + 4


@kernel
def plan_path(
    limits: Array, slopes: Array, nominal: Array, errors: Array, path: Array, scratch: Array
) -> int:
    """Fill the pressures of a horizon from the preceding ones; return the number of sweeps.

    ``slopes`` are N by m by n, ``nominal`` (q) N by n and ``errors`` (e) N by m.
    """
    n = limits.size // 2
    length = nominal.size // n
    m = errors.size // length
    weights, targets, room = scratch[:length], scratch[length : 2 * length], scratch[2 * length :]
    fill(path[n:], nominal)
    for sweep in range(MOST_SWEEPS):
        change = 0.0
        for k in range(n):
            size = 0.0
            for t in range(length):
                weights[t], targets[t] = 0.0, 0.0
                for i in range(m):
                    row, left = slopes[(t * m + i) * n : (t * m + i + 1) * n], errors[t * m + i]
                    for j in range(n):
                        if j != k:
                            left -= row[j] * (path[(t + 1) * n + j] - nominal[t * n + j])
                    weights[t] += row[k] * row[k]
                    targets[t] += row[k] * left
                size += weights[t]
            damping = DAMPING * max(size / length, DAMPING)
            for t in range(length):
                weights[t] += damping
                targets[t] += weights[t] * nominal[t * n + k]
            moved = plan_muscle(k, limits, weights, targets, path, room)
            change = max(change, moved)
        if n == 1 or change <= CONVERGED:
            return sweep + 1
    return MOST_SWEEPS


@kernel
def plan_muscle(
    k: int, limits: Array, weights: Array, targets: Array, path: Array, scratch: Array
) -> float:
    """Fill the pressures of muscle k; return their largest change.

        V_t(p) = w_t p^2 / 2 - v_t p + min V_{t+1}(p')   over   |p' - p| <= change

    with weights w and targets v is convex and piecewise quadratic, so that its derivative is stored as
    knots: in each step, those below the minimum move down by the largest change, those above it up, and
    the derivative is 0 between them. The minima of all V, each approached as far as limits let, are the
    plan.
    """
    length, n = weights.size, limits.size // 2
    most = 4 * length + 2
    x, d, best = scratch[:most], scratch[most : 2 * most], scratch[2 * most :]
    low, high = limits[1 + k], limits[1 + n + k]
    rate = min(limits[0], high - low)
    count = 2
    x[0], x[1] = low, high
    d[0], d[1] = 0.0, 0.0
    for t in range(length - 1, -1, -1):
        if t + 1 < length:
            place, at = find_minimum(count, x, d, low, high, best, t + 1)
            under, over = min(at, 0.0), max(at, 0.0)
            for i in range(count - 1, place - 1, -1):
                x[i + 4], d[i + 4] = x[i] + rate, max(d[i], 0.0)
            for i in range(place):
                x[i], d[i] = x[i] - rate, min(d[i], 0.0)
            least = best[t + 1]
            x[place], d[place] = least - rate, under
            x[place + 1], d[place + 1] = least - rate, 0.0
            x[place + 2], d[place + 2] = least + rate, 0.0
            x[place + 3], d[place + 3] = least + rate, over
            count += 4
        for i in range(count):
            d[i] += weights[t] * x[i] - targets[t]
    _, _ = find_minimum(count, x, d, low, high, best, 0)
    last, change = path[k], 0.0
    for t in range(length):
        last = min(max(min(max(best[t], last - rate), last + rate), low), high)
        change = max(change, abs(last - path[(t + 1) * n + k]))
        path[(t + 1) * n + k] = last
    return change


@kernel
def find_minimum(
    count: int, x: Array, d: Array, low: float, high: float, best: Array, t: int
) -> tuple[int, float]:
    """Find where the derivative crosses 0 within the range; return the knot beyond, and the value."""
    place = 0
    while place < count and not d[place] > 0.0:
        place += 1
    if place == 0:
        least = x[0]
    elif place == count:
        least = x[count - 1]
    else:
        rest, rate = x[place] - x[place - 1], d[place] - d[place - 1]
        least = x[place - 1] - d[place - 1] * rest / rate
    inside = min(max(least, low), high)
    at = 0.0
    if inside != least or place == 0 or place == count:
        place = 0
        while place < count and not x[place] > inside:
            place += 1
        if place == 0:
            at = d[0]
        elif place == count:
            at = d[count - 1]
        else:
            share = (inside - x[place - 1]) / (x[place] - x[place - 1])
            at = d[place - 1] + share * (d[place] - d[place - 1])
    best[t] = inside
    return place, at
