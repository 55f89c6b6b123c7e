"""Simulation of a force balance with exact derivatives by its parameters.

Either free, for the coordinates q; or held where coordinates were measured, for the forces f that are
then lacking, which are linear in the coefficients, and memory does not depend on these.

With R(q, z, c) the forces on coordinates, z what muscles remember and c the parameters, a free run has
R = 0 at every sample, so that dq/dc = -(dR/dq)^-1 (dR/dc + dR/dz dz/dc); dz/dc is carried from sample to
sample. dR/dc at a given past are the terms of `mckibben.blocks.coupled.balance_law`, where q, x, p,
``way`` and other arguments of kernels are described. Here there are, besides,

slopes, to : array, shape (..., columns)
    Derivatives by parameters. The first columns are the coefficients from those of the first coordinate
    on. The next are the shape: growth of friction, its slopes by scheduling inputs, logarithms of the
    ratio of limits and of lags, stretch of the walls, forces of slackening, places of obstacles. The
    last are parameters of the front before the muscles.
past : array, shape (rows, columns)
    Derivatives of coordinates, stops, lags, past moves and tare; the row of a state is `past_row`.
dp : array, shape (..., front parameters)
    Derivatives of the acting pressures by parameters of the front [bar].
rows : array, shape (2 n + 2 m + 1, columns)
    Scratch: of each of n muscles the derivatives of its last shortening, then of its force; the inverse
    of dR/dq and a copy of dR/dq, m rows each; derivatives of what lags are behind.
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

FEW_STEPS = 6
"""Maximum number of Newton steps without a line search."""

LAST_STEP_RESIDUAL = 1e-7
"""Residual force, relative to the forces that add up to it, from which one more step is the last."""


@kernel
def mix(to: Array, share_kept: float, share: float, row: Array) -> None:
    """Set an array to ``kept * to + share * row``."""
    if share_kept == 1.0 and share == 0.0:
        return
    for i in range(to.size):
        to[i] = share_kept * to[i] + share * row[i]


# -- places of derivatives ---------------------------------------------------------------------------


@kernel
def ratio_column(c: Array) -> int:
    """Return the column of the ratio of limits, in the shape; lags are behind it."""
    return 1 + int(c[at.N_SCHEDULES])


@kernel
def wall_column(c: Array) -> int:
    """Return the column of the walls, in the shape; slackening and places of obstacles are behind it."""
    return ratio_column(c) + 1 + int(c[at.N_LAGS])


@kernel
def n_shape(c: Array) -> int:
    """Return the number of columns of the shape."""
    places = int(c[at.N_COORDINATES]) * int(c[at.N_OBSTACLES])
    return wall_column(c) + 1 + int(c[at.N_MUSCLES]) + places


@kernel
def first_of_shape(c: Array, columns: Array, dp: Array) -> int:
    """Return the first column of the shape."""
    return columns.size - n_shape(c) - dp.shape[1]


@kernel
def past_row(c: Array, position: int) -> int:
    """Return the row of a state's derivatives; only the stretches, before the stops, have none."""
    return position - int(c[at.N_MUSCLES])


# -- derivatives of forces at a given past -----------------------------------------------------------


@inlined
def by_coupling(c: Array, j: int, q: Array, x: Array, positions: int, slopes: Array) -> None:
    """Fill derivatives of the force on coordinate j by its springs, loads and obstacles.

    ``positions`` is the column of the first obstacle's position.
    """
    m, n_schedules, n_loads = int(c[at.N_COORDINATES]), int(c[at.N_SCHEDULES]), int(c[at.N_LOADS])
    degree, n_obstacles = int(c[at.DEGREE]), int(c[at.N_OBSTACLES])
    first = coordinate_at(c, 0)
    column = coordinate_at(c, j) - first
    slopes[:] = 0.0

    power = 1.0
    for order in range(1 + n_schedules * degree):
        if order > 0:
            power = x[(order - 1) // degree] * (power if (order - 1) % degree > 0 else 1.0)
        slopes[column] = power
        for i in range(m):
            slopes[column + 1 + i] = power * q[i]
        column += 1 + m

    for i in range(n_loads):
        slopes[column + i] = x[n_schedules + i]
    column += n_loads

    for number in range(n_obstacles):
        obstacle = first + column
        beyond = q[j] - c[obstacle + at.PLACE]
        if c[obstacle + at.SIDE] * beyond > 0.0:
            slopes[column + at.STIFFNESS] = beyond
            stiffness = c[obstacle + at.STIFFNESS]
            for s in range(n_schedules):
                slopes[column + at.STIFFNESS + 1 + s] = x[s] * beyond
                stiffness += c[obstacle + at.STIFFNESS + 1 + s] * x[s]
            slopes[positions + j * n_obstacles + number] = -stiffness
        column += at.STIFFNESS + 1 + n_schedules


@kernel
def by_limit(
    c: Array, i: int, s: float, p: float, x: Array, dp: Array, share: float, to: Array
) -> None:
    """Add a share of the derivatives of stop i, which slides at s [mm]; ``to`` begins with the shape."""
    limit = c[at.LIMITS + i]
    if s < 0.0:
        limit *= -c[at.RATIO]
        to[ratio_column(c)] += share * s
    if not limit_growth(c, p, x) > 0.0:
        return
    to[0] += share * limit * (p / c[at.TOP] - 1.0)
    for j in range(int(c[at.N_SCHEDULES])):
        to[1 + j] += share * limit * x[j]
    for f in range(dp.size):
        to[to.size - dp.size + f] += share * limit * c[at.GROWTH] / c[at.TOP] * dp[f]


@inlined
def by_lags(
    c: Array, k: int, state: Array, way: int, y: float, taut: bool, late: Array, to: Array
) -> None:
    """Fill derivatives of what lags are behind by their logarithms; add those of the force if taut.

    With decay a = exp(-T / tau), T / tau is -log a. ``to`` begins with the shape.
    """
    n_lags, first_column = int(c[at.N_LAGS]), ratio_column(c) + 1
    stiffness_at, first_state = terms_at(c, k) + int(c[at.LAG]), int(c[at.LAGGING]) + k * n_lags
    change = y - shortening(c, k, state)
    for i in range(n_lags):
        late[i] = 0.0
        if way == IN_TIME:
            decay, gain = c[int(c[at.DECAYS]) + i], c[int(c[at.GAINS]) + i]
            late[i] = -decay * math.log(decay) * state[first_state + i] + (gain - decay) * change
            if taut:
                to[first_column + i] += c[stiffness_at + i] * late[i]


@inlined
def by_shape(
    c: Array,
    k: int,
    way: int,
    y: float,
    p: float,
    x: Array,
    dp: Array,
    terms: Array,
    to: Array,
) -> None:
    """Add derivatives of the force of taut muscle k by friction, wall and front; of a slack one by b.

    ``terms`` are those of the muscle; ``to`` begins with the shape.
    """
    n_terms, first_term, walls = int(c[at.N_TERMS]), int(c[at.STOP]), wall_column(c)
    if terms[n_terms + at.BLADDER] == 0.0:
        to[walls + 1 + k] += 1.0
        return

    effective_area, wall = area(c, k, y)[0], c[muscle_at(c, k) + at.WALL]
    for f in range(dp.size):
        to[to.size - dp.size + f] -= effective_area * dp[f]
    for i in range(int(c[at.N_STOPS]) if way != AT_REST else 0):
        h = c[terms_at(c, k) + first_term + i]
        if terms[n_terms + first_term + i] == 0.0:
            by_limit(c, i, terms[first_term + i], p, x, dp, h, to)
        else:
            to[walls] += h * p
            for f in range(dp.size):
                to[to.size - dp.size + f] += h * wall * dp[f]


@inlined
def by_least_area(c: Array, k: int, y: float, p: float, terms: Array, to: Array) -> None:
    """Replace a taut muscle's derivatives by its area where that is at its least, relative to rest."""
    area_at_rest = terms_at(c, k) + int(c[at.AREA])
    least, column = LEAST_AREA * c[area_at_rest], area_at_rest - coordinate_at(c, 0)
    taut = terms[int(c[at.N_TERMS]) + at.BLADDER] != 0.0
    if least > 0.0 and taut and not area(c, k, y)[0] > least:
        to[column : column + int(c[at.N_AREAS])] = 0.0
        to[column] = -LEAST_AREA * p


# -- derivatives through the past ---------------------------------------------------------------------


@inlined
def through_past(c: Array, k: int, terms: Array, past: Array, moved: Array, to: Array) -> None:
    """Add derivatives of the force of muscle k through its stops, lags and past moves.

    ``terms`` are those of the muscle, ``moved`` the derivatives of its last shortening.
    """
    n_stops, n_lags, coefficients = int(c[at.N_STOPS]), int(c[at.N_LAGS]), terms_at(c, k)
    first_stop, first_lag = int(c[at.STOP]), int(c[at.LAG])
    slopes = terms[int(c[at.N_TERMS]) :]
    by_mass = c[coefficients + at.MASS] * slopes[at.MASS]
    by_damping = (
        c[coefficients + at.DAMPING] * slopes[at.DAMPING]
        + c[coefficients + at.LINE] * slopes[at.LINE]
    )
    by_move = by_mass + by_damping

    for i in range(n_stops):
        if slopes[first_stop + i] != 0.0:
            row = past_row(c, int(c[at.STOPS]) + k * n_stops + i)
            mix(to, 1.0, c[coefficients + first_stop + i], past[row])
    for i in range(n_lags):
        kappa = c[coefficients + first_lag + i]
        by_move += kappa * slopes[first_lag + i]
        if slopes[at.BLADDER] != 0.0:
            row = past_row(c, int(c[at.LAGGING]) + k * n_lags + i)
            mix(to, 1.0, kappa * c[int(c[at.DECAYS]) + i], past[row])
    if c[at.N_MOVES] != 0.0:
        row = past_row(c, int(c[at.MOVED]) + 2 * k)
        mix(to, 1.0, -1.5 * by_mass - by_damping / 3.0, past[row])
        mix(to, 1.0, 0.5 * by_mass, past[row + 1])
    mix(to, 1.0, -by_move, moved)


@inlined
def through_line(c: Array, k: int, state: Array, terms: Array, moved: Array, to: Array) -> None:
    """Add derivatives of the line's force through the area at the last sample: coefficients and place.

    ``terms`` are those of muscle k, ``moved`` the derivatives of its last shortening.
    """
    previous, coefficients = shortening(c, k, state), terms_at(c, k)
    area_at_rest, inside = coefficients + int(c[at.AREA]), within_hull(c, k, previous)
    a, narrowing = area(c, k, inside)
    if not a > LEAST_AREA * c[area_at_rest]:
        return
    force_by_area = 2.0 * c[coefficients + at.LINE] * terms[at.LINE] / a
    if inside == previous:
        mix(to, 1.0, force_by_area * narrowing, moved)

    column, power = area_at_rest - coordinate_at(c, 0), 1.0
    to[column] -= force_by_area * a / c[area_at_rest]
    for i in range(int(c[at.N_AREAS])):
        to[column + i] += force_by_area * power
        power *= inside / c[at.SCALE]


@inlined
def carry_stops(
    c: Array,
    k: int,
    state: Array,
    way: int,
    p: float,
    x: Array,
    dp: Array,
    shape: int,
    past: Array,
    now: Array,
) -> None:
    """Update the derivatives of stops of muscle k that slide; those of its shortening are ``now``.

    Kept are those of s minus stretch, which do not change while a stop sticks. ``shape`` is the first
    column of the shape.
    """
    n_stops, stiffness_at = int(c[at.N_STOPS]), terms_at(c, k) + int(c[at.STOP])
    growth = limit_growth(c, p, x) if way != AT_REST else 0.0
    for i in range(n_stops):
        position = int(c[at.STOPS]) + k * n_stops + i
        s, upper, row = state[position], c[at.LIMITS + i] * growth, past_row(c, position)
        present = c[stiffness_at + i] != 0.0
        if present and not -c[at.RATIO] * upper < s < upper:
            mix(past[row], 0.0, -1.0, now)
            past[row, shape + wall_column(c)] -= p
            for f in range(dp.size):
                past[row, now.size - dp.size + f] -= c[muscle_at(c, k) + at.WALL] * dp[f]
            if way != AT_REST:
                by_limit(c, i, s, p, x, dp, 1.0, past[row, shape:])


@inlined
def carry_moves(
    c: Array, k: int, way: int, shape: int, late: Array, past: Array, moved: Array, now: Array
) -> None:
    """Update the derivatives of the lags and past moves of muscle k.

    Those of its shortening were ``moved`` at the last sample, and are ``now``; ``shape`` is the first
    column of the shape, ``late`` has the derivatives of what lags are behind.
    """
    n_lags, stiffness_at = int(c[at.N_LAGS]), terms_at(c, k) + int(c[at.LAG])
    mix(moved, -1.0, 1.0, now)
    for i in range(n_lags if way != AT_REST else 0):
        row = past_row(c, int(c[at.LAGGING]) + k * n_lags + i)
        if c[stiffness_at + i] != 0.0:
            mix(past[row], c[int(c[at.DECAYS]) + i], lag_gain(c, i, way), moved)
            past[row, shape + ratio_column(c) + 1 + i] += late[i]
    if c[at.N_MOVES] != 0.0 and way == IN_TIME:
        row = past_row(c, int(c[at.MOVED]) + 2 * k)
        fill(past[row + 1], past[row])
        fill(past[row], moved)


@kernel
def along(c: Array, k: int, past: Array, to: Array) -> None:
    """Fill the derivatives of the shortening of muscle k from those of coordinates."""
    to[:] = 0.0
    for j in range(int(c[at.N_COORDINATES])):
        direction = c[muscle_at(c, k) + at.WAYS + j]
        if direction != 0.0:
            mix(to, 1.0, direction, past[j])


# -- one sample --------------------------------------------------------------------------------------


@inlined
def approach(c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array) -> None:
    """Solve for equilibrium by Newton's method from where coordinates are, or by `solve_equilibrium`."""
    m = int(c[at.N_COORDINATES])
    residual, matrix = work[:m], work[4 * m : 4 * m + m * m].reshape((m, m))
    for turn in range(FEW_STEPS + 1):
        if turn == FEW_STEPS:
            fill(q, state)
            solve_equilibrium(c, state, way, q, x, p, work)
            break
        largest = unbalanced(c, state, way, q, x, p, work)
        eliminate(matrix, residual)
        for j in range(m):
            q[j] -= residual[j]
        if largest <= LAST_STEP_RESIDUAL:
            break


@inlined
def invert_stiffness(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, rows: Array, work: Array
) -> None:
    """Fill the inverse of dR/dq at the equilibrium, and the terms of the last muscle.

    A step of Newton's before, they would be as far off as the step is long.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    column, matrix = work[m : 2 * m], work[4 * m : 4 * m + m * m].reshape((m, m))
    inverse, copied = rows[2 * n : 2 * n + m, :m], rows[2 * n + m : 2 * n + 2 * m, :m]
    unbalanced(c, state, way, q, x, p, work)
    for i in range(m):
        for j in range(m):
            column[j] = 1.0 if i == j else 0.0
            fill(copied[j], matrix[j])
        eliminate(copied, column)
        for j in range(m):
            inverse[j, i] = column[j]


@inlined
def by_muscle(
    c: Array,
    k: int,
    state: Array,
    way: int,
    q: Array,
    x: Array,
    p: Array,
    dp: Array,
    past: Array,
    rows: Array,
    terms: Array,
) -> None:
    """Fill the ``rows`` of muscle k: derivatives of its last shortening, of its force and its lags.

    ``terms`` are those of the muscle.
    """
    n, m, n_lags = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES]), int(c[at.N_LAGS])
    n_terms, coefficients = int(c[at.N_TERMS]), terms_at(c, k)
    y, state_moves, by_force = shortening(c, k, q), rows[k], rows[n + k]
    late = rows[2 * n + 2 * m, k * n_lags : (k + 1) * n_lags]
    shape, column = by_force[first_of_shape(c, by_force, dp) :], coefficients - coordinate_at(c, 0)
    along(c, k, past, state_moves)

    by_force[:] = 0.0
    fill(by_force[column : column + n_terms], terms)
    by_least_area(c, k, y, p[k], terms, by_force)
    taut = terms[n_terms + at.BLADDER] != 0.0
    by_lags(c, k, state, way, y, taut, late, shape)
    by_shape(c, k, way, y, p[k], x, dp[k], terms, shape)

    if way != AT_REST:
        through_past(c, k, terms, past, state_moves, by_force)
    if way == IN_TIME and c[at.RATE] > 0.0 and c[coefficients + at.LINE] > 0.0:
        through_line(c, k, state, terms, state_moves, by_force)


@inlined
def slopes_of_forces(
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
    """Fill dR/dc + dR/dz dz/dc, shape (m, columns), and the ``rows`` of muscles and of lags.

    ``terms`` are those of the last muscle when this begins.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    positions = first_of_shape(c, slopes[0], dp) + wall_column(c) + 1 + n
    for j in range(m):
        by_coupling(c, j, q, x, positions, slopes[j])

    for k in range(n - 1, -1, -1):
        if k < n - 1:
            muscle_force(c, k, state, way, shortening(c, k, q), p[k], x, terms)
        by_muscle(c, k, state, way, q, x, p, dp, past, rows, terms)
        for j in range(m):
            direction = c[muscle_at(c, k) + at.WAYS + j]
            if direction != 0.0:
                mix(slopes[j], 1.0, direction, rows[n + k])


@kernel
def slopes_of_coordinates(c: Array, past: Array, rows: Array, slopes: Array) -> None:
    """Replace derivatives of forces by those of coordinates, -(dR/dq)^-1 times them; carry these."""
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    inverse = rows[2 * n : 2 * n + m, :m]
    for j in range(m):
        past[j] = 0.0
        for i in range(m):
            mix(past[j], 1.0, -inverse[j, i], slopes[i])
    for j in range(m):
        fill(slopes[j], past[j])


@inlined
def carry_past(
    c: Array, state: Array, way: int, p: Array, x: Array, dp: Array, past: Array, rows: Array
) -> None:
    """Update dz/dc to the current state, for terms whose coefficients are not 0."""
    n, m, n_lags = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES]), int(c[at.N_LAGS])
    for k in range(n):
        moved, now = rows[k], rows[n + k]
        late = rows[2 * n + 2 * m, k * n_lags : (k + 1) * n_lags]
        shape = first_of_shape(c, now, dp)
        along(c, k, past, now)
        carry_stops(c, k, state, way, p[k], x, dp[k], shape, past, now)
        carry_moves(c, k, way, shape, late, past, moved, now)


@kernel
def extrapolate(q: Array, last: Array, started: bool) -> None:
    """Move coordinates on by their last move, or leave them; keep where they were in ``last``."""
    for j in range(q.size):
        ahead = 2.0 * q[j] - last[j] if started else q[j]
        last[j] = q[j]
        q[j] = ahead


@kernel
def subtract_tare(
    t: int, q: Array, tare: Array, past: Array, results: Array, slopes: Array
) -> None:
    """Subtract the coordinates before the first sample, t = -1, where they are kept; and derivatives."""
    m = q.size
    tare_slopes = past[past.shape[0] - m :]
    for j in range(m):
        if t < 0:
            tare[j] = q[j]
            fill(tare_slopes[j], past[j])
        results[j] -= tare[j]
        mix(slopes[j], 1.0, -1.0, tare_slopes[j])


# -- all samples -------------------------------------------------------------------------------------


@kernel
def simulate_samples(
    c: Array,
    driven: Array,
    measured: Array,
    x: Array,
    dp: Array,
    is_held: bool,
    step_of_rows: int,
    past: Array,
    rows: Array,
    scratch: Array,
    results: Array,
    slopes: Array,
) -> None:
    """Simulate all samples, from one before the first at rest; store every n-th.

    Parameters
    ----------
    c : array
        Coefficients of the block.
    driven, measured, x : arrays, shapes (t, n), (t, m), (t, s)
        Pressures [bar]; coordinates [mm]; scheduling inputs, and loads [N].
    dp : array, shape (1 + t, n, f)
        Of the sample before the first, then of every sample.
    held : bool
        Whether muscles are where they were measured.
    every : int
        Of samples.
    past, rows, scratch : arrays
        To compute in, all 0.
    results : array, shape (t / every, m)
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

    for t in range(-1, driven.shape[0]):
        way = AT_REST if t < 0 else FROM_REST if t == 0 else IN_TIME
        now, row = max(t, 0), max(t, 0) // step_of_rows

        # before the first sample pressures are 0, unless muscles were held from the start
        pressurised = t >= 0 or (is_held and c[at.HELD] == 0.0)
        fill(p, driven[now] if pressurised else p)
        dp_now = dp[now + 1 if pressurised else 0]

        if is_held:
            fill(q, measured[now])
            unbalanced(c, state, way, q, x[now], p, work)
            fill(results[row], work)
        else:
            extrapolate(q, last, t > 0)
            approach(c, state, way, q, x[now], p, work)
            fill(results[row], q)
            if sloped:
                invert_stiffness(c, state, way, q, x[now], p, rows, work)

        if sloped:
            slopes_of_forces(c, state, way, q, x[now], p, dp_now, past, rows, slopes[row], terms)
        update_state(c, state, way, q, p, x[now])
        if sloped and not is_held:
            slopes_of_coordinates(c, past, rows, slopes[row])
        if sloped:
            carry_past(c, state, way, p, x[now], dp_now, past, rows)
        if not is_held and c[at.TARED] != 0.0:
            subtract_tare(t, q, tare, past, results[row], slopes[row])


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
    """Return the results of `simulate_samples` at every n-th sample, and the derivatives.

    ``dp`` has shape (t, n, f): that of the sample before the first is 0.
    """
    n, m, n_lags = (int(c[size]) for size in (at.N_MUSCLES, at.N_COORDINATES, at.N_LAGS))
    n_states = int(c[at.TARE]) + m - at.FRESH
    dp = np.zeros((len(driven), n, 0)) if dp is None else dp
    dp = np.concatenate([np.zeros((1, n, dp.shape[2])), dp])
    n_columns = (c.size - coordinate_at(c, 0) + n_shape(c) + dp.shape[2]) * sloped
    n_stored = -(-len(driven) // every)

    results, slopes = np.empty((n_stored, m)), np.zeros((n_stored, m, n_columns))
    past = np.zeros((n_states + at.FRESH - n, n_columns))
    rows = np.zeros((2 * n + 2 * m + 1, max(n_columns, m, n * n_lags)))
    scratch = np.zeros(n_states + 3 * m + n + int(c[at.WORK]))
    p, q, x, dp = (np.ascontiguousarray(array) for array in (driven, measured, x, dp))
    simulate_samples(c, p, q, x, dp, held, every, past, rows, scratch, results, slopes)
    return results, slopes
