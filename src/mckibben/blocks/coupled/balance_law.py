"""Forces of a balance on its coordinates, and what muscles remember.

Of coordinates q that n muscles move, with y_k = W_k q the shortening of muscle k (W is the identity
where every coordinate has a muscle of its own), virtual work asks at every coordinate j

    sum_l C_jl F_l + S_j(x) (1, q) + K_j(x) (q_j - o_j) + sum_k W_kj min(R_k, b_k) = 0,

    R = E(y) + sum_m h_m s_m + sum_l kappa_l v_l + (d + l (A / A_0)^2) y' + m y'' - p A(y),

the obstacle where q is beyond it alone, and R what a muscle resists shortening with, up to b, at which
it goes slack. R is linear in its coefficients, and `resistance` fills the terms that they multiply.
Stops s follow the stretch y + w p of the wall, up to r (1 - lambda + lambda p / P + g x), r being the
travel at which they break away at the highest pressure P, and down to that times a ratio; v, what a
lag is behind, relaxes with its time constant; the line, which resists a flow of A y', has the area of
the last sample; velocities and accelerations are differences of three and four samples (Houbolt's): of
second order, stable, and without echo in pressures.

Arguments of kernels, where they are not described:

c, state
    Coefficients, and what the balance remembers; `mckibben.blocks.coupled.balance_terms`, imported as
    ``at``, has their places.
j, k
    Number of a coordinate, and of a muscle.
way
    How a sample is computed: `AT_REST`, `FROM_REST` or `IN_TIME`.
q, y : array, float
    Coordinates, and the shortening of muscle k [mm].
p : array or float
    Pressures [bar], or that of muscle k.
x : array
    Scheduling inputs, then loads [N].
terms : array
    What the coefficients of muscle k multiply in R, from `balance_terms.DAMPING` on; behind them, as
    many slopes by y.
"""

from __future__ import annotations

from mckibben.arrays import Array
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.kernels import kernel, short_kernel

LEAST_AREA = 0.01
"""Smallest area, relative to that at rest: a fully contracted muscle has no pull."""

AT_REST, FROM_REST, IN_TIME = 0, 1, 2
"""How a sample is computed: without friction and lags; as a step before relaxation and damping;
over the sample time.
"""


@short_kernel
def coordinate_at(c: Array, j: int) -> int:
    """Return the place of the first coefficient of coordinate j."""
    return int(c[at.COORDINATES]) + j * int(c[at.COORDINATE_SIZE])


@short_kernel
def muscle_at(c: Array, k: int) -> int:
    """Return the place of the first coefficient of muscle k."""
    return int(c[at.MUSCLES]) + k * int(c[at.MUSCLE_SIZE])


@short_kernel
def terms_at(c: Array, k: int) -> int:
    """Return the place of the first of the coefficients that multiply the terms of muscle k."""
    return muscle_at(c, k) + at.WAYS + int(c[at.N_COORDINATES])


# -- forces --------------------------------------------------------------------------------------


@short_kernel
def shortening(c: Array, k: int, q: Array) -> float:
    """Return y_k = sum_j W_kj q_j, the shortening of muscle k [mm]."""
    if c[at.DIRECTED] == 0.0:
        return q[k]
    direction = muscle_at(c, k) + at.WAYS
    y = 0.0
    for j in range(int(c[at.N_COORDINATES])):
        y += c[direction + j] * q[j]
    return y


@kernel
def spring_row(c: Array, j: int, x: Array, row: Array) -> float:
    """Fill row j of S(x), springs to all coordinates [N/mm]; return their constant force [N].

    Constant and row are polynomials of every scheduling input, without products of two.
    """
    m, degree = int(c[at.N_COORDINATES]), int(c[at.DEGREE])
    place = coordinate_at(c, j)
    constant = c[place]
    for i in range(m):
        row[i] = c[place + 1 + i]

    for s in range(int(c[at.N_SCHEDULES])):
        power = 1.0
        for _ in range(degree):
            power *= x[s]
            place += 1 + m
            constant += power * c[place]
            for i in range(m):
                row[i] += power * c[place + 1 + i]
    return constant


@kernel
def coupling_force(c: Array, j: int, q: Array, x: Array, gradient: Array) -> float:
    """Return the force of springs, loads and obstacles on coordinate j [N]; fill its gradient [N/mm]."""
    m, n_schedules = int(c[at.N_COORDINATES]), int(c[at.N_SCHEDULES])
    force = spring_row(c, j, x, gradient)
    for i in range(m):
        force += gradient[i] * q[i]

    place = coordinate_at(c, j) + (1 + n_schedules * int(c[at.DEGREE])) * (1 + m)
    n_loads = int(c[at.N_LOADS])
    for i in range(n_loads):
        force += c[place + i] * x[n_schedules + i]

    place += n_loads
    for _ in range(int(c[at.N_OBSTACLES])):
        beyond = q[j] - c[place + at.PLACE]
        if c[place + at.SIDE] * beyond > 0.0:
            stiffness = c[place + at.STIFFNESS]
            for s in range(n_schedules):
                stiffness += c[place + at.STIFFNESS + 1 + s] * x[s]
            force += stiffness * beyond
            gradient[j] += stiffness
        place += at.STIFFNESS + 1 + n_schedules
    return force


@short_kernel
def within_hull(c: Array, k: int, y: float) -> float:
    """Return the shortening nearest to y that muscle k is known to reach [mm]."""
    muscle = muscle_at(c, k)
    return min(max(y, c[muscle + at.SHORTEST]), c[muscle + at.LONGEST])


@short_kernel
def area(c: Array, k: int, y: float) -> tuple[float, float]:
    """Return A(y), the effective area of muscle k [N/bar], and its slope [N/bar/mm].

    A polynomial of y / scale, by Horner's rule; beyond the known range it is straight.
    """
    area_at_rest = terms_at(c, k) + int(c[at.AREA])
    inside = within_hull(c, k, y)
    u = inside / c[at.SCALE]
    value, slope = 0.0, 0.0
    for i in range(int(c[at.N_AREAS]) - 1, -1, -1):
        slope = slope * u + value
        value = value * u + c[area_at_rest + i]
    slope /= c[at.SCALE]
    value += slope * (y - inside)

    least = LEAST_AREA * c[area_at_rest]
    if value > least:
        return value, slope
    return least, 0.0


@short_kernel
def limit_growth(c: Array, p: float, x: Array) -> float:
    """Return 1 - lambda + lambda p / P + g x, limits relative to those at the highest pressure P."""
    growth = 1.0 + c[at.GROWTH] * (p / c[at.TOP] - 1.0)
    slopes = int(c[at.SLOPES])
    for s in range(int(c[at.N_SCHEDULES])):
        growth += c[slopes + s] * x[s]
    return max(growth, 0.0)


@short_kernel
def lag_gain(c: Array, i: int, way: int) -> float:
    """Return the share of a motion in this sample that lag i is behind."""
    return c[int(c[at.GAINS]) + i] if way == IN_TIME else c[at.UNSETTLED]


# -- terms of a muscle's resistance ----------------------------------------------------------------


@short_kernel
def friction(
    c: Array, k: int, state: Array, way: int, y: float, p: float, x: Array, terms: Array
) -> tuple[float, float]:
    """Fill s_m, the stops of muscle k [mm]; return their force [N], and its slope by p [N/bar].

    A stop follows the stretch y + w p, and slides where it reaches its upper or lower limit.
    """
    m, n_stops, n_terms = int(c[at.N_COORDINATES]), int(c[at.N_STOPS]), int(c[at.N_TERMS])
    first_term, first_state = int(c[at.STOP]), int(c[at.STOPS]) + k * n_stops
    stiffness_at = terms_at(c, k) + first_term
    wall, growth = c[muscle_at(c, k) + at.WALL], limit_growth(c, p, x)
    growth_by_p = c[at.GROWTH] / c[at.TOP]
    stretched = y + wall * p - state[m + k]

    force, force_by_p = 0.0, 0.0
    for i in range(n_stops):
        terms[first_term + i] = 0.0
        terms[n_terms + first_term + i] = 0.0
        if way == AT_REST:
            continue
        limit, h = c[at.LIMITS + i], c[stiffness_at + i]
        upper = limit * growth
        s = state[first_state + i] + stretched
        if s > upper:
            s = upper
            force_by_p += h * limit * growth_by_p
        elif s < -c[at.RATIO] * upper:
            s = -c[at.RATIO] * upper
            force_by_p -= h * c[at.RATIO] * limit * growth_by_p
        else:
            terms[n_terms + first_term + i] = 1.0
            force_by_p += h * wall
        terms[first_term + i] = s
        force += h * s
    return force, force_by_p


@short_kernel
def dynamic_terms(c: Array, k: int, state: Array, way: int, y: float, terms: Array) -> None:
    """Fill y' and (A / A_0)^2 y' [mm/s], y'' [mm/s^2] and y [mm]: of damping, line, mass and bladder.

    With D the differences of shortenings and T the sample time, y' = (3 D_t - D_(t-1)) / 2 T and
    y'' = (2 D_t - 3 D_(t-1) + D_(t-2)) / T^2; both are 0 except over the sample time.
    """
    n_terms, rate, previous = int(c[at.N_TERMS]), c[at.RATE], shortening(c, k, state)
    change = y - previous
    for i in range(at.BLADDER):
        terms[i] = 0.0
        terms[n_terms + i] = 0.0

    if way == IN_TIME and rate > 0.0 and c[at.N_MOVES] != 0.0:
        coefficients, changes = terms_at(c, k), int(c[at.MOVED]) + 2 * k
        terms[at.DAMPING] = rate * (1.5 * change - 0.5 * state[changes])
        terms[n_terms + at.DAMPING] = 1.5 * rate
        terms[at.MASS] = rate * rate * (2.0 * change - 3.0 * state[changes] + state[changes + 1])
        terms[n_terms + at.MASS] = 2.0 * rate * rate
        if c[coefficients + at.LINE] > 0.0:
            previous_area = area(c, k, within_hull(c, k, previous))[0]
            ratio = previous_area / c[coefficients + int(c[at.AREA])]
            terms[at.LINE] = ratio * ratio * terms[at.DAMPING]
            terms[n_terms + at.LINE] = ratio * ratio * terms[n_terms + at.DAMPING]

    terms[at.BLADDER] = y
    terms[n_terms + at.BLADDER] = 1.0


@short_kernel
def polynomial_terms(c: Array, k: int, y: float, p: float, terms: Array) -> None:
    """Fill powers of u = y / scale: u^2, u^3, ... of E(y), and -p, -p u, -p u^2, ... of -p A(y).

    Beyond the known range they are straight.
    """
    n_terms, scale, first_area = int(c[at.N_TERMS]), c[at.SCALE], int(c[at.AREA])
    inside = within_hull(c, k, y)
    u, beyond = inside / scale, y - inside

    power = u
    for i in range(at.ELASTIC, first_area):
        slope = (i - at.ELASTIC + 2) * power / scale
        power *= u
        terms[i] = power + slope * beyond
        terms[n_terms + i] = slope

    power = 1.0
    terms[first_area] = -p
    terms[n_terms + first_area] = 0.0
    for i in range(first_area + 1, int(c[at.STOP])):
        slope = -p * (i - first_area) * power / scale
        power *= u
        terms[i] = -p * power + slope * beyond
        terms[n_terms + i] = slope


@short_kernel
def lag_terms(c: Array, k: int, state: Array, way: int, y: float, terms: Array) -> None:
    """Fill v_l, what the lags of muscle k are behind [mm]."""
    n_lags, n_terms, first_term = int(c[at.N_LAGS]), int(c[at.N_TERMS]), int(c[at.LAG])
    first_state, decays = int(c[at.LAGGING]) + k * n_lags, int(c[at.DECAYS])
    change = y - shortening(c, k, state)
    for i in range(n_lags):
        terms[first_term + i] = 0.0
        terms[n_terms + first_term + i] = 0.0
        if way != AT_REST:
            gain = lag_gain(c, i, way)
            terms[first_term + i] = c[decays + i] * state[first_state + i] + gain * change
            terms[n_terms + first_term + i] = gain


@short_kernel
def resistance(
    c: Array, k: int, state: Array, way: int, y: float, p: float, x: Array, terms: Array
) -> tuple[float, float, float]:
    """Fill the terms of muscle k; return R [N], its slope by y [N/mm], and the size of its parts [N].

    R = E(y) + sum_m h_m s_m + sum_l kappa_l v_l + (d + l (A / A_0)^2) y' + m y'' - p A(y). The size is
    the sum of their magnitudes, with which an error of rounding is compared.
    """
    effective_area, narrowing = area(c, k, y)
    friction_force = friction(c, k, state, way, y, p, x, terms)[0]
    dynamic_terms(c, k, state, way, y, terms)
    polynomial_terms(c, k, y, p, terms)
    lag_terms(c, k, state, way, y, terms)

    force = friction_force - p * effective_area
    slope = -p * narrowing
    size = abs(friction_force) + abs(p * effective_area)

    # the forces of area and stops are above, and the slope of the area, which has a least value
    coefficients, n_terms = terms_at(c, k), int(c[at.N_TERMS])
    first_area, first_stop, first_lag = int(c[at.AREA]), int(c[at.STOP]), int(c[at.LAG])
    for i in range(n_terms):
        if i < first_area or i >= first_lag:
            part = c[coefficients + i] * terms[i]
            force += part
            size += abs(part)
        if i < first_area or i >= first_stop:
            slope += c[coefficients + i] * terms[n_terms + i]
    return force, slope, size


@short_kernel
def muscle_force(
    c: Array, k: int, state: Array, way: int, y: float, p: float, x: Array, terms: Array
) -> tuple[float, float, float]:
    """Return min(R, b), its slope and size as of `resistance`; fill the terms, 0 of a slack muscle."""
    force, slope, size = resistance(c, k, state, way, y, p, x, terms)
    slack_force = c[muscle_at(c, k) + at.PUSH]
    if not force > slack_force:
        return force, slope, size
    for i in range(2 * int(c[at.N_TERMS])):
        terms[i] = 0.0
    return slack_force, 0.0, size


# -- memory ----------------------------------------------------------------------------------------


@kernel
def update_state(c: Array, state: Array, way: int, q: Array, p: Array, x: Array) -> None:
    """Update the state to the current position of the muscles."""
    m, n_stops, n_lags = int(c[at.N_COORDINATES]), int(c[at.N_STOPS]), int(c[at.N_LAGS])
    for k in range(int(c[at.N_MUSCLES])):
        y = shortening(c, k, q)
        change = y - shortening(c, k, state)
        stretch = y + c[muscle_at(c, k) + at.WALL] * p[k]

        growth = limit_growth(c, p[k], x) if way != AT_REST else 0.0
        for i in range(n_stops):
            upper = c[at.LIMITS + i] * growth
            place = int(c[at.STOPS]) + k * n_stops + i
            s = state[place] + stretch - state[m + k]
            state[place] = min(max(s, -c[at.RATIO] * upper), upper)
        for i in range(n_lags):
            place = int(c[at.LAGGING]) + k * n_lags + i
            decay, gain = c[int(c[at.DECAYS]) + i], lag_gain(c, i, way)
            state[place] = decay * state[place] + gain * change if way != AT_REST else 0.0
        if c[at.N_MOVES] != 0.0:
            place = int(c[at.MOVED]) + 2 * k
            state[place + 1] = state[place] if way == IN_TIME else 0.0
            state[place] = change if way == IN_TIME else 0.0
        state[m + k] = stretch

    for j in range(m):
        state[j] = q[j]
    state[at.FRESH] = 0.0
