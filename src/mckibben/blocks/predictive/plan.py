"""The plan of a horizon: pressures of all muscles in so many samples, as near a wish as limits let.

    min sum_t |G_t (p_t - q_t) - e_t|^2 / 2   where rows of `mckibben.blocks.predictive.supply` hold.

G_t (n by n) are the model's slopes along the pressures q_t, and e_t is what these leave of the error.
It is solved by a primal-dual interior-point method with Mehrotra's predictor (Nocedal and Wright,
"Numerical Optimization", ch. 16): each of few steps is one block-tridiagonal system, so that the time
grows with the horizon only as its length.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.kernels import kernel
from mckibben.blocks.predictive.supply import weighed_at

MOST_STEPS = 30
"""Of the interior-point method; it takes about ten."""

CLOSED = 1e-11
"""Gap between primal and dual, over the mean squared slope [bar^2], that counts as none."""

STAYS, FLAT = 1e-9, 1e-30
"""Weight of staying where no slope pulls, and mean squared slope below which there is none."""

SINGLE = {"CLOSED": 1e-7, "STAYS": 1e-6, "FLAT": 1e-30}

ROOM = 0.3
"""Least room that limits are given at the start [bar], and their price."""


@kernel
def plan_scratch(length: int, n: int, rows: int) -> int:
    """Return how many numbers `plan` computes in."""
    return length * (3 * n * n + 3 * n + 6 * rows) + 2 * n * n + 2 * n


@kernel
def invert_small(n: int, matrix: Array, result: Array) -> None:
    """Invert a positive definite matrix, n by n in a row, by Gauss and Jordan; destroys it."""
    for i in range(n * n):
        result[i] = 0.0
    for i in range(n):
        result[i * n + i] = 1.0
    for i in range(n):
        pivot = 1.0 / matrix[i * n + i]
        for j in range(n):
            matrix[i * n + j] *= pivot
            result[i * n + j] *= pivot
        for row in range(n):
            factor = matrix[row * n + i]
            if row != i:
                for j in range(n):
                    matrix[row * n + j] -= factor * matrix[i * n + j]
                    result[row * n + j] -= factor * result[i * n + j]


@kernel
def applied(n: int, matrix: Array, x: Array, scale: float, y: Array) -> None:
    """Add to y a matrix, n by n in a row, times x and a number."""
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += matrix[i * n + j] * x[j]
        y[i] += scale * total


@kernel
def factored(
    n: int,
    rows: Array,
    hessian: Array,
    room: Array,
    price: Array,
    off: Array,
    factors: Array,
    work: Array,
) -> None:
    """Factor the system of one step: ``factors`` are inverses along the diagonal, ``off`` beside it."""
    width, block = n + 2, n * n
    m = rows.size // width
    length = room.size // m
    matrix, product = work[:block], work[block : 2 * block]
    for t in range(length):
        beside = off[t * block : (t + 1) * block]
        for i in range(block):
            matrix[i] = hessian[t * block + i]
            beside[i] = 0.0
        for later in range(2):  # changes of the next sample are of this one's pressures too
            for i in range(m if t + later < length else 0):
                row = rows[i * width : (i + 1) * width]
                if later == 0 or row[0] > 0.0:
                    weight = price[(t + later) * m + i] / room[(t + later) * m + i]
                    for j in range(n):
                        for k in range(n):
                            added = weight * row[2 + j] * row[2 + k]
                            matrix[j * n + k] += added
                            if later == 0 and row[0] > 0.0:
                                beside[j * n + k] -= added
        if t > 0:
            last = factors[(t - 1) * block : t * block]
            for i in range(n):
                for j in range(n):
                    total = 0.0
                    for k in range(n):
                        total += last[i * n + k] * beside[k * n + j]
                    product[i * n + j] = total
            for i in range(n):
                for j in range(n):
                    total = 0.0
                    for k in range(n):
                        total += beside[i * n + k] * product[k * n + j]
                    matrix[i * n + j] -= total
        invert_small(n, matrix, factors[t * block : (t + 1) * block])


@kernel
def moved(
    n: int,
    rows: Array,
    factors: Array,
    off: Array,
    right: Array,
    step: Array,
    room: Array,
    price: Array,
    goal: Array,
    room_step: Array,
    price_step: Array,
    short: Array,
    point: Array,
) -> None:
    """Solve for one step of pressures, of the room that limits leave, and of their prices.

    ``right`` is what the pressures' gradient lacks; ``goal`` what room times price shall become, over
    room; ``short`` what rooms are off.
    """
    width, block, length = n + 2, n * n, right.size // n
    m = rows.size // width
    none, forward = point[:n], point[n : 2 * n]
    for k in range(n):
        none[k] = 0.0
    for t in range(length):
        for k in range(n):
            step[t * n + k] = right[t * n + k]
    for t in range(length):
        for i in range(m):
            row, at = rows[i * width : (i + 1) * width], t * m + i
            pull = goal[at] - price[at] + price[at] / room[at] * short[at]
            for k in range(n):
                step[t * n + k] -= pull * row[2 + k]
                if t > 0 and row[0] > 0.0:
                    step[(t - 1) * n + k] += pull * row[2 + k]
    for t in range(length):
        now = step[t * n : (t + 1) * n]
        for k in range(n):
            forward[k] = now[k]
        if t > 0:
            beside = off[t * block : (t + 1) * block]
            applied(n, beside, step[(t - 1) * n : t * n], -1.0, forward)
        for k in range(n):
            now[k] = 0.0
        applied(n, factors[t * block : (t + 1) * block], forward, 1.0, now)
    for t in range(length - 2, -1, -1):
        for k in range(n):
            forward[k] = 0.0
        after = step[(t + 1) * n : (t + 2) * n]
        applied(n, off[(t + 1) * block : (t + 2) * block], after, 1.0, forward)
        own = factors[t * block : (t + 1) * block]
        applied(n, own, forward, -1.0, step[t * n : (t + 1) * n])
    for t in range(length):
        for i in range(m):
            at = t * m + i
            change = weighed_at(n, rows[i * width : (i + 1) * width], none, step, t)
            room_step[at] = -short[at] - change
            price_step[at] = goal[at] - price[at] - price[at] / room[at] * room_step[at]


@kernel
def furthest(values: Array, steps: Array) -> float:
    """Return the share of a step, at most 1, at which the first value becomes 0."""
    share = 1.0
    for i in range(values.size):
        if steps[i] < 0.0:
            share = min(share, -values[i] / steps[i])
    return share


@kernel
def plan(
    n: int,
    rows: Array,
    before: Array,
    slopes: Array,
    nominal: Array,
    errors: Array,
    p: Array,
    scratch: Array,
) -> int:
    """Find the pressures of a horizon, N by n in a row, from those before it; return the steps taken.

    ``slopes`` are N by n by n in a row; ``nominal`` (q), ``errors`` (e) and ``p`` are N by n.
    """
    width, block, length = n + 2, n * n, p.size // n
    m = rows.size // width
    hessian, off = scratch[: length * block], scratch[length * block : 2 * length * block]
    factors, rest = scratch[2 * length * block : 3 * length * block], scratch[3 * length * block :]
    wished, right = rest[: length * n], rest[length * n : 2 * length * n]
    step, tables = rest[2 * length * n : 3 * length * n], rest[3 * length * n :]
    room, price = tables[: length * m], tables[length * m : 2 * length * m]
    short, goal = tables[2 * length * m : 3 * length * m], tables[3 * length * m : 4 * length * m]
    room_step = tables[4 * length * m : 5 * length * m]
    price_step, work = tables[5 * length * m : 6 * length * m], tables[6 * length * m :]
    size = 0.0
    for i in range(length * block):
        size += slopes[i] * slopes[i]
    size = max(size / (length * n), FLAT)
    for t in range(length):
        slope, own = slopes[t * block : (t + 1) * block], hessian[t * block : (t + 1) * block]
        for i in range(n):
            for j in range(n):
                total = 0.0
                for k in range(n):
                    total += slope[k * n + i] * slope[k * n + j]
                own[i * n + j] = total / size
            own[i * n + i] += STAYS
        for i in range(n):
            wished[t * n + i] = 0.0
            for k in range(n):
                wished[t * n + i] += slope[k * n + i] * errors[t * n + k] / size
                wished[t * n + i] += own[i * n + k] * nominal[t * n + k]
    for t in range(length):
        for k in range(n):
            p[t * n + k] = nominal[t * n + k]
        for i in range(m):
            row = rows[i * width : (i + 1) * width]
            room[t * m + i] = max(row[1] - weighed_at(n, row, before, p, t), ROOM)
            price[t * m + i] = ROOM
    for taken in range(MOST_STEPS):
        gap, amiss = 0.0, 0.0
        for t in range(length):
            for k in range(n):
                right[t * n + k] = wished[t * n + k]
            curved = hessian[t * block : (t + 1) * block]
            applied(n, curved, p[t * n : (t + 1) * n], -1.0, right[t * n : (t + 1) * n])
        for t in range(length):
            for i in range(m):
                limit, at = rows[i * width : (i + 1) * width], t * m + i
                short[at] = weighed_at(n, limit, before, p, t) + room[at] - limit[1]
                amiss = max(amiss, abs(short[at]))
                gap += room[at] * price[at]
                for k in range(n):
                    right[t * n + k] -= price[at] * limit[2 + k]
                    if t > 0 and limit[0] > 0.0:
                        right[(t - 1) * n + k] += price[at] * limit[2 + k]
        gap /= length * m
        if gap <= CLOSED and amiss * amiss <= CLOSED:
            return taken
        factored(n, rows, hessian, room, price, off, factors, work)
        for i in range(length * m):
            goal[i] = 0.0
        moved(
            n,
            rows,
            factors,
            off,
            right,
            step,
            room,
            price,
            goal,
            room_step,
            price_step,
            short,
            work,
        )
        share, dear = furthest(room, room_step), furthest(price, price_step)
        then = 0.0
        for i in range(length * m):
            then += (room[i] + share * room_step[i]) * (price[i] + dear * price_step[i])
        then = then / (length * m) / gap
        centre = gap * then * then * then
        for i in range(length * m):
            goal[i] = (centre - room_step[i] * price_step[i]) / room[i]
        moved(
            n,
            rows,
            factors,
            off,
            right,
            step,
            room,
            price,
            goal,
            room_step,
            price_step,
            short,
            work,
        )
        share = 0.99 * min(furthest(room, room_step), furthest(price, price_step))
        size = 0.0
        for i in range(length * n):
            size += abs(step[i])
        if not size < np.inf:  # as near as rounding lets it come
            return taken
        for i in range(length * n):
            p[i] += share * step[i]
        for i in range(length * m):
            room[i] += share * room_step[i]
            price[i] += share * price_step[i]
    return MOST_STEPS
