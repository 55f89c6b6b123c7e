"""The plan of a horizon for one muscle: exact, by dynamic programming, in bounded time.

    V_t(p) = |g_t (p - q_t) - e_t|^2 / 2 + min V_{t+1}(p')   over   p - fall <= p' <= p + rise

is convex and piecewise quadratic, so that its derivative is kept as knots: what lies below the minimum
moves by the furthest rise, what lies above by the furthest fall, and between them nothing is lost. The
minima of all V, each approached as far as limits let, are the plan.
"""

from __future__ import annotations

from mckibben.arrays import Array
from mckibben.blocks.kernels import kernel

SINGLE = {"STAYING": 1e-6}

STAYING = 1e-6
"""Share of the mean squared slope by which pressures stay where no slope holds them."""


@kernel
def one_scratch(length: int) -> int:
    """Return how many numbers `plan_one` computes in."""
    return 9 * length + 4


@kernel
def plan_one(
    rows: Array,
    before: Array,
    slopes: Array,
    nominal: Array,
    errors: Array,
    p: Array,
    scratch: Array,
) -> None:
    """Find the pressures of a horizon, shape (N,), from the one before it.

    Arguments are those of `mckibben.blocks.predictive.plan.plan`, of one muscle.
    """
    length, m = p.size, rows.size // 3
    most = 4 * length + 2
    x, d, best = scratch[:most], scratch[most : 2 * most], scratch[2 * most :]
    low, high = -1e30, 1e30
    for i in range(m):
        end = rows[3 * i + 1] / rows[3 * i + 2]
        if not rows[3 * i] > 0.0:
            if rows[3 * i + 2] > 0.0:
                high = min(high, end)
            else:
                low = max(low, end)
    fall, rise = high - low, high - low
    for i in range(m):
        if rows[3 * i] > 0.0:
            if rows[3 * i + 2] > 0.0:
                rise = min(rise, rows[3 * i + 1] / rows[3 * i + 2])
            else:
                fall = min(fall, -rows[3 * i + 1] / rows[3 * i + 2])
    size = 0.0
    for t in range(length):
        size += slopes[t] * slopes[t]
    staying = STAYING * max(size / length, STAYING)
    count = 2
    x[0], x[1] = low, high
    d[0], d[1] = 0.0, 0.0
    for t in range(length - 1, -1, -1):
        if t + 1 < length:
            place, at = turned(count, x, d, low, high, best, t + 1)
            under, over = min(at, 0.0), max(at, 0.0)
            for i in range(count - 1, place - 1, -1):
                x[i + 4], d[i + 4] = x[i] + fall, max(d[i], 0.0)
            for i in range(place):
                x[i], d[i] = x[i] - rise, min(d[i], 0.0)
            least = best[t + 1]
            x[place], d[place] = least - rise, under
            x[place + 1], d[place + 1] = least - rise, 0.0
            x[place + 2], d[place + 2] = least + fall, 0.0
            x[place + 3], d[place + 3] = least + fall, over
            count += 4
        weight = slopes[t] * slopes[t] + staying
        wished = weight * nominal[t] + slopes[t] * errors[t]
        for i in range(count):
            d[i] += weight * x[i] - wished
    _, _ = turned(count, x, d, low, high, best, 0)
    last = before[0]
    for t in range(length):
        near = min(max(best[t], last - fall), last + rise)
        last = min(max(near, low), high)
        p[t] = last


@kernel
def turned(
    count: int, x: Array, d: Array, low: float, high: float, best: Array, t: int
) -> tuple[int, float]:
    """Find where the derivative passes 0, within the range; return the knot beyond, and the value."""
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
