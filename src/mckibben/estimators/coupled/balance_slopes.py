"""Simulation of a force balance with exact derivatives by its parameters.

Either free, where its coordinates are what matters, or held where they were measured, where the forces
that it then lacks are: those are linear, and memory does not depend on coefficients. The direct slopes
are the terms of `mckibben.blocks.coupled.balance_law`; what moves them through the past is carried.

Columns of slopes are the coefficients from those of the first coordinate on, then the shape: the
friction offset, its slopes by scheduling inputs, the logarithms of the ratio of limits and of lags,
stretch of the walls, forces of slackening, places of obstacles, and what changes the pressures that act,
whose slopes are given.
"""

from __future__ import annotations

import math

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance_law import (
    AT_REST,
    DYNAMIC,
    FROM_REST,
    HEAD,
    IN_TIME,
    LEAST_AREA,
    OWN,
    area,
    coordinate_at,
    friction_pressure,
    muscle_at,
    muscle_force,
    n_terms,
    shortening,
    solve_equilibrium,
    terms_at,
    unbalanced,
    update_state,
)
from mckibben.blocks.kernels import fill, inlined, kernel
from mckibben.blocks.solving import eliminate

FEW_STEPS, CLOSE = 6, 1e-7
"""Number of Newton steps without a search along them; relative residual from which one more is the last.
"""


@kernel
def mix(to: Array, kept: float, share: float, row: Array) -> None:
    """Form a weighted sum in place, over all coefficients."""
    for i in range(to.size):
        to[i] = kept * to[i] + share * row[i]


@kernel
def clear(to: Array) -> None:
    """Fill with zeros."""
    for i in range(to.size):
        to[i] = 0.0


@kernel
def n_shape(c: Array) -> int:
    """Return the number of derivative columns of nonlinear parameters, before the front's."""
    return walls_at(c) + 1 + int(c[0]) + int(c[1]) * int(c[9])


@kernel
def walls_at(c: Array) -> int:
    """Return the column of the walls among those; forces of slackening follow, then obstacles."""
    return 2 + int(c[2]) + int(c[6])


@inlined
def by_coupling(c: Array, j: int, q: Array, x: Array, places: int, slopes: Array) -> None:
    """Fill derivatives of the force on coordinate j by its coefficients and obstacle positions."""
    m, n_x, degree, n_loads = int(c[1]), int(c[2]), int(c[3]), int(c[4])
    first = coordinate_at(c, 0)
    place = coordinate_at(c, j) - first
    clear(slopes)
    power = 1.0
    for order in range(1 + n_x * degree):
        if order > 0:
            power = x[(order - 1) // degree] * (power if (order - 1) % degree > 0 else 1.0)
        slopes[place] = power
        for i in range(m):
            slopes[place + 1 + i] = power * q[i]
        place += 1 + m
    for i in range(n_loads):
        slopes[place + i] = x[n_x + i]
    place += n_loads
    for number in range(int(c[9])):
        at = first + place
        beyond = q[j] - c[at + 1]
        if c[at] * beyond > 0.0:
            slopes[place + 2] = beyond
            stiffness = c[at + 2]
            for s in range(n_x):
                slopes[place + 3 + s] = x[s] * beyond
                stiffness += c[at + 3 + s] * x[s]
            slopes[places + j * int(c[9]) + number] = -stiffness
        place += 3 + n_x


@kernel
def by_limit(
    c: Array, i: int, s: float, p: float, x: Array, dp: Array, share: float, to: Array
) -> None:
    """Add a share of a sliding stop's derivatives by nonlinear parameters, from column 0 on."""
    n_x = int(c[2])
    upper = c[HEAD + i]
    if s < 0.0:
        upper *= -c[12]
        to[1 + n_x] += share * s
    if not friction_pressure(c, p, x) > 0.0:
        return
    to[0] += share * upper
    for j in range(n_x):
        to[1 + j] += share * upper * x[j]
    for f in range(dp.size):
        to[to.size - dp.size + f] += share * upper * dp[f]


@inlined
def by_shape(
    c: Array,
    k: int,
    state: Array,
    way: int,
    y: float,
    p: float,
    x: Array,
    dp: Array,
    terms: Array,
    slopes: Array,
    late: Array,
    to: Array,
) -> None:
    """Add a taut muscle's derivatives by nonlinear parameters at fixed past, and fill those of lags.

    ``terms`` and ``slopes`` are its own; ``to`` begins with the shape; ``late`` has a number a lag.
    """
    n, m, n_s, n_l = int(c[0]), int(c[1]), int(c[5]), int(c[6])
    place, first = muscle_at(c, k) + OWN + m, n_terms(c) - n_l - n_s
    taut = slopes[3] != 0.0
    moved = y - shortening(c, k, state)
    for i in range(n_l):
        late[i] = 0.0
        if way == IN_TIME:
            decay, gain = c[HEAD + n_s + i], c[HEAD + n_s + n_l + i]
            past = state[m + n + n * n_s + k * n_l + i]
            late[i] = -decay * math.log(decay) * past + (gain - decay) * moved
            if taut:
                to[2 + int(c[2]) + i] += c[place + first + n_s + i] * late[i]
    if not taut:
        to[walls_at(c) + 1 + k] += 1.0
        return
    a, wall = area(c, k, y)[0], c[muscle_at(c, k) + 2]
    for f in range(dp.size):
        to[to.size - dp.size + f] -= a * dp[f]
    for i in range(n_s if way != AT_REST else 0):
        h = c[place + first + i]
        if slopes[first + i] == 0.0:
            by_limit(c, i, terms[first + i], p, x, dp, h, to)
        else:
            to[walls_at(c)] += h * p
            for f in range(dp.size):
                to[to.size - dp.size + f] += h * wall * dp[f]


@inlined
def by_least_area(c: Array, k: int, y: float, p: float, slopes: Array, to: Array) -> None:
    """Replace a taut muscle's derivatives by its area where that is at its least, relative to rest."""
    first = terms_at(c, k) + DYNAMIC + int(c[7])
    least, column = LEAST_AREA * c[first], first - coordinate_at(c, 0)
    if least > 0.0 and slopes[3] != 0.0 and not area(c, k, y)[0] > least:
        clear(to[column : column + int(c[8])])
        to[column] = -LEAST_AREA * p


@inlined
def through_past(c: Array, k: int, slopes: Array, past: Array, moved: Array, to: Array) -> None:
    """Add derivatives of the force of muscle k through its past, given in ``past``.

    ``slopes`` are those of its terms by its shortening, and ``moved`` those of its last shortening.
    """
    n, n_s, n_l, m = int(c[0]), int(c[5]), int(c[6]), int(c[1])
    place = muscle_at(c, k) + OWN + m
    first = n_terms(c) - n_l - n_s
    carried = c[place] * slopes[0] + c[place + 1] * slopes[1] + c[place + 2] * slopes[2]
    for i in range(n_s):
        if slopes[first + i] != 0.0:
            mix(to, 1.0, c[place + first + i], past[m + k * n_s + i])
    for i in range(n_l):
        kappa = c[place + first + n_s + i]
        carried += kappa * slopes[first + n_s + i]
        if slopes[3] != 0.0:
            mix(to, 1.0, kappa * c[HEAD + n_s + i], past[m + n * n_s + k * n_l + i])
    if c[18] != 0.0 and slopes[2] != 0.0:
        row = m + n * (n_s + n_l) + 2 * k
        mix(to, 1.0, -1.5 * c[place + 2] * slopes[2], past[row])
        mix(to, 1.0, 0.5 * c[place + 2] * slopes[2], past[row + 1])
    mix(to, 1.0, -carried, moved)


@inlined
def through_line(c: Array, k: int, state: Array, terms: Array, moved: Array, to: Array) -> None:
    """Add derivatives of a line's force by the area that muscle k had: of its coefficients and place.

    ``terms`` are its own, and ``moved`` the derivatives of its last shortening.
    """
    own, before = muscle_at(c, k), shortening(c, k, state)
    first = terms_at(c, k) + DYNAMIC + int(c[7])
    inside = min(max(before, c[own]), c[own + 1])
    a, narrowing = area(c, k, inside)
    if not a > LEAST_AREA * c[first]:
        return
    pull = 2.0 * c[terms_at(c, k) + 1] * terms[1] / a
    if inside == before:
        mix(to, 1.0, pull * narrowing, moved)
    column, power = first - coordinate_at(c, 0), 1.0
    to[column] -= pull * a / c[first]
    for i in range(int(c[8])):
        to[column + i] += pull * power
        power *= inside / c[10]


@inlined
def carry(
    c: Array,
    k: int,
    state: Array,
    way: int,
    p: float,
    x: Array,
    dp: Array,
    late: Array,
    past: Array,
    moved: Array,
    now: Array,
) -> None:
    """Update the derivatives of the past of muscle k to the current state."""
    n, m, n_s, n_l = int(c[0]), int(c[1]), int(c[5]), int(c[6])
    grown = friction_pressure(c, p, x) if way != AT_REST else 0.0
    shape = now.size - n_shape(c) - dp.size
    for i in range(n_s):
        s, upper = state[m + n + k * n_s + i], c[HEAD + i] * grown
        if not -c[12] * upper < s < upper:
            row = m + k * n_s + i
            mix(past[row], 0.0, -1.0, now)
            past[row, shape + walls_at(c)] -= p
            for f in range(dp.size):
                past[row, now.size - dp.size + f] -= c[muscle_at(c, k) + 2] * dp[f]
            if way != AT_REST:
                by_limit(c, i, s, p, x, dp, 1.0, past[row, shape:])
    mix(moved, -1.0, 1.0, now)
    for i in range(n_l if way != AT_REST else 0):
        row = m + n * n_s + k * n_l + i
        gain = c[HEAD + n_s + n_l + i] if way == IN_TIME else c[17]
        mix(past[row], c[HEAD + n_s + i], gain, moved)
        past[row, shape + 2 + int(c[2]) + i] += late[i]
    if c[18] != 0.0 and way == IN_TIME:
        row = m + n * (n_s + n_l) + 2 * k
        fill(past[row + 1], past[row])
        fill(past[row], moved)


@inlined
def approach(
    c: Array,
    state: Array,
    way: int,
    q: Array,
    x: Array,
    p: Array,
    sloped: bool,
    copied: Array,
    inverse: Array,
    work: Array,
) -> None:
    """Solve for equilibrium by Newton's method from where coordinates are, or by `solve_equilibrium`.

    If slopes are wanted, fill the terms of the last muscle and the inverse of the slopes there: a step
    before, they would be as far off as the step is long.
    """
    m = int(c[1])
    residual, step, sizes = work[:m], work[m : 2 * m], work[3 * m : 4 * m]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    for turn in range(FEW_STEPS + 1):
        if turn == FEW_STEPS:
            fill(q, state)
            solve_equilibrium(c, state, way, q, x, p, work)
            break
        left = unbalanced(c, state, way, q, x, p, residual, matrix, sizes, terms)
        eliminate(matrix, residual)
        for j in range(m):
            q[j] -= residual[j]
        if left <= CLOSE:
            break
    if not sloped:
        return
    unbalanced(c, state, way, q, x, p, residual, matrix, sizes, terms)
    for i in range(m):
        for j in range(m):
            step[j] = 1.0 if i == j else 0.0
            fill(copied[j], matrix[j])
        eliminate(copied, step)
        for j in range(m):
            inverse[j, i] = step[j]


@inlined
def move(
    c: Array,
    state: Array,
    way: int,
    held: bool,
    q: Array,
    x: Array,
    p: Array,
    dp: Array,
    past: Array,
    rows: Array,
    found: Array,
    slopes: Array,
    work: Array,
) -> None:
    """Advance one step, free or held, with all derivatives.

    Slopes of no columns are not computed. ``past`` begins with the slopes of coordinates; ``rows`` has
    two rows a muscle to compute in.
    """
    n, m, width, sloped = int(c[0]), int(c[1]), n_terms(c), slopes.shape[1] > 0
    terms = work[4 * m + m * m :]
    values, by_y = terms[:width], terms[width : 2 * width]
    copied, inverse = rows[2 * n : 2 * n + m, :m], rows[2 * n + m : 2 * n + 2 * m, :m]
    shape, late = slopes.shape[1] - n_shape(c) - dp.shape[1], rows[2 * n + 2 * m]
    if held:
        matrix, sizes = work[4 * m : 4 * m + m * m].reshape((m, m)), work[3 * m : 4 * m]
        unbalanced(c, state, way, q, x, p, found, matrix, sizes, terms)
    else:
        approach(c, state, way, q, x, p, sloped, copied, inverse, work)
    for j in range(m if sloped else 0):
        by_coupling(c, j, q, x, shape + walls_at(c) + 1 + n, slopes[j])
    for back in range(n if sloped else 0):
        k = n - 1 - back
        own, y, moved, by_force = muscle_at(c, k) + OWN, shortening(c, k, q), rows[k], rows[n + k]
        if back > 0:  # those of the last muscle are there
            muscle_force(c, k, state, way, y, p[k], x, values, by_y)
        clear(moved)
        clear(by_force)
        for j in range(m):
            if c[own + j] != 0.0:
                mix(moved, 1.0, c[own + j], past[j])
        place = own + m - coordinate_at(c, 0)
        fill(by_force[place : place + width], values)
        by_least_area(c, k, y, p[k], by_y, by_force)
        own_late, to = late[k * int(c[6]) : (k + 1) * int(c[6])], by_force[shape:]
        by_shape(c, k, state, way, y, p[k], x, dp[k], values, by_y, own_late, to)
        if way != AT_REST:
            through_past(c, k, by_y, past, moved, by_force)
        if way == IN_TIME and c[15] > 0.0 and c[terms_at(c, k) + 1] > 0.0:
            through_line(c, k, state, values, moved, by_force)
        for j in range(m):
            if c[own + j] != 0.0:
                mix(slopes[j], 1.0, c[own + j], by_force)
    for j in range(m if not held else 0):
        found[j] = q[j]
    update_state(c, state, way, q, p, x)
    if not sloped:
        return
    if not held:
        for j in range(m):
            clear(past[j])
            for i in range(m):
                mix(past[j], 1.0, -inverse[j, i], slopes[i])
        for j in range(m):
            fill(slopes[j], past[j])
    for k in range(n):
        own, now = muscle_at(c, k) + OWN, rows[n + k]
        clear(now)
        for j in range(m):
            if c[own + j] != 0.0:
                mix(now, 1.0, c[own + j], past[j])
        own_late = late[k * int(c[6]) : (k + 1) * int(c[6])]
        carry(c, k, state, way, p[k], x, dp[k], own_late, past, rows[k], now)


@kernel
def follow(
    c: Array,
    driven: Array,
    measured: Array,
    x: Array,
    dp: Array,
    held: bool,
    every: int,
    past: Array,
    rows: Array,
    scratch: Array,
    found: Array,
    slopes: Array,
) -> None:
    """Simulate all samples; store every n-th.

    Parameters
    ----------
    c : array
        Coefficients of the block.
    driven, measured, x : arrays, shapes (t, n), (t, m), (t, s)
        Pressures, coordinates, what schedules and loads.
    dp : array, shape (1 + t, n, f)
        How pressures that act move with what acts on them: none, then those of every sample.
    held : bool
        Whether muscles are where they were measured.
    every : int
    past, rows, scratch : arrays
        To compute in, all 0.
    found : array, shape (t / every, m)
        Coordinates [mm], or forces that are lacking [N].
    slopes : array, shape (t / every, m, columns)
        Of no columns if not wanted.
    """
    n, m = int(c[0]), int(c[1])
    n_states = scratch.size - 3 * m - 2 * n - 5 * m - m * m - 2 * n_terms(c)
    state, rest = scratch[:n_states], scratch[n_states:]
    q, tare, last = rest[:m], rest[m : 2 * m], rest[2 * m : 3 * m]
    p, work = rest[3 * m : 3 * m + n], rest[3 * m + n :]
    tared = past[past.shape[0] - m :]
    for t in range(-1, driven.shape[0]):
        way = AT_REST if t < 0 else FROM_REST if t == 0 else IN_TIME
        now, place = max(t, 0), max(t, 0) // every
        acts = t >= 0 or (held and c[22] == 0.0)
        fill(p, driven[now] if acts else p)
        for j in range(m):
            ahead = 2.0 * q[j] - last[j] if t > 0 else q[j]
            last[j] = q[j]
            q[j] = measured[now, j] if held else ahead
        by_front = dp[now + 1 if acts else 0]
        to, by = found[place], slopes[place]
        move(c, state, way, held, q, x[now], p, by_front, past, rows, to, by, work)
        if held or c[16] == 0.0:
            continue
        for j in range(m):
            if t < 0:
                tare[j] = q[j]
                fill(tared[j], past[j])
            found[place, j] -= tare[j]
            mix(slopes[place, j], 1.0, -1.0, tared[j])


def run(
    c: Array,
    driven: Array,
    measured: Array,
    x: Array,
    dp: Array | None = None,
    *,
    held: bool,
    every: int = 1,
    sloped: bool = True,
) -> tuple[Array, Array]:
    """Return the results of `follow` at every n-th sample, and the derivatives."""
    n, m, n_s, n_l = (int(c[i]) for i in (0, 1, 5, 6))
    moves = 2 if c[18] else 0
    n_states = n * (1 + n_s + n_l + moves) + 2 * m + 2
    dp = np.zeros((len(driven), n, 0)) if dp is None else dp
    dp = np.concatenate([np.zeros((1, n, dp.shape[2])), dp])
    n_c = (c.size - coordinate_at(c, 0) + n_shape(c) + dp.shape[2]) * sloped
    kept = -(-len(driven) // every)
    found, slopes = np.empty((kept, m)), np.zeros((kept, m, n_c))
    past = np.zeros((2 * m + n * (n_s + n_l + moves), n_c))
    rows = np.zeros((2 * n + 2 * m + 1, max(n_c, m, n * n_l)))
    scratch = np.zeros(n_states + 3 * m + 2 * n + 5 * m + m * m + 2 * n_terms(c))
    p, y, x, dp = (np.ascontiguousarray(one) for one in (driven, measured, x, dp))
    follow(c, p, y, x, dp, held, every, past, rows, scratch, found, slopes)
    return found, slopes
