"""Forces of the balance, and the two solvers of the balance: a muscle's law and its inverse.

Of coordinates q that n muscles move, with y_k = W_k q the shortening of muscle k (W is the identity
where every coordinate has a muscle of its own), virtual work asks at every coordinate j

    sum_l C_jl F_l + S_j(x) (1, q) + K_j(x) (q_j - o_j) + sum_k W_kj min(R_k, b_k) = 0,

    R = E(y) + sum_m h_m s_m + sum_l kappa_l v_l + (d + l (A / A_0)^2) y' + m y'' - p A(y),

the obstacle where q is beyond it alone, and R what a muscle resists shortening with, up to b, at which
it goes slack. R is linear in its coefficients, and `resistance` fills the terms that they multiply.
Stops s follow the stretch y + w p of the wall, up to r (p + p_0 + g x) and down to that times a ratio;
v, what a lag is behind, relaxes with its time constant; the line, which resists a flow of A y', has the
area of the last sample; accelerations are Houbolt's differences of four samples: of second order,
stable, and without echo in pressures.

Pressures follow from coordinates muscle by muscle; coordinates from pressures as the minimum of a convex
energy, by Newton's method with a search along every step. Muscles that are more than coordinates take
the pressures nearest to the middle of those that were recorded, in the metric of their covariance C:

    p = p_0 + C A W lambda,

with one lambda a coordinate. So they stay on the line on which a differential drive was recorded.

Coefficients c and the state have the places of `mckibben.blocks.coupled.balance_terms`.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.kernels import DERIVED, fill, kernel, short_kernel
from mckibben.blocks.solving import eliminate

LEAST_AREA = 0.01
"""Smallest area, relative to that at rest: a fully contracted muscle has no pull."""

AT_REST, FROM_REST, IN_TIME = 0, 1, 2
"""How a sample is computed: without friction and lags; as a step before relaxation and damping;
over the sample time.
"""

MOST_STEPS, MOST_SEARCHED = 60, 25
"""Maximum number of Newton steps, and of line-search steps in each."""

BALANCED, NEARLY = 2e-15, 1e-9
"""Relative residual of an equilibrium, and of one to within rounding."""

SURE = 1e-11
"""Residual from which one further Newton step converges without a check."""

HAIR = 1e-9
"""Relative difference of pressures that is rounding."""

SINGLE = {"BALANCED": 1e-6, "NEARLY": 1e-4, "SURE": 1e-5, "HAIR": 1e-6}


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


@kernel
def work_size(c: Array) -> int:
    """Return the length of the working memory of `solve_equilibrium`.

    It has the residual, the step, the start of a search, and the size of forces of every coordinate;
    the slopes of the residual; values and slopes of a muscle's terms.
    """
    m = int(c[at.N_COORDINATES])
    return 4 * m + m * m + 2 * int(c[at.N_TERMS])


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
def friction_pressure(c: Array, p: float, x: Array) -> float:
    """Return p + p_0 + g x, the pressure that friction limits are proportional to."""
    total = p + c[at.OFFSET]
    place = int(c[at.GROWTHS])
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
    wall, grown = c[muscle_at(c, k) + at.WALL], friction_pressure(c, p, x)
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
            by_p += h * limit
        elif s < -c[at.RATIO] * upper:
            s = -c[at.RATIO] * upper
            by_p -= h * c[at.RATIO] * limit
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
    if way == IN_TIME and rate > 0.0:
        terms[at.DAMPING] = rate * moved
        terms[width + at.DAMPING] = rate
        own = terms_at(c, k)
        if c[own + at.LINE] > 0.0:
            flow = area(c, k, within_hull(c, k, before))[0] / c[own + int(c[at.AREA])]
            terms[at.LINE] = flow * flow * rate * moved
            terms[width + at.LINE] = flow * flow * rate
        if c[at.N_MOVES] != 0.0:
            past = int(c[at.MOVED]) + 2 * k
            terms[at.MASS] = rate * rate * (2.0 * moved - 3.0 * state[past] + state[past + 1])
            terms[width + at.MASS] = 2.0 * rate * rate
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
        grown = friction_pressure(c, p[k], x) if way != AT_REST else 0.0
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


# -- coordinates for pressures -------------------------------------------------------------------


@short_kernel
def largest_share(parts: Array, sizes: Array) -> float:
    """Return the largest residual relative to the size of its forces; infinite where those are."""
    worst = 0.0
    for j in range(parts.size):
        if not sizes[j] < np.inf:
            return np.inf
        if sizes[j] > 0.0:
            worst = max(worst, abs(parts[j]) / sizes[j])
    return worst


@kernel
def unbalanced(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> float:
    """Fill the residual force of every coordinate and its slopes; return the largest relative one."""
    m = int(c[at.N_COORDINATES])
    residual, sizes = work[:m], work[3 * m : 4 * m]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    for j in range(m):
        residual[j] = coupling_force(c, j, q, x, matrix[j])
        sizes[j] = abs(residual[j])
        for i in range(m):
            sizes[j] += abs(matrix[j, i] * q[i])
    for k in range(int(c[at.N_MUSCLES])):
        y, ways = shortening(c, k, q), muscle_at(c, k) + at.WAYS
        force, slope, size = muscle_force(c, k, state, way, y, p[k], x, terms)
        if c[at.DIRECTED] == 0.0:
            residual[k] += force
            matrix[k, k] += slope
            sizes[k] += size
        else:
            for j in range(m):
                residual[j] += c[ways + j] * force
                sizes[j] += abs(c[ways + j]) * size
                for i in range(m):
                    matrix[j, i] += c[ways + j] * c[ways + i] * slope
    return largest_share(residual, sizes)


@kernel
def newton_step(c: Array, work: Array) -> float:
    """Fill Newton's step from the residual and its slopes; return how steeply the energy falls along it.

    Where the energy is not convex it is straight down.
    """
    m = int(c[at.N_COORDINATES])
    residual, step = work[:m], work[m : 2 * m]
    for j in range(m):
        step[j] = -residual[j]
    eliminate(work[4 * m : 4 * m + m * m].reshape((m, m)), step)
    down = 0.0
    for j in range(m):
        down += residual[j] * step[j]
    if not down < 0.0:
        down = 0.0
        for j in range(m):
            step[j] = -residual[j]
            down -= residual[j] * residual[j]
    return down


@kernel
def search_along(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, down: float, work: Array
) -> float:
    """Move coordinates along the step to where the energy falls much less; return the residual."""
    m = int(c[at.N_COORDINATES])
    residual, step, start = work[:m], work[m : 2 * m], work[2 * m : 3 * m]
    fill(start, q)
    low, high, share, left = 0.0, -1.0, 1.0, np.inf
    low_rate, high_rate = down, 0.0
    for _ in range(MOST_SEARCHED):
        for j in range(m):
            q[j] = start[j] + share * step[j]
        left = unbalanced(c, state, way, q, x, p, work)
        rate = 0.0
        for j in range(m):
            rate += residual[j] * step[j]
        if left <= BALANCED or abs(rate) <= 0.7 * abs(down) or left == np.inf:
            break
        if rate > 0.0:
            high, high_rate = share, rate
        else:
            low, low_rate = share, rate
        if high < 0.0:
            share *= 2.0
        else:
            # where the rate would vanish were it straight, but well inside
            width = high - low
            share = low + width * min(max(-low_rate / (high_rate - low_rate), 0.1), 0.9)
    return left


@kernel
def solve_equilibrium(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> float:
    """Solve for the coordinates in equilibrium with the pressures; return the residual.

    Where no place is found, they stay where they were. ``work`` has `work_size` numbers.
    """
    m = int(c[at.N_COORDINATES])
    residual, step = work[:m], work[m : 2 * m]
    left = unbalanced(c, state, way, q, x, p, work)
    before = 2.0 * left + 1.0
    for _ in range(MOST_STEPS):
        if left <= BALANCED or (left >= before and left < NEARLY) or left == np.inf:
            break
        before = left
        down = newton_step(c, work)
        if left <= SURE:
            for j in range(m):
                q[j] += step[j]
            break
        left = search_along(c, state, way, q, x, p, down, work)
    if DERIVED:
        unbalanced(c, state, way, q, x, p, work)
        eliminate(work[4 * m : 4 * m + m * m].reshape((m, m)), residual)
        for j in range(m):
            q[j] -= residual[j]
    if not left < NEARLY:
        fill(q, state)
    return left


@kernel
def start_held(c: Array, state: Array, x: Array, q: Array, p: Array) -> None:
    """Start without pressure at given coordinates, whatever that takes."""
    state[:] = 0.0
    p[:] = 0.0
    update_state(c, state, AT_REST, q, p, x)
    state[at.FRESH] = 1.0


@kernel
def start_at_rest(c: Array, state: Array, x: Array, q: Array, p: Array, work: Array) -> None:
    """Start at rest without pressure, and set the tare there."""
    state[:] = 0.0
    q[:] = 0.0
    p[:] = 0.0
    solve_equilibrium(c, state, AT_REST, q, x, p, work)
    update_state(c, state, AT_REST, q, p, x)
    if c[at.TARED] != 0.0:
        fill(state[int(c[at.TARE]) : int(c[at.TARE]) + q.size], q)
    state[at.FRESH] = 1.0


# -- pressures for coordinates -------------------------------------------------------------------


@kernel
def held_force(c: Array, k: int, state: Array, way: int, y: float, terms: Array) -> float:
    """Return what muscle k resists with at no pressure, without friction."""
    place, of_area, lag, held = terms_at(c, k), int(c[at.AREA]), int(c[at.LAG]), 0.0
    dynamic_terms(c, k, state, way, y, terms)
    polynomial_terms(c, k, y, 0.0, terms)
    lag_terms(c, k, state, way, y, terms)
    for i in range(int(c[at.N_TERMS])):
        if i < of_area or i >= lag:
            held += c[place + i] * terms[i]
    return held


@kernel
def pressure_for(
    c: Array, k: int, state: Array, way: int, y: float, wanted: float, x: Array, terms: Array
) -> float:
    """Return the pressure at which muscle k exerts a force.

    It is the one root of a function that falls piecewise straight, since areas are larger than what
    friction grows with pressure.
    """
    held = held_force(c, k, state, way, y, terms)
    held -= wanted
    a = area(c, k, y)[0]
    low, high = -at.NEVER, at.NEVER
    p = held / a
    for _ in range(MOST_STEPS):
        rubbed, by_p = friction(c, k, state, way, y, p, x, terms)
        excess = p * a - held - rubbed
        if abs(excess) <= BALANCED * (abs(p * a) + abs(held) + abs(rubbed)):
            break
        if excess > 0.0:
            high = p
        else:
            low = p
        slope = a - by_p
        p -= excess / slope if slope > 0.0 else excess / a
        if not low < p < high:  # only where friction outgrows the area
            p = 0.5 * (low + high)
    return p


@kernel
def own_pressures(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> bool:
    """Fill the pressures of muscles with a coordinate each; return whether none pushes too hard."""
    m = int(c[at.N_COORDINATES])
    gradient, terms = work[m : 2 * m], work[4 * m + m * m :]
    reached = True
    for k in range(p.size):
        pulled = coupling_force(c, k, q, x, gradient)
        most = c[muscle_at(c, k) + at.PUSH]
        reached = reached and -pulled <= most
        p[k] = pressure_for(c, k, state, way, q[k], min(-pulled, most), x, terms)
    return reached


@kernel
def share_lacks(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> None:
    """Fill the forces of muscles, and by coordinate the least changes of free ones that balance.

    Free muscles have the pressure that they share, at rest; what follows `work_size` are forces and
    whether each is free.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    lacks, gradient, rest = work[:m], work[m : 2 * m], work[work_size(c) :]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    forces, free = rest[:n], rest[n : 2 * n]
    for j in range(m):
        pulled = coupling_force(c, j, q, x, gradient)
        lacks[j] = -pulled
        for i in range(m):
            matrix[j, i] = 0.0
    for k in range(n):
        ways, y, known = muscle_at(c, k) + at.WAYS, shortening(c, k, q), way
        if free[k] != 0.0:
            p[k], known = min(max(c[at.PRELOAD], c[at.LOWEST]), c[at.HIGHEST]), AT_REST
        force = muscle_force(c, k, state, known, y, p[k], x, terms)[0]
        forces[k] = force
        for j in range(m):
            lacks[j] -= c[ways + j] * force
            for i in range(m):
                matrix[j, i] += free[k] * c[ways + j] * c[ways + i]
    eliminate(matrix, lacks)


@kernel
def shared_pressures(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> bool:
    """Fill the pressures of muscles that are more than coordinates; return whether they exist.

    They take the forces that they rest with at the pressure they share, and the least changes of them
    that balance; those that would leave the range of pressures, or go slack, stay at its end, one by
    one, and the others take their part.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    lacks, terms, rest = work[:m], work[4 * m + m * m :], work[work_size(c) :]
    forces, free = rest[:n], rest[n : 2 * n]
    free[:] = 1.0
    for turn in range(n):
        share_lacks(c, state, way, q, x, p, work)
        worst, furthest, end = -1, 0.0, 0.0
        for k in range(n):
            if free[k] == 0.0:
                continue
            own, y, wanted, lowest = muscle_at(c, k), shortening(c, k, q), forces[k], c[at.LOWEST]
            for j in range(m):
                wanted += c[own + at.WAYS + j] * lacks[j]
            p[k] = pressure_for(c, k, state, way, y, wanted, x, terms)
            if wanted > c[own + at.PUSH]:
                slack = pressure_for(c, k, state, way, y, c[own + at.PUSH], x, terms)
                lowest = max(lowest, slack)
            inside = min(max(p[k], lowest), c[at.HIGHEST])
            beyond = abs(p[k] - inside) - HAIR * (1.0 + abs(p[k]))
            if beyond > furthest:
                worst, furthest, end = k, beyond, inside
        if worst < 0 or n - turn == m:
            return worst < 0
        p[worst] = end
        free[worst] = 0.0
    return False


@kernel
def undriven(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, taut: bool, work: Array
) -> float:
    """Fill what every coordinate lacks at pressures, and its slopes; return the largest relative one.

    Slopes are by lambda. What follows `work_size` are the forces of `held_force`, and the slopes of the
    pressures by lambda. No muscle goes slack where they are ``taut``.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    lacks, sizes, rest = work[:m], work[3 * m : 4 * m], work[work_size(c) :]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    held, ways = rest[:n], rest[n : n + n * m].reshape((n, m))
    for j in range(m):
        pulled = coupling_force(c, j, q, x, matrix[j])
        lacks[j], sizes[j] = -pulled, abs(pulled)
        for i in range(m):
            sizes[j] += abs(matrix[j, i] * q[i])
            matrix[j, i] = 0.0
    for k in range(n):
        own, y = muscle_at(c, k), shortening(c, k, q)
        a = area(c, k, y)[0]
        rubbed, by_p = friction(c, k, state, way, y, p[k], x, terms)
        force, slope = held[k] + rubbed - p[k] * a, by_p - a
        size = abs(held[k]) + abs(rubbed) + abs(p[k] * a)
        if force > c[own + at.PUSH] and not taut:
            force, slope = c[own + at.PUSH], 0.0
        for j in range(m):
            pull = c[own + at.WAYS + j]
            lacks[j] -= pull * force
            sizes[j] += abs(pull) * size
            for i in range(m):
                matrix[j, i] -= pull * slope * ways[k, i]
    return largest_share(lacks, sizes)


@kernel
def combine(middle: Array, ways: Array, shares: Array, p: Array) -> None:
    """Fill the pressures that are so far along their ways from the middle."""
    for k in range(p.size):
        p[k] = middle[k]
        for j in range(shares.size):
            p[k] += ways[k, j] * shares[j]


@kernel
def nearest_pressures(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> bool:
    """Fill the pressures that balance nearest to a middle, by a covariance; return whether they do.

    They are found by Newton's method, with a step halved while it does not help; forces are piecewise
    straight in pressure. Middle and covariance are those of `drive_pressures`.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    lacks, step, start = work[:m], work[m : 2 * m], work[2 * m : 3 * m]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    rest = work[work_size(c) :]
    held, ways = rest[:n], rest[n : n + n * m].reshape((n, m))
    shares, more = rest[n + n * m : n + n * m + m], rest[n + n * m + m :]
    middle, spread = more[:n], more[n : n + n * n].reshape((n, n))
    for k in range(n):
        held[k] = held_force(c, k, state, way, shortening(c, k, q), terms)
        for j in range(m):
            ways[k, j] = 0.0
    for i in range(n):
        a = area(c, i, shortening(c, i, q))[0]
        for k in range(n):
            for j in range(m):
                ways[k, j] += spread[k, i] * a * c[muscle_at(c, i) + at.WAYS + j]
    start[:] = 0.0
    step[:] = 0.0
    left, before = np.inf, np.inf
    for turn in range(MOST_STEPS):
        first = turn == 0  # from where all muscles are taut, since slack ones do not answer
        for j in range(m):
            shares[j] = start[j] + step[j]
        combine(middle, ways, shares, p)
        left = undriven(c, state, way, q, x, p, first, work)
        if not first and (left <= BALANCED or (not left < before and before < NEARLY)):
            break
        if left < before:
            before = np.inf if first else left
            eliminate(matrix, lacks)
            for j in range(m):
                start[j] = shares[j]
                step[j] = -lacks[j]
        else:
            for j in range(m):
                step[j] *= 0.5
    if not left <= before:
        combine(middle, ways, start, p)
    return min(left, before) < NEARLY


@kernel
def hold(held: int, end: float, p: Array, drive: Array, shares: Array) -> None:
    """Hold a muscle at a pressure, and take the others along; ``drive`` has middle and covariance."""
    n = p.size
    middle, spread = drive[:n], drive[n : n + n * n].reshape((n, n))
    more, shift, size = end - p[held], end - middle[held], spread[held, held]
    for k in range(n):
        shares[k] = spread[k, held] / size
        p[k] += shares[k] * more
        middle[k] += shares[k] * shift
    for k in range(n):
        for i in range(n):
            spread[k, i] -= shares[k] * shares[i] * size


@kernel
def drive_pressures(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> bool:
    """Fill the pressures, combined as recorded, that hold the muscles; return whether they exist.

    A muscle beyond the range of pressures stays at its end, and takes the others along as they were
    recorded together; while these are driven in more directions than coordinates, they take its part.
    """
    n, m, n_free = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES]), int(c[at.N_DRIVEN])
    drive, rest = int(c[at.DRIVE]), work[work_size(c) + n + n * m + m :]
    recorded = c[drive + n : drive + n + n * n].reshape((n, n))
    middle, spread = rest[:n], rest[n : n + n * n].reshape((n, n))
    for k in range(n):
        middle[k] = c[drive + k]
        for i in range(n):
            spread[k, i] = recorded[k, i]
    reached = False
    for _ in range(n):
        if n_free >= m:
            reached = nearest_pressures(c, state, way, q, x, p, work)
        worst, furthest, end = -1, 0.0, 0.0
        for k in range(n):
            inside = min(max(p[k], c[at.LOWEST]), c[at.HIGHEST])
            beyond = abs(p[k] - inside)
            moves = spread[k, k] > HAIR * recorded[k, k]
            if moves and beyond > HAIR * (1.0 + abs(p[k])):
                beyond *= beyond / spread[k, k]
                if beyond > furthest:
                    worst, furthest, end = k, beyond, inside
        if worst < 0:
            return reached
        hold(worst, end, p, rest, work[work_size(c) :])
        n_free -= 1
        reached = False
    return False


@kernel
def solve_pressures(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> bool:
    """Fill the pressures that hold the muscles at coordinates; return whether they exist.

    ``work`` has two numbers a muscle more than `work_size`, or what a drive needs.
    """
    if c[at.N_DRIVEN] != 0.0:
        return drive_pressures(c, state, way, q, x, p, work)
    if c[at.DIRECTED] == 0.0:
        return own_pressures(c, state, way, q, x, p, work)
    return shared_pressures(c, state, way, q, x, p, work)


@kernel
def clip_pressures(c: Array, p: Array) -> bool:
    """Clip pressures to their range; return whether they were within it."""
    within = True
    for k in range(p.size):
        inside = min(max(p[k], c[at.LOWEST]), c[at.HIGHEST])
        within = within and abs(p[k] - inside) <= HAIR * (1.0 + abs(p[k]))
        p[k] = inside
    return within


@kernel
def give_pressures(c: Array, state: Array, scratch: Array, given: Array, p: Array) -> int:
    """Compute the pressures of a sample; scratch then starts with the muscles' positions.

    The last state counts samples that muscles cannot reach.
    """
    m, n_x = int(c[at.N_COORDINATES]), int(c[at.N_SCHEDULES]) + int(c[at.N_LOADS])
    q, work = scratch[:m], scratch[m:]
    x = given[m : m + n_x]
    way = FROM_REST if state[at.FRESH] != 0.0 else IN_TIME
    for j in range(m):
        q[j] = given[j] + state[int(c[at.TARE]) + j]
    reached = solve_pressures(c, state, way, q, x, p, work)
    within = clip_pressures(c, p)
    if not (reached and within):  # where the muscles go instead is what friction will remember
        solve_equilibrium(c, state, way, q, x, p, work)
        state[at.FAILED] += 1.0
    return way


@kernel
def start_balance(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start muscles at rest without pressure, or at the first displacements with unloaded friction."""
    c = coefficients
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    n_x = int(c[at.N_SCHEDULES]) + int(c[at.N_LOADS])
    x, q, p, work = inputs[m : m + n_x], scratch[:m], scratch[m : m + n], scratch[m + n :]
    if c[at.HELD] != 0.0:
        fill(q, inputs)
        start_held(c, state, x, q, p)
    else:
        start_at_rest(c, state, x, q, p, work)
    if virgin:
        for j in range(m):
            q[j] = inputs[j] + state[int(c[at.TARE]) + j]
        solve_pressures(c, state, AT_REST, q, x, p, work)
        clip_pressures(c, p)
        update_state(c, state, AT_REST, q, p, x)
