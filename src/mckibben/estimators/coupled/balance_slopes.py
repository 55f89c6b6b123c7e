"""Simulation of a force balance with exact derivatives by its parameters.

Either free, where its coordinates are what matters, or held where they were measured, where the forces
that it then lacks are: those are linear, and memory does not depend on coefficients. The direct slopes
are the terms of `mckibben.blocks.coupled.balance_law`; what moves them through the past is carried.

Columns of slopes are the coefficients from those of the first coordinate on, then the shape: the
growth of friction, its slopes by scheduling inputs, the logarithms of the ratio of limits and of lags,
stretch of the walls, forces of slackening, places of obstacles, and what changes the pressures that act,
whose slopes are given.
"""

from __future__ import annotations

import math

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance_law import (
    AT_REST,
    FROM_REST,
    IN_TIME,
    LEAST_AREA,
    area,
    coordinate_at,
    lag_gain,
    limit_growth,
    muscle_at,
    muscle_force,
    shortening,
    terms_at,
    update_state,
    within_hull,
)
from mckibben.blocks.coupled.balance_solving import solve_equilibrium, unbalanced
from mckibben.blocks.kernels import fill, inlined, kernel
from mckibben.blocks.solving import eliminate

FEW_STEPS, CLOSE = 6, 1e-7
"""Number of Newton steps without a search along them; relative residual from which one more is the last.
"""


@kernel
def mix(to: Array, kept: float, share: float, row: Array) -> None:
    """Form a weighted sum in place, over all coefficients."""
    if kept == 1.0 and share == 0.0:
        return
    for i in range(to.size):
        to[i] = kept * to[i] + share * row[i]


# -- columns of the shape, in the order of the table of terms --------------------------------------


@kernel
def ratio_column(c: Array) -> int:
    """Return the column of the ratio of limits; before are friction's growth and slopes, then lags."""
    return 1 + int(c[at.N_SCHEDULES])


@kernel
def wall_column(c: Array) -> int:
    """Return the column of the walls; forces of slackening follow, then places of obstacles."""
    return ratio_column(c) + 1 + int(c[at.N_LAGS])


@kernel
def n_shape(c: Array) -> int:
    """Return the number of columns, before the front's."""
    places = int(c[at.N_COORDINATES]) * int(c[at.N_OBSTACLES])
    return wall_column(c) + 1 + int(c[at.N_MUSCLES]) + places


# -- derivatives of forces at a given past -----------------------------------------------------------


@inlined
def by_coupling(c: Array, j: int, q: Array, x: Array, places: int, slopes: Array) -> None:
    """Fill derivatives of the force on coordinate j by its coefficients and obstacle positions."""
    m, n_x, n_loads = int(c[at.N_COORDINATES]), int(c[at.N_SCHEDULES]), int(c[at.N_LOADS])
    degree, n_met, first = int(c[at.DEGREE]), int(c[at.N_OBSTACLES]), coordinate_at(c, 0)
    place = coordinate_at(c, j) - first
    slopes[:] = 0.0
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
    for number in range(n_met):
        own = first + place
        beyond = q[j] - c[own + at.PLACE]
        if c[own + at.SIDE] * beyond > 0.0:
            slopes[place + at.STIFFNESS] = beyond
            stiffness = c[own + at.STIFFNESS]
            for s in range(n_x):
                slopes[place + at.STIFFNESS + 1 + s] = x[s] * beyond
                stiffness += c[own + at.STIFFNESS + 1 + s] * x[s]
            slopes[places + j * n_met + number] = -stiffness
        place += at.STIFFNESS + 1 + n_x


@kernel
def by_limit(
    c: Array, i: int, s: float, p: float, x: Array, dp: Array, share: float, to: Array
) -> None:
    """Add a share of a sliding stop's derivatives by nonlinear parameters, from column 0 on."""
    upper = c[at.LIMITS + i]
    if s < 0.0:
        upper *= -c[at.RATIO]
        to[ratio_column(c)] += share * s
    if not limit_growth(c, p, x) > 0.0:
        return
    to[0] += share * upper * (p / c[at.TOP] - 1.0)
    for j in range(int(c[at.N_SCHEDULES])):
        to[1 + j] += share * upper * x[j]
    for f in range(dp.size):
        to[to.size - dp.size + f] += share * upper * c[at.GROWTH] / c[at.TOP] * dp[f]


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
    late: Array,
    to: Array,
) -> None:
    """Add a taut muscle's derivatives by nonlinear parameters at fixed past, and fill those of lags.

    ``terms`` and behind them slopes are its own; ``to`` begins with the shape; ``late`` has a number a
    lag.
    """
    n_l, width, first = int(c[at.N_LAGS]), int(c[at.N_TERMS]), int(c[at.STOP])
    walls = wall_column(c)
    place, past = terms_at(c, k), int(c[at.LAGGING]) + k * n_l
    taut = terms[width + at.BLADDER] != 0.0
    moved = y - shortening(c, k, state)
    for i in range(n_l):
        late[i] = 0.0
        if way == IN_TIME:
            decay, gain = c[int(c[at.DECAYS]) + i], c[int(c[at.GAINS]) + i]
            late[i] = -decay * math.log(decay) * state[past + i] + (gain - decay) * moved
            if taut:
                to[ratio_column(c) + 1 + i] += c[place + int(c[at.LAG]) + i] * late[i]
    if not taut:
        to[walls + 1 + k] += 1.0
        return
    a, wall = area(c, k, y)[0], c[muscle_at(c, k) + at.WALL]
    for f in range(dp.size):
        to[to.size - dp.size + f] -= a * dp[f]
    for i in range(int(c[at.N_STOPS]) if way != AT_REST else 0):
        h = c[place + first + i]
        if terms[width + first + i] == 0.0:
            by_limit(c, i, terms[first + i], p, x, dp, h, to)
        else:
            to[walls] += h * p
            for f in range(dp.size):
                to[to.size - dp.size + f] += h * wall * dp[f]


@inlined
def by_least_area(c: Array, k: int, y: float, p: float, terms: Array, to: Array) -> None:
    """Replace a taut muscle's derivatives by its area where that is at its least, relative to rest."""
    first = terms_at(c, k) + int(c[at.AREA])
    least, column = LEAST_AREA * c[first], first - coordinate_at(c, 0)
    taut = terms[int(c[at.N_TERMS]) + at.BLADDER] != 0.0
    if least > 0.0 and taut and not area(c, k, y)[0] > least:
        to[column : column + int(c[at.N_AREAS])] = 0.0
        to[column] = -LEAST_AREA * p


# -- derivatives through the past ---------------------------------------------------------------------


@inlined
def through_past(c: Array, k: int, terms: Array, past: Array, moved: Array, to: Array) -> None:
    """Add derivatives of the force of muscle k through its past, given in ``past``.

    ``terms`` and behind them slopes are its own, and ``moved`` those of its last shortening.
    """
    n, n_s, n_l = int(c[at.N_MUSCLES]), int(c[at.N_STOPS]), int(c[at.N_LAGS])
    place, stop, lag = terms_at(c, k), int(c[at.STOP]), int(c[at.LAG])
    slopes = terms[int(c[at.N_TERMS]) :]
    heavy = c[place + at.MASS] * slopes[at.MASS]
    damped = c[place + at.DAMPING] * slopes[at.DAMPING] + c[place + at.LINE] * slopes[at.LINE]
    carried = heavy + damped
    for i in range(n_s):
        if slopes[stop + i] != 0.0:
            mix(to, 1.0, c[place + stop + i], past[int(c[at.STOPS]) - n + k * n_s + i])
    for i in range(n_l):
        kappa, row = c[place + lag + i], int(c[at.LAGGING]) - n + k * n_l + i
        carried += kappa * slopes[lag + i]
        if slopes[at.BLADDER] != 0.0:
            mix(to, 1.0, kappa * c[int(c[at.DECAYS]) + i], past[row])
    if c[at.N_MOVES] != 0.0:
        row = int(c[at.MOVED]) - n + 2 * k
        mix(to, 1.0, -1.5 * heavy - damped / 3.0, past[row])
        mix(to, 1.0, 0.5 * heavy, past[row + 1])
    mix(to, 1.0, -carried, moved)


@inlined
def through_line(c: Array, k: int, state: Array, terms: Array, moved: Array, to: Array) -> None:
    """Add derivatives of a line's force by the area that muscle k had: of its coefficients and place.

    ``terms`` are its own, and ``moved`` the derivatives of its last shortening.
    """
    before, own = shortening(c, k, state), terms_at(c, k)
    first, inside = own + int(c[at.AREA]), within_hull(c, k, before)
    a, narrowing = area(c, k, inside)
    if not a > LEAST_AREA * c[first]:
        return
    pull = 2.0 * c[own + at.LINE] * terms[at.LINE] / a
    if inside == before:
        mix(to, 1.0, pull * narrowing, moved)
    column, power = first - coordinate_at(c, 0), 1.0
    to[column] -= pull * a / c[first]
    for i in range(int(c[at.N_AREAS])):
        to[column + i] += pull * power
        power *= inside / c[at.SCALE]


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
    """Update the derivatives of the past of muscle k to the current state, of terms that are there."""
    n, n_s, n_l = int(c[at.N_MUSCLES]), int(c[at.N_STOPS]), int(c[at.N_LAGS])
    own = terms_at(c, k)
    grown = limit_growth(c, p, x) if way != AT_REST else 0.0
    shape = now.size - n_shape(c) - dp.size
    for i in range(n_s):
        place = int(c[at.STOPS]) + k * n_s + i
        s, upper, row = state[place], c[at.LIMITS + i] * grown, place - n
        there = c[own + int(c[at.STOP]) + i] != 0.0
        if there and not -c[at.RATIO] * upper < s < upper:
            mix(past[row], 0.0, -1.0, now)
            past[row, shape + wall_column(c)] -= p
            for f in range(dp.size):
                past[row, now.size - dp.size + f] -= c[muscle_at(c, k) + at.WALL] * dp[f]
            if way != AT_REST:
                by_limit(c, i, s, p, x, dp, 1.0, past[row, shape:])
    mix(moved, -1.0, 1.0, now)
    for i in range(n_l if way != AT_REST else 0):
        row = int(c[at.LAGGING]) - n + k * n_l + i
        if c[own + int(c[at.LAG]) + i] != 0.0:
            mix(past[row], c[int(c[at.DECAYS]) + i], lag_gain(c, i, way), moved)
            past[row, shape + ratio_column(c) + 1 + i] += late[i]
    if c[at.N_MOVES] != 0.0 and way == IN_TIME:
        row = int(c[at.MOVED]) - n + 2 * k
        fill(past[row + 1], past[row])
        fill(past[row], moved)


# -- samples -----------------------------------------------------------------------------------------


@inlined
def approach(
    c: Array,
    state: Array,
    way: int,
    q: Array,
    x: Array,
    p: Array,
    sloped: bool,
    rows: Array,
    work: Array,
) -> None:
    """Solve for equilibrium by Newton's method from where coordinates are, or by `solve_equilibrium`.

    If slopes are wanted, fill the terms of the last muscle and the inverse of the slopes there: a step
    before, they would be as far off as the step is long.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    residual, step = work[:m], work[m : 2 * m]
    matrix = work[4 * m : 4 * m + m * m].reshape((m, m))
    inverse, copied = rows[2 * n : 2 * n + m, :m], rows[2 * n + m : 2 * n + 2 * m, :m]
    for turn in range(FEW_STEPS + 1):
        if turn == FEW_STEPS:
            fill(q, state)
            solve_equilibrium(c, state, way, q, x, p, work)
            break
        left = unbalanced(c, state, way, q, x, p, work)
        eliminate(matrix, residual)
        for j in range(m):
            q[j] -= residual[j]
        if left <= CLOSE:
            break
    if not sloped:
        return
    unbalanced(c, state, way, q, x, p, work)
    for i in range(m):
        for j in range(m):
            step[j] = 1.0 if i == j else 0.0
            fill(copied[j], matrix[j])
        eliminate(copied, step)
        for j in range(m):
            inverse[j, i] = step[j]


@inlined
def slopes_at_past(
    c: Array,
    state: Array,
    way: int,
    q: Array,
    x: Array,
    p: Array,
    dp: Array,
    past: Array,
    rows: Array,
    slopes: Array,
    terms: Array,
) -> None:
    """Fill the derivatives of the forces on coordinates, those of stops and lags with them.

    ``rows`` is to compute in: slopes of every muscle's last shortening, then of its force, the inverse
    and a copy of the slopes of forces, and slopes of what lags are behind. ``terms`` are those of the
    last muscle.
    """
    n, m, n_l = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES]), int(c[at.N_LAGS])
    width, first = int(c[at.N_TERMS]), coordinate_at(c, 0)
    shape, late = slopes.shape[1] - n_shape(c) - dp.shape[1], rows[2 * n + 2 * m]
    for j in range(m):
        by_coupling(c, j, q, x, shape + wall_column(c) + 1 + n, slopes[j])
    for back in range(n):
        k = n - 1 - back
        y, moved, by_force = shortening(c, k, q), rows[k], rows[n + k]
        if back > 0:
            muscle_force(c, k, state, way, y, p[k], x, terms)
        along(c, k, past, moved)
        by_force[:] = 0.0
        own = terms_at(c, k)
        fill(by_force[own - first : own - first + width], terms)
        by_least_area(c, k, y, p[k], terms, by_force)
        own_late, to = late[k * n_l : (k + 1) * n_l], by_force[shape:]
        by_shape(c, k, state, way, y, p[k], x, dp[k], terms, own_late, to)
        if way != AT_REST:
            through_past(c, k, terms, past, moved, by_force)
        if way == IN_TIME and c[at.RATE] > 0.0 and c[own + at.LINE] > 0.0:
            through_line(c, k, state, terms, moved, by_force)
        for j in range(m):
            pull = c[muscle_at(c, k) + at.WAYS + j]
            if pull != 0.0:
                mix(slopes[j], 1.0, pull, by_force)


@inlined
def follow_past(
    c: Array, state: Array, way: int, p: Array, x: Array, dp: Array, past: Array, rows: Array
) -> None:
    """Update the derivatives of the past of all muscles; ``past`` begins with those of coordinates."""
    n, m, n_l = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES]), int(c[at.N_LAGS])
    late = rows[2 * n + 2 * m]
    for k in range(n):
        now, own_late = rows[n + k], late[k * n_l : (k + 1) * n_l]
        along(c, k, past, now)
        carry(c, k, state, way, p[k], x, dp[k], own_late, past, rows[k], now)


@kernel
def along(c: Array, k: int, past: Array, to: Array) -> None:
    """Fill the derivatives of the shortening of muscle k from those of coordinates."""
    to[:] = 0.0
    for j in range(int(c[at.N_COORDINATES])):
        way = c[muscle_at(c, k) + at.WAYS + j]
        if way != 0.0:
            mix(to, 1.0, way, past[j])


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
    n, m, sloped = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES]), slopes.shape[2] > 0
    n_states = int(c[at.TARE]) + m - at.FRESH
    state, rest = scratch[:n_states], scratch[n_states:]
    q, tare, last = rest[:m], rest[m : 2 * m], rest[2 * m : 3 * m]
    p, work = rest[3 * m : 3 * m + n], rest[3 * m + n :]
    terms = work[4 * m + m * m :]
    inverse, tared = rows[2 * n : 2 * n + m, :m], past[past.shape[0] - m :]
    for t in range(-1, driven.shape[0]):
        way = AT_REST if t < 0 else FROM_REST if t == 0 else IN_TIME
        now, place = max(t, 0), max(t, 0) // every
        acts = t >= 0 or (held and c[at.HELD] == 0.0)
        fill(p, driven[now] if acts else p)
        by_front = dp[now + 1 if acts else 0]
        for j in range(m):
            ahead = 2.0 * q[j] - last[j] if t > 0 else q[j]
            last[j] = q[j]
            q[j] = measured[now, j] if held else ahead
        if held:
            unbalanced(c, state, way, q, x[now], p, work)
            fill(found[place], work)
        else:
            approach(c, state, way, q, x[now], p, sloped, rows, work)
        if sloped:
            slopes_at_past(c, state, way, q, x[now], p, by_front, past, rows, slopes[place], terms)
        for j in range(m if not held else 0):
            found[place, j] = q[j]
        update_state(c, state, way, q, p, x[now])
        for j in range(m if sloped and not held else 0):
            past[j] = 0.0
            for i in range(m):
                mix(past[j], 1.0, -inverse[j, i], slopes[place, i])
        for j in range(m if sloped and not held else 0):
            fill(slopes[place, j], past[j])
        if sloped:
            follow_past(c, state, way, p, x[now], by_front, past, rows)
        if held or c[at.TARED] == 0.0:
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
    n, m, n_l = (int(c[size]) for size in (at.N_MUSCLES, at.N_COORDINATES, at.N_LAGS))
    n_states = int(c[at.TARE]) + m - at.FRESH
    dp = np.zeros((len(driven), n, 0)) if dp is None else dp
    dp = np.concatenate([np.zeros((1, n, dp.shape[2])), dp])
    n_c = (c.size - coordinate_at(c, 0) + n_shape(c) + dp.shape[2]) * sloped
    kept = -(-len(driven) // every)
    found, slopes = np.empty((kept, m)), np.zeros((kept, m, n_c))
    past = np.zeros((n_states + at.FRESH - n, n_c))
    rows = np.zeros((2 * n + 2 * m + 1, max(n_c, m, n * n_l)))
    scratch = np.zeros(n_states + 3 * m + n + int(c[at.WORK]))
    p, y, x, dp = (np.ascontiguousarray(one) for one in (driven, measured, x, dp))
    follow(c, p, y, x, dp, held, every, past, rows, scratch, found, slopes)
    return found, slopes
