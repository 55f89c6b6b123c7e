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
from mckibben.blocks.core.kernels import kernel
from mckibben.blocks.predictive.supply import weighed

MOST_STEPS = 30
"""Of the interior-point method; it takes about ten."""

CLOSED = 1e-11
"""Gap between primal and dual, over the mean squared slope [bar^2], that counts as none."""

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
    rows: Array, hessian: Array, room: Array, price: Array, off: Array, factors: Array, work: Array
) -> None:
    """Factor the system of one step: ``factors`` are inverses along the diagonal, ``off`` beside it."""
    length, n = room.shape[0], rows.shape[1] - 2
    block = n * n
    matrix, product = work[:block], work[block : 2 * block]
    for t in range(length):
        for i in range(block):
            matrix[i] = hessian[t * block + i]
            off[t * block + i] = 0.0
        for later in range(2):  # changes of the next sample are of this one's pressures too
            if t + later < length:
                for i in range(rows.shape[0]):
                    if later == 0 or rows[i, 0] > 0.0:
                        weight = price[t + later, i] / room[t + later, i]
                        for j in range(n):
                            for k in range(n):
                                added = weight * rows[i, 2 + j] * rows[i, 2 + k]
                                matrix[j * n + k] += added
                                if later == 0 and rows[i, 0] > 0.0:
                                    off[t * block + j * n + k] -= added
        if t > 0:
            last = factors[(t - 1) * block : t * block]
            beside = off[t * block : (t + 1) * block]
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
    length, n = right.shape
    block = n * n
    none = point[:n]
    for k in range(n):
        none[k] = 0.0
    for t in range(length):
        for k in range(n):
            step[t, k] = right[t, k]
    for t in range(length):
        for i in range(rows.shape[0]):
            pull = goal[t, i] - price[t, i] + price[t, i] / room[t, i] * short[t, i]
            for k in range(n):
                step[t, k] -= pull * rows[i, 2 + k]
                if t > 0 and rows[i, 0] > 0.0:
                    step[t - 1, k] += pull * rows[i, 2 + k]
    forward = point[n:]
    for t in range(length):
        for k in range(n):
            forward[k] = step[t, k]
        if t > 0:
            applied(n, off[t * block : (t + 1) * block], step[t - 1], -1.0, forward)
        for k in range(n):
            step[t, k] = 0.0
        applied(n, factors[t * block : (t + 1) * block], forward, 1.0, step[t])
    for t in range(length - 2, -1, -1):
        for k in range(n):
            forward[k] = 0.0
        applied(n, off[(t + 1) * block : (t + 2) * block], step[t + 1], 1.0, forward)
        applied(n, factors[t * block : (t + 1) * block], forward, -1.0, step[t])
    for t in range(length):
        for i in range(rows.shape[0]):
            change = weighed(rows[i], none if t == 0 else step[t - 1], step[t])
            room_step[t, i] = -short[t, i] - change
            price_step[t, i] = goal[t, i] - price[t, i] - price[t, i] / room[t, i] * room_step[t, i]


@kernel
def furthest(values: Array, steps: Array) -> float:
    """Return the share of a step, at most 1, at which the first value becomes 0."""
    share = 1.0
    for t in range(values.shape[0]):
        for i in range(values.shape[1]):
            if steps[t, i] < 0.0:
                share = min(share, -values[t, i] / steps[t, i])
    return share


@kernel
def plan(
    rows: Array,
    before: Array,
    slopes: Array,
    nominal: Array,
    errors: Array,
    p: Array,
    scratch: Array,
) -> int:
    """Find the pressures of a horizon, shape (N, n), from those before it; return the steps taken.

    ``slopes`` has N n n numbers; ``nominal`` (q), ``errors`` (e) and ``p`` are (N, n).
    """
    length, n = p.shape
    m, block = rows.shape[0], n * n
    blocks = scratch[: 3 * length * block]
    hessian, off = blocks[: length * block], blocks[length * block : 2 * length * block]
    factors = blocks[2 * length * block :]
    place = 3 * length * block
    vectors = scratch[place : place + 3 * length * n].reshape((3, length, n))
    wished, right, step = vectors[0], vectors[1], vectors[2]
    place += 3 * length * n
    tables = scratch[place : place + 6 * length * m].reshape((6, length, m))
    room, price, short = tables[0], tables[1], tables[2]
    goal, room_step, price_step = tables[3], tables[4], tables[5]
    work = scratch[place + 6 * length * m :]
    size = 0.0
    for i in range(length * block):
        size += slopes[i] * slopes[i]
    size = max(size / (length * n), 1e-30)
    for t in range(length):
        slope = slopes[t * block : (t + 1) * block]
        for i in range(n):
            for j in range(n):
                total = 0.0
                for k in range(n):
                    total += slope[k * n + i] * slope[k * n + j]
                hessian[t * block + i * n + j] = total / size
            hessian[t * block + i * n + i] += 1e-9  # where nothing pulls, stay
        for i in range(n):
            wished[t, i] = 0.0
            for k in range(n):
                wished[t, i] += slope[k * n + i] * errors[t, k] / size
                wished[t, i] += hessian[t * block + i * n + k] * nominal[t, k]
    for t in range(length):
        for k in range(n):
            p[t, k] = nominal[t, k]
        for i in range(m):
            left = rows[i, 1] - weighed(rows[i], before if t == 0 else p[t - 1], p[t])
            room[t, i] = max(left, ROOM)
            price[t, i] = ROOM
    for taken in range(MOST_STEPS):
        gap = 0.0
        amiss = 0.0
        for t in range(length):
            for k in range(n):
                right[t, k] = wished[t, k]
            applied(n, hessian[t * block : (t + 1) * block], p[t], -1.0, right[t])
        for t in range(length):
            for i in range(m):
                now = weighed(rows[i], before if t == 0 else p[t - 1], p[t])
                short[t, i] = now + room[t, i] - rows[i, 1]
                amiss = max(amiss, abs(short[t, i]))
                gap += room[t, i] * price[t, i]
                for k in range(n):
                    right[t, k] -= price[t, i] * rows[i, 2 + k]
                    if t > 0 and rows[i, 0] > 0.0:
                        right[t - 1, k] += price[t, i] * rows[i, 2 + k]
        gap /= length * m
        if gap <= CLOSED and amiss * amiss <= CLOSED:
            return taken
        factored(rows, hessian, room, price, off, factors, work)
        for t in range(length):
            for i in range(m):
                goal[t, i] = 0.0
        moved(
            rows, factors, off, right, step, room, price, goal, room_step, price_step, short, work
        )
        share, dear = furthest(room, room_step), furthest(price, price_step)
        then = 0.0
        for t in range(length):
            for i in range(m):
                then += (room[t, i] + share * room_step[t, i]) * (
                    price[t, i] + dear * price_step[t, i]
                )
        then = then / (length * m) / gap
        centre = gap * then * then * then
        for t in range(length):
            for i in range(m):
                goal[t, i] = (centre - room_step[t, i] * price_step[t, i]) / room[t, i]
        moved(
            rows, factors, off, right, step, room, price, goal, room_step, price_step, short, work
        )
        share = 0.99 * min(furthest(room, room_step), furthest(price, price_step))
        size = 0.0
        for t in range(length):
            for k in range(n):
                size += abs(step[t, k])
        if not size < np.inf:  # as near as rounding lets it come
            return taken
        for t in range(length):
            for k in range(n):
                p[t, k] += share * step[t, k]
            for i in range(m):
                room[t, i] += share * room_step[t, i]
                price[t, i] += share * price_step[t, i]
    return MOST_STEPS
