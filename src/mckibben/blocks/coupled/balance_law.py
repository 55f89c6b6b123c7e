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

Coefficients c and the state have the places of `mckibben.blocks.coupled.balance_terms`.
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
    """Return the place of a coordinate's first coefficient."""
    return int(c[at.COORDINATES]) + j * int(c[at.COORDINATE_SIZE])


@short_kernel
def muscle_at(c: Array, k: int) -> int:
    """Return the place of a muscle's first coefficient."""
    return int(c[at.MUSCLES]) + k * int(c[at.MUSCLE_SIZE])


@short_kernel
def terms_at(c: Array, k: int) -> int:
    """Return the place of the first coefficient of a muscle's terms."""
    return muscle_at(c, k) + at.WAYS + int(c[at.N_COORDINATES])


# -- forces --------------------------------------------------------------------------------------


@short_kernel
def shortening(c: Array, k: int, q: Array) -> float:
    """Return y_k, the shortening of muscle k at given coordinates."""
    if c[at.DIRECTED] == 0.0:
        return q[k]
    ways = muscle_at(c, k) + at.WAYS
    total = 0.0
    for j in range(int(c[at.N_COORDINATES])):
        total += c[ways + j] * q[j]
    return total


@kernel
def spring_row(c: Array, j: int, x: Array, row: Array) -> float:
    """Fill the scheduled springs of coordinate j to all others; return its constant force."""
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
    """Return the force of loads, springs and obstacle on coordinate j, and fill its gradient."""
    m, n_x, n_loads = int(c[at.N_COORDINATES]), int(c[at.N_SCHEDULES]), int(c[at.N_LOADS])
    force = spring_row(c, j, x, gradient)
    for i in range(m):
        force += gradient[i] * q[i]
    place = coordinate_at(c, j) + (1 + n_x * int(c[at.DEGREE])) * (1 + m)
    for i in range(n_loads):
        force += c[place + i] * x[n_x + i]
    place += n_loads
    for _ in range(int(c[at.N_OBSTACLES])):
        beyond = q[j] - c[place + at.PLACE]
        if c[place + at.SIDE] * beyond > 0.0:
            stiffness = c[place + at.STIFFNESS]
            for s in range(n_x):
                stiffness += c[place + at.STIFFNESS + 1 + s] * x[s]
            force += stiffness * beyond
            gradient[j] += stiffness
        place += at.STIFFNESS + 1 + n_x
    return force


@short_kernel
def within_hull(c: Array, k: int, y: float) -> float:
    """Return the nearest shortening of muscle k that is known."""
    own = muscle_at(c, k)
    return min(max(y, c[own + at.SHORTEST]), c[own + at.LONGEST])


@short_kernel
def area(c: Array, k: int, y: float) -> tuple[float, float]:
    """Return A(y), a muscle's effective area, and its slope; beyond the known range it is straight."""
    place = terms_at(c, k) + int(c[at.AREA])
    inside = within_hull(c, k, y)
    u = inside / c[at.SCALE]
    value, slope = 0.0, 0.0
    for i in range(int(c[at.N_AREAS]) - 1, -1, -1):
        slope = slope * u + value
        value = value * u + c[place + i]
    slope /= c[at.SCALE]
    value += slope * (y - inside)
    least = LEAST_AREA * c[place]
    if value > least:
        return value, slope
    return least, 0.0


@short_kernel
def limit_growth(c: Array, p: float, x: Array) -> float:
    """Return 1 - lambda + lambda p / P + g x, limits relative to those at the highest pressure P."""
    total = 1.0 + c[at.GROWTH] * (p / c[at.TOP] - 1.0)
    place = int(c[at.SLOPES])
    for s in range(int(c[at.N_SCHEDULES])):
        total += c[place + s] * x[s]
    return max(total, 0.0)


@short_kernel
def lag_gain(c: Array, i: int, way: int) -> float:
    """Return what a lag takes up of a move in this sample."""
    return c[int(c[at.GAINS]) + i] if way == IN_TIME else c[at.UNSETTLED]


@short_kernel
def friction(
    c: Array, k: int, state: Array, way: int, y: float, p: float, x: Array, terms: Array
) -> tuple[float, float]:
    """Fill the stops of muscle k and their slopes by y; return their force and its slope by p."""
    m, n_s, width = int(c[at.N_COORDINATES]), int(c[at.N_STOPS]), int(c[at.N_TERMS])
    first, past = int(c[at.STOP]), int(c[at.STOPS]) + k * n_s
    place = terms_at(c, k) + first
    wall, grown = c[muscle_at(c, k) + at.WALL], limit_growth(c, p, x)
    rise = c[at.GROWTH] / c[at.TOP]
    moved = y + wall * p - state[m + k]
    force, by_p = 0.0, 0.0
    for i in range(n_s):
        terms[first + i] = 0.0
        terms[width + first + i] = 0.0
        if way == AT_REST:
            continue
        limit, h = c[at.LIMITS + i], c[place + i]
        upper = limit * grown
        s = state[past + i] + moved
        if s > upper:
            s = upper
            by_p += h * limit * rise
        elif s < -c[at.RATIO] * upper:
            s = -c[at.RATIO] * upper
            by_p -= h * c[at.RATIO] * limit * rise
        else:
            terms[width + first + i] = 1.0
            by_p += h * wall
        terms[first + i] = s
        force += h * s
    return force, by_p


@short_kernel
def dynamic_terms(c: Array, k: int, state: Array, way: int, y: float, terms: Array) -> None:
    """Fill y', that of the line's flow, y'' and y, which damping, line, mass and bladder multiply."""
    width, rate, before = int(c[at.N_TERMS]), c[at.RATE], shortening(c, k, state)
    moved = y - before
    for i in range(at.BLADDER):
        terms[i] = 0.0
        terms[width + i] = 0.0
    if way == IN_TIME and rate > 0.0 and c[at.N_MOVES] != 0.0:
        own, past = terms_at(c, k), int(c[at.MOVED]) + 2 * k
        terms[at.DAMPING] = rate * (1.5 * moved - 0.5 * state[past])
        terms[width + at.DAMPING] = 1.5 * rate
        terms[at.MASS] = rate * rate * (2.0 * moved - 3.0 * state[past] + state[past + 1])
        terms[width + at.MASS] = 2.0 * rate * rate
        if c[own + at.LINE] > 0.0:
            flow = area(c, k, within_hull(c, k, before))[0] / c[own + int(c[at.AREA])]
            terms[at.LINE] = flow * flow * terms[at.DAMPING]
            terms[width + at.LINE] = flow * flow * terms[width + at.DAMPING]
    terms[at.BLADDER] = y
    terms[width + at.BLADDER] = 1.0


@short_kernel
def polynomial_terms(c: Array, k: int, y: float, p: float, terms: Array) -> None:
    """Fill powers of y / scale, from 2 for elasticity, and from 0 times -p for the area."""
    width, scale, first = int(c[at.N_TERMS]), c[at.SCALE], int(c[at.AREA])
    inside = within_hull(c, k, y)
    u, beyond = inside / scale, y - inside
    power = u
    for i in range(at.ELASTIC, first):
        by = (i - at.ELASTIC + 2) * power / scale
        power *= u
        terms[i] = power + by * beyond
        terms[width + i] = by
    power = 1.0
    terms[first] = -p
    terms[width + first] = 0.0
    for i in range(first + 1, int(c[at.STOP])):
        by = -p * (i - first) * power / scale
        power *= u
        terms[i] = -p * power + by * beyond
        terms[width + i] = by


@short_kernel
def lag_terms(c: Array, k: int, state: Array, way: int, y: float, terms: Array) -> None:
    """Fill v, what the lags of muscle k are behind."""
    n_l, width, first = int(c[at.N_LAGS]), int(c[at.N_TERMS]), int(c[at.LAG])
    past = int(c[at.LAGGING]) + k * n_l
    moved = y - shortening(c, k, state)
    for i in range(n_l):
        terms[first + i] = 0.0
        terms[width + first + i] = 0.0
        if way != AT_REST:
            gain = lag_gain(c, i, way)
            terms[first + i] = c[int(c[at.DECAYS]) + i] * state[past + i] + gain * moved
            terms[width + first + i] = gain


@short_kernel
def resistance(
    c: Array, k: int, state: Array, way: int, y: float, p: float, x: Array, terms: Array
) -> tuple[float, float, float]:
    """Fill the terms of muscle k, then their slopes by y; return R, its slope, and its size."""
    width, place = int(c[at.N_TERMS]), terms_at(c, k)
    a, narrowing = area(c, k, y)
    rubbed = friction(c, k, state, way, y, p, x, terms)[0]
    dynamic_terms(c, k, state, way, y, terms)
    polynomial_terms(c, k, y, p, terms)
    lag_terms(c, k, state, way, y, terms)
    force, slope, size = rubbed - p * a, -p * narrowing, abs(rubbed) + abs(p * a)
    of_area, stop, lag = int(c[at.AREA]), int(c[at.STOP]), int(c[at.LAG])
    for i in range(width):
        if i < of_area or i >= lag:
            part = c[place + i] * terms[i]
            force += part
            size += abs(part)
        if i < of_area or i >= stop:
            slope += c[place + i] * terms[width + i]
    return force, slope, size


@short_kernel
def muscle_force(
    c: Array, k: int, state: Array, way: int, y: float, p: float, x: Array, terms: Array
) -> tuple[float, float, float]:
    """As `resistance`; for a slack muscle, terms are 0 and the force is its largest resistance."""
    force, slope, size = resistance(c, k, state, way, y, p, x, terms)
    most = c[muscle_at(c, k) + at.PUSH]
    if not force > most:
        return force, slope, size
    for i in range(2 * int(c[at.N_TERMS])):
        terms[i] = 0.0
    return most, 0.0, size


@kernel
def update_state(c: Array, state: Array, way: int, q: Array, p: Array, x: Array) -> None:
    """Update the state to the current position of the muscles."""
    m, n_s, n_l = int(c[at.N_COORDINATES]), int(c[at.N_STOPS]), int(c[at.N_LAGS])
    for k in range(int(c[at.N_MUSCLES])):
        y = shortening(c, k, q)
        moved = y - shortening(c, k, state)
        stretch = y + c[muscle_at(c, k) + at.WALL] * p[k]
        grown = limit_growth(c, p[k], x) if way != AT_REST else 0.0
        for i in range(n_s):
            upper = c[at.LIMITS + i] * grown
            place = int(c[at.STOPS]) + k * n_s + i
            s = state[place] + stretch - state[m + k]
            state[place] = min(max(s, -c[at.RATIO] * upper), upper)
        for i in range(n_l):
            place = int(c[at.LAGGING]) + k * n_l + i
            decay, gain = c[int(c[at.DECAYS]) + i], lag_gain(c, i, way)
            state[place] = decay * state[place] + gain * moved if way != AT_REST else 0.0
        if c[at.N_MOVES] != 0.0:
            place = int(c[at.MOVED]) + 2 * k
            state[place + 1] = state[place] if way == IN_TIME else 0.0
            state[place] = moved if way == IN_TIME else 0.0
        state[m + k] = stretch
    for j in range(m):
        state[j] = q[j]
    state[at.FRESH] = 0.0
