"""Horizon optimisation: pressures of all muscles, closest to a target within limits.

    min sum_t |G_t (p_t - q_t) - e_t|^2 / 2   where all limits hold.

G_t (m by n) are the model's slopes along the pressures q_t, and e_t is what these leave of the error. A
limit is a row [whether it is of changes, bound, n weights]: the weighted sum of the n pressures, or of
how they change in a step, stays at or below the bound. A row with one weight is a muscle's own.

Of several muscles, `plan_several` solves it by a primal-dual interior-point method with Mehrotra's
predictor (Nocedal and Wright, "Numerical Optimization", ch. 16): each of few steps is one block-
tridiagonal system, so that the time grows only in proportion to the horizon. Of one muscle, `plan_one`
solves it exactly, by dynamic programming, in bounded time.

Kernels take tables row after row. A *path* is the n pressures before the horizon, then those of its
samples, n each.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.kernels import SLACK, fill, kernel

MOST_STEPS = 30
"""Maximum number of steps of the interior-point method; it needs about ten."""

CLOSED = 1e-11
"""Duality gap, relative to the mean squared slope, that counts as zero [bar^2]."""

STAYS, FLAT = 1e-9, 1e-30
"""Weight on constant pressure where the slope is zero, and mean squared slope that counts as zero.
"""

STAYING = 1e-6
"""The same for one muscle: weight on constant pressure, relative to the mean squared slope."""

ROOM = 0.3
"""Initial slack of the limits [bar], and its cost."""

SINGLE = {"CLOSED": 1e-7, "STAYS": 1e-6, "FLAT": 1e-30, "STAYING": 1e-6}


def limit_rows(
    low: Array, high: Array, change: float, total: float, draw: float, volumes: Array
) -> Array:
    """Return all finite limits, shape (rows, 2 + n).

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
def weighed(row: Array, path: Array, t: int) -> float:
    """Return the weighted sum of a limit's row in sample t of a path."""
    n, total = row.size - 2, 0.0
    for k in range(n):
        from_here = path[t * n + k] if row[0] > 0.0 else 0.0
        total += row[2 + k] * (path[(t + 1) * n + k] - from_here)
    return total


@kernel
def own_place(row: Array) -> int:
    """Return the muscle of a limit's row, or -1 for several."""
    found = -1
    for k in range(row.size - 2):
        if row[2 + k] != 0.0:
            if found >= 0:
                return -1
            found = k
    return found


@kernel
def allowed(n: int, rows: Array, path: Array, t: int, at_any_rate: bool) -> bool:
    """Project sample t of a path onto the limits; return whether it changed nothing.

    Each pressure goes to its own limits; what the supply cannot give is taken from all changes in one
    share. Limits of changes are left out where it may move at any rate.
    """
    there, width = True, n + 2
    m, now, before = rows.size // width, path[(t + 1) * n :], path[t * n :]
    for turn in range(2):  # changes first: the range is what counts in the end
        for i in range(m):
            row = rows[i * width : (i + 1) * width]
            own = own_place(row)
            if own >= 0 and int(row[0]) == 1 - turn and not (at_any_rate and turn == 0):
                over = weighed(row, path, t) - row[1]
                if over > 0.0:
                    now[own] -= over / row[2 + own]
                    there = there and over <= SLACK
    share = 1.0
    for i in range(m):
        limit = rows[i * width : (i + 1) * width]
        if own_place(limit) < 0 and not (at_any_rate and limit[0] > 0.0):
            wanted, was = weighed(limit, path, t), 0.0
            for k in range(n if limit[0] == 0.0 else 0):
                was += limit[2 + k] * before[k]
            if wanted > limit[1]:
                there = there and wanted - limit[1] <= SLACK
                if wanted > was:
                    share = min(share, max(limit[1] - was, 0.0) / (wanted - was))
    if share < 1.0:
        for k in range(n):
            now[k] = before[k] + share * (now[k] - before[k])
    return there


@kernel
def clipped_to(n: int, rows: Array, path: Array) -> bool:
    """Clip a path to all limits, sample by sample; return whether it was feasible."""
    there = True
    for t in range(path.size // n - 1):
        one = allowed(n, rows, path, t, False)
        there = there and one
    return there


@kernel
def plan_scratch(length: int, n: int, rows: int) -> int:
    """Return the length of the working memory of a plan."""
    if n == 1:
        return 9 * length + 4
    return length * (3 * n * n + 3 * n + 6 * rows) + 2 * n * n + 2 * n


@kernel
def invert_small(n: int, matrix: Array, result: Array) -> None:
    """Invert a positive definite matrix, n by n in a row, by Gauss-Jordan elimination, in place."""
    for i in range(n * n):
        result[i] = 1.0 if i % (n + 1) == 0 else 0.0
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
    """Add to y a matrix, n by n in a row, times x and a factor."""
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += matrix[i * n + j] * x[j]
        y[i] += scale * total


@kernel
def factored(n: int, rows: Array, hessian: Array, duals: Array, system: Array, work: Array) -> None:
    """Factor the system of one step, [beside the diagonal, inverses along it], n by n a sample."""
    width, block, count = n + 2, n * n, duals.size // 6
    m, length = rows.size // width, hessian.size // block
    room, price = duals[:count], duals[count : 2 * count]
    off, factors = system[: length * block], system[length * block :]
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
    n: int, rows: Array, system: Array, right: Array, step: Array, duals: Array, work: Array
) -> None:
    """Solve for one step of a path, of the slacks, and of their multipliers.

    ``right`` is what the pressures' gradient lacks; ``duals`` are [room, price, what rooms are off, what
    room times price shall become over room, step of room, step of price], all rows of each sample.
    """
    width, block, length = n + 2, n * n, right.size // n
    m, count = rows.size // width, duals.size // 6
    room, price, short = duals[:count], duals[count : 2 * count], duals[2 * count : 3 * count]
    goal, room_step = duals[3 * count : 4 * count], duals[4 * count : 5 * count]
    price_step, forward = duals[5 * count :], work[:n]
    off, factors = system[: length * block], system[length * block :]
    step[:n] = 0.0
    fill(step[n:], right)
    for t in range(length):
        for i in range(m):
            row, at = rows[i * width : (i + 1) * width], t * m + i
            pull = goal[at] - price[at] + price[at] / room[at] * short[at]
            for k in range(n):
                step[(t + 1) * n + k] -= pull * row[2 + k]
                if t > 0 and row[0] > 0.0:
                    step[t * n + k] += pull * row[2 + k]
    for t in range(length):
        now = step[(t + 1) * n : (t + 2) * n]
        fill(forward, now)
        if t > 0:
            applied(n, off[t * block : (t + 1) * block], step[t * n : (t + 1) * n], -1.0, forward)
        now[:] = 0.0
        applied(n, factors[t * block : (t + 1) * block], forward, 1.0, now)
    for t in range(length - 2, -1, -1):
        forward[:] = 0.0
        after, here = step[(t + 2) * n : (t + 3) * n], step[(t + 1) * n : (t + 2) * n]
        applied(n, off[(t + 1) * block : (t + 2) * block], after, 1.0, forward)
        applied(n, factors[t * block : (t + 1) * block], forward, -1.0, here)
    for t in range(length):
        for i in range(m):
            at = t * m + i
            room_step[at] = -short[at] - weighed(rows[i * width : (i + 1) * width], step, t)
            price_step[at] = goal[at] - price[at] - price[at] / room[at] * room_step[at]


@kernel
def furthest(values: Array, steps: Array) -> float:
    """Return the largest share of a step, at most 1, that leaves all values positive."""
    share = 1.0
    for i in range(values.size):
        if steps[i] < 0.0:
            share = min(share, -values[i] / steps[i])
    return share


@kernel
def plan_several(
    n: int, rows: Array, slopes: Array, nominal: Array, errors: Array, path: Array, scratch: Array
) -> int:
    """Find the pressures of a horizon from the preceding ones; return the number of steps.

    ``slopes`` are N by m by n, ``nominal`` (q) N by n and ``errors`` (e) N by m.
    """
    width, block, length = n + 2, n * n, nominal.size // n
    n_errors = errors.size // length
    m = rows.size // width
    count, size_of = length * m, length * block
    hessian, system = scratch[:size_of], scratch[size_of : 3 * size_of]
    vectors = scratch[3 * size_of :]
    desired, right = vectors[: length * n], vectors[length * n : 2 * length * n]
    rest = vectors[2 * length * n :]
    step, others = rest[: (length + 1) * n], rest[(length + 1) * n :]
    duals, work = others[: 6 * count], others[6 * count :]
    room, price, short = duals[:count], duals[count : 2 * count], duals[2 * count : 3 * count]
    goal, room_step = duals[3 * count : 4 * count], duals[4 * count : 5 * count]
    price_step, p = duals[5 * count :], path[n:]
    size = 0.0
    for i in range(errors.size * n):
        size += slopes[i] * slopes[i]
    size = max(size / (length * n), FLAT)
    for t in range(length):
        slope, own = slopes[t * n_errors * n :], hessian[t * block : (t + 1) * block]
        for i in range(n):
            for j in range(n):
                total = 0.0
                for k in range(n_errors):
                    total += slope[k * n + i] * slope[k * n + j]
                own[i * n + j] = total / size
            own[i * n + i] += STAYS
        for i in range(n):
            desired[t * n + i] = 0.0
            for k in range(n_errors):
                desired[t * n + i] += slope[k * n + i] * errors[t * n_errors + k] / size
            for k in range(n):
                desired[t * n + i] += own[i * n + k] * nominal[t * n + k]
    fill(p, nominal)
    for t in range(length):
        for i in range(m):
            row = rows[i * width : (i + 1) * width]
            room[t * m + i] = max(row[1] - weighed(row, path, t), ROOM)
            price[t * m + i] = ROOM
    for taken in range(MOST_STEPS):
        gap, amiss = 0.0, 0.0
        fill(right, desired)
        for t in range(length):
            curved = hessian[t * block : (t + 1) * block]
            applied(n, curved, p[t * n : (t + 1) * n], -1.0, right[t * n : (t + 1) * n])
        for t in range(length):
            for i in range(m):
                limit, at = rows[i * width : (i + 1) * width], t * m + i
                short[at] = weighed(limit, path, t) + room[at] - limit[1]
                amiss = max(amiss, abs(short[at]))
                gap += room[at] * price[at]
                for k in range(n):
                    right[t * n + k] -= price[at] * limit[2 + k]
                    if t > 0 and limit[0] > 0.0:
                        right[(t - 1) * n + k] += price[at] * limit[2 + k]
        gap /= count
        if gap <= CLOSED and amiss * amiss <= CLOSED:
            return taken
        factored(n, rows, hessian, duals, system, work)
        goal[:] = 0.0
        moved(n, rows, system, right, step, duals, work)
        share, dear = furthest(room, room_step), furthest(price, price_step)
        then = 0.0
        for i in range(count):
            then += (room[i] + share * room_step[i]) * (price[i] + dear * price_step[i])
        then = then / count / gap
        centre = gap * then * then * then
        for i in range(count):
            goal[i] = (centre - room_step[i] * price_step[i]) / room[i]
        moved(n, rows, system, right, step, duals, work)
        share = 0.99 * min(furthest(room, room_step), furthest(price, price_step))
        size = 0.0
        for i in range(length * n):
            size += abs(step[n + i])
        if not size < np.inf:  # as near as rounding lets it come
            return taken
        for i in range(length * n):
            p[i] += share * step[n + i]
        for i in range(count):
            room[i] += share * room_step[i]
            price[i] += share * price_step[i]
    return MOST_STEPS


@kernel
def plan_one(
    n: int, rows: Array, slopes: Array, nominal: Array, errors: Array, path: Array, scratch: Array
) -> int:
    """Find the pressures of a horizon, as `plan_several`, of one muscle; return 0 steps.

        V_t(p) = |g_t (p - q_t) - e_t|^2 / 2 + min V_{t+1}(p')   over   p - fall <= p' <= p + rise

    is convex and piecewise quadratic, so that its derivative is kept as knots: what lies below the
    minimum moves by the furthest rise, what lies above by the furthest fall, and between them nothing is
    lost. The minima of all V, each approached as far as limits let, are the plan.
    """
    length, m = nominal.size, rows.size // 3
    most = 4 * length + 2
    x, d, best = scratch[:most], scratch[most : 2 * most], scratch[2 * most :]
    low, high, fall, rise = -1e30, 1e30, np.inf, np.inf
    for i in range(m):
        end = rows[3 * i + 1] / rows[3 * i + 2]
        if rows[3 * i] > 0.0 and rows[3 * i + 2] > 0.0:
            rise = min(rise, end)
        elif rows[3 * i] > 0.0:
            fall = min(fall, -end)
        elif rows[3 * i + 2] > 0.0:
            high = min(high, end)
        else:
            low = max(low, end)
    fall, rise = min(fall, high - low), min(rise, high - low)
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
        desired = weight * nominal[t] + slopes[t] * errors[t]
        for i in range(count):
            d[i] += weight * x[i] - desired
    _, _ = turned(count, x, d, low, high, best, 0)
    last = path[0]
    for t in range(length):
        near = min(max(best[t], last - fall), last + rise)
        last = min(max(near, low), high)
        path[1 + t] = last
    return 0


@kernel
def turned(
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
