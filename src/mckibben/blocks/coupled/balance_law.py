"""Forces of the balance: the terms of every muscle, and the two solvers of the balance.

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

Coefficients: the head, r (m), decays and gains of the lags (l each), g (schedules); with a drive, p_0
and C; of every coordinate its springs (powers of what schedules by 1 + coordinates), loads, and of every
obstacle its side (1 or -1), place and stiffness; of every muscle lowest and highest shortening known, w,
b, W, then the coefficients of its terms: d, l, m, own spring, elasticity, area, friction, relaxation.
State: coordinates, stretches, stops (muscle by muscle), lags (the same), with mass the last two moves of
each muscle, the tare of coordinates, whether this is the first sample, number of failed samples.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.kernels import DERIVED, fill, kernel, short_kernel
from mckibben.blocks.solving import eliminate

HEAD = 23
"""Muscles, coordinates, schedules, degree, loads, stops, lags, elastic terms, area's terms, obstacles of
a coordinate, scale, p_0, ratio of lower to upper limits, lowest and highest pressure, samples a second,
whether there is a tare, what is left at the start to relax (1, or 0 if settled), whether there is mass,
pressure shared by muscles that are more than coordinates, whether they are, in how many directions their
pressures were driven, 0 for any, and whether they start held."""

OWN, DYNAMIC = 4, 4
"""Coefficients of a muscle before its directions; terms before elasticity."""

LEAST_AREA = 0.01
"""Smallest area, relative to that at rest: a fully contracted muscle has no pull."""

AT_REST, FROM_REST, IN_TIME = 0, 1, 2
"""How a sample is computed: without friction and lags; as a step before relaxation and damping;
over the sample time.
"""

NEVER = 1e30
"""Slack force of muscles that never go slack."""

MOST_STEPS, MOST_SEARCHED = 60, 25
"""Maximum number of Newton steps, and of line-search steps in each."""

BALANCED, NEARLY = 2e-15, 1e-9
"""Relative residual of an equilibrium, and of one to within rounding."""

SURE = 1e-11
"""Residual from which one further Newton step converges without a check."""

HAIR = 1e-9
"""Relative difference of pressures that is rounding."""

SINGLE = {"BALANCED": 1e-6, "NEARLY": 1e-4, "SURE": 1e-5, "HAIR": 1e-6}


# -- where coefficients are ----------------------------------------------------------------------


@kernel
def drive_at(c: Array) -> int:
    """Return the index of the middle of the recorded pressures, behind which is their covariance."""
    return HEAD + int(c[5]) + 2 * int(c[6]) + int(c[2])


@kernel
def coordinate_at(c: Array, j: int) -> int:
    """Return the index of the first coefficient of a coordinate."""
    springs = (1 + int(c[2]) * int(c[3])) * (1 + int(c[1]))
    width = springs + int(c[4]) + int(c[9]) * (3 + int(c[2]))
    place = drive_at(c)
    if c[21] != 0.0:
        place += int(c[0]) * (1 + int(c[0]))
    return place + j * width


@kernel
def n_terms(c: Array) -> int:
    """Return the number of force terms of a muscle."""
    return DYNAMIC + int(c[7]) + int(c[8]) + int(c[5]) + int(c[6])


@kernel
def muscle_at(c: Array, k: int) -> int:
    """Return the index of the first coefficient of a muscle."""
    return coordinate_at(c, int(c[1])) + k * (OWN + int(c[1]) + n_terms(c))


@kernel
def terms_at(c: Array, k: int) -> int:
    """Return the index of the first coefficient of a muscle's terms."""
    return muscle_at(c, k) + OWN + int(c[1])


@kernel
def work_size(c: Array) -> int:
    """Return the length of the working memory of `solve_equilibrium`."""
    m = int(c[1])
    return 4 * m + m * m + 2 * n_terms(c)


# -- forces --------------------------------------------------------------------------------------


@short_kernel
def shortening(c: Array, k: int, q: Array) -> float:
    """Return the shortening of muscle k at given coordinates."""
    if c[20] == 0.0:
        return q[k]
    own = muscle_at(c, k) + OWN
    total = 0.0
    for j in range(int(c[1])):
        total += c[own + j] * q[j]
    return total


@kernel
def spring_row(c: Array, j: int, x: Array, row: Array) -> float:
    """Fill the scheduled springs of coordinate j to all others; return its constant force."""
    m, degree = int(c[1]), int(c[3])
    place = coordinate_at(c, j)
    constant = c[place]
    for i in range(m):
        row[i] = c[place + 1 + i]
    for s in range(int(c[2])):
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
    m, n_x, n_loads = int(c[1]), int(c[2]), int(c[4])
    force = spring_row(c, j, x, gradient)
    for i in range(m):
        force += gradient[i] * q[i]
    place = coordinate_at(c, j) + (1 + n_x * int(c[3])) * (1 + m)
    for i in range(n_loads):
        force += c[place + i] * x[n_x + i]
    place += n_loads
    for _ in range(int(c[9])):
        beyond = q[j] - c[place + 1]
        if c[place] * beyond > 0.0:
            stiffness = c[place + 2]
            for s in range(n_x):
                stiffness += c[place + 3 + s] * x[s]
            force += stiffness * beyond
            gradient[j] += stiffness
        place += 3 + n_x
    return force


@short_kernel
def area(c: Array, k: int, y: float) -> tuple[float, float]:
    """Return a muscle's effective area and its slope, extrapolated linearly beyond the known range."""
    own, place = muscle_at(c, k), terms_at(c, k) + DYNAMIC + int(c[7])
    inside = min(max(y, c[own]), c[own + 1])
    u = inside / c[10]
    value, slope = 0.0, 0.0
    for i in range(int(c[8]) - 1, -1, -1):
        slope = slope * u + value
        value = value * u + c[place + i]
    slope /= c[10]
    value += slope * (y - inside)
    least = LEAST_AREA * c[place]
    if value > least:
        return value, slope
    return least, 0.0


@short_kernel
def friction_pressure(c: Array, p: float, x: Array) -> float:
    """Return the pressure that friction limits are proportional to."""
    total = p + c[11]
    place = HEAD + int(c[5]) + 2 * int(c[6])
    for s in range(int(c[2])):
        total += c[place + s] * x[s]
    return max(total, 0.0)


@short_kernel
def friction(
    c: Array,
    k: int,
    state: Array,
    way: int,
    y: float,
    p: float,
    x: Array,
    terms: Array,
    by_y: Array,
) -> tuple[float, float]:
    """Fill the stops of muscle k and their slopes by y; return their force and its slope by p."""
    n, m, n_s = int(c[0]), int(c[1]), int(c[5])
    first = n_terms(c) - int(c[6]) - n_s
    place = terms_at(c, k) + first
    wall, grown = c[muscle_at(c, k) + 2], friction_pressure(c, p, x)
    moved = y + wall * p - state[m + k]
    force, by_p = 0.0, 0.0
    for i in range(n_s):
        terms[first + i] = 0.0
        by_y[first + i] = 0.0
        if way == AT_REST:
            continue
        upper = c[HEAD + i] * grown
        s = state[m + n + k * n_s + i] + moved
        h = c[place + i]
        if s > upper:
            s = upper
            by_p += h * c[HEAD + i]
        elif s < -c[12] * upper:
            s = -c[12] * upper
            by_p -= h * c[12] * c[HEAD + i]
        else:
            by_y[first + i] = 1.0
            by_p += h * wall
        terms[first + i] = s
        force += h * s
    return force, by_p


@short_kernel
def resistance(
    c: Array,
    k: int,
    state: Array,
    way: int,
    y: float,
    p: float,
    x: Array,
    terms: Array,
    by_y: Array,
) -> tuple[float, float, float]:
    """Fill the terms of muscle k and their slopes by y; return their force, its slope, and its size."""
    n, m, n_s, n_l, n_e, n_a = int(c[0]), int(c[1]), int(c[5]), int(c[6]), int(c[7]), int(c[8])
    own, width, rate, scale, first = muscle_at(c, k), n_terms(c), c[15], c[10], DYNAMIC + n_e
    place = own + OWN + m
    before = shortening(c, k, state)
    moved = y - before
    a, narrowing = area(c, k, y)
    rubbed = friction(c, k, state, way, y, p, x, terms, by_y)[0]
    force, slope, size = rubbed - p * a, -p * narrowing, abs(rubbed) + abs(p * a)
    for i in range(DYNAMIC - 1):
        terms[i] = 0.0
        by_y[i] = 0.0
    if way == IN_TIME and rate > 0.0:
        terms[0] = rate * moved
        by_y[0] = rate
        if c[place + 1] > 0.0:
            flow = area(c, k, min(max(before, c[own]), c[own + 1]))[0] / c[place + first]
            terms[1] = flow * flow * rate * moved
            by_y[1] = flow * flow * rate
        if c[18] != 0.0:
            past = m + n + n * (n_s + n_l) + 2 * k
            terms[2] = rate * rate * (2.0 * moved - 3.0 * state[past] + state[past + 1])
            by_y[2] = 2.0 * rate * rate
    terms[3] = y
    by_y[3] = 1.0
    inside = min(max(y, c[own]), c[own + 1])
    u, beyond = inside / scale, y - inside
    power = u
    for i in range(first):
        term, by = terms[i], by_y[i]
        if i >= DYNAMIC:
            by = (i - DYNAMIC + 2) * power / scale
            power *= u
            term = power + by * beyond
        terms[i], by_y[i], part = term, by, c[place + i] * term
        force += part
        size += abs(part)
        slope += c[place + i] * by
    power = 1.0
    terms[first] = -p
    by_y[first] = 0.0
    for i in range(first + 1, first + n_a):
        by_y[i] = -p * (i - first) * power / scale
        power *= u
        terms[i] = -p * power + by_y[i] * beyond
    for i in range(first + n_a, width - n_l):
        slope += c[place + i] * by_y[i]
    for i in range(n_l):
        at, term, gain = width - n_l + i, 0.0, 0.0
        if way != AT_REST:
            gain = c[HEAD + n_s + n_l + i] if way == IN_TIME else c[17]
            term = c[HEAD + n_s + i] * state[m + n + n * n_s + k * n_l + i] + gain * moved
        terms[at], by_y[at], part = term, gain, c[place + at] * term
        force += part
        size += abs(part)
        slope += c[place + at] * gain
    return force, slope, size


@short_kernel
def muscle_force(
    c: Array,
    k: int,
    state: Array,
    way: int,
    y: float,
    p: float,
    x: Array,
    terms: Array,
    by_y: Array,
) -> tuple[float, float, float]:
    """As `resistance`; for a slack muscle, terms are 0 and the force is its largest resistance."""
    force, slope, size = resistance(c, k, state, way, y, p, x, terms, by_y)
    most = c[muscle_at(c, k) + 3]
    if not force > most:
        return force, slope, size
    for i in range(n_terms(c)):
        terms[i] = 0.0
        by_y[i] = 0.0
    return most, 0.0, size


@kernel
def update_state(c: Array, state: Array, way: int, q: Array, p: Array, x: Array) -> None:
    """Update the state to the current position of the muscles."""
    n, m, n_s, n_l = int(c[0]), int(c[1]), int(c[5]), int(c[6])
    for k in range(n):
        y = shortening(c, k, q)
        moved = y - shortening(c, k, state)
        stretch = y + c[muscle_at(c, k) + 2] * p[k]
        grown = friction_pressure(c, p[k], x) if way != AT_REST else 0.0
        for i in range(n_s):
            upper = c[HEAD + i] * grown
            place = m + n + k * n_s + i
            state[place] = min(max(state[place] + stretch - state[m + k], -c[12] * upper), upper)
        for i in range(n_l):
            place = m + n + n * n_s + k * n_l + i
            gain = c[HEAD + n_s + n_l + i] if way == IN_TIME else c[17]
            state[place] = c[HEAD + n_s + i] * state[place] + gain * moved
            if way == AT_REST:
                state[place] = 0.0
        if c[18] != 0.0:
            place = m + n + n * (n_s + n_l) + 2 * k
            state[place + 1] = state[place] if way == IN_TIME else 0.0
            state[place] = moved if way == IN_TIME else 0.0
        state[m + k] = stretch
    for j in range(m):
        state[j] = q[j]
    state[state.size - 2] = 0.0


# -- coordinates for pressures -------------------------------------------------------------------


@kernel
def unbalanced(
    c: Array,
    state: Array,
    way: int,
    q: Array,
    x: Array,
    p: Array,
    residual: Array,
    matrix: Array,
    sizes: Array,
    terms: Array,
) -> float:
    """Fill the residual force of every coordinate and its slopes; return the largest relative one.

    That is infinite where forces are. ``terms`` has two numbers a term to compute in.
    """
    m, width = int(c[1]), n_terms(c)
    for j in range(m):
        residual[j] = coupling_force(c, j, q, x, matrix[j])
        sizes[j] = abs(residual[j])
        for i in range(m):
            sizes[j] += abs(matrix[j, i] * q[i])
    for k in range(int(c[0])):
        y, own = shortening(c, k, q), muscle_at(c, k) + OWN
        force, slope, size = muscle_force(
            c, k, state, way, y, p[k], x, terms[:width], terms[width:]
        )
        if c[20] == 0.0:
            residual[k] += force
            matrix[k, k] += slope
            sizes[k] += size
        else:
            for j in range(m):
                residual[j] += c[own + j] * force
                sizes[j] += abs(c[own + j]) * size
                for i in range(m):
                    matrix[j, i] += c[own + j] * c[own + i] * slope
    worst = 0.0
    for j in range(m):
        if not sizes[j] < np.inf:
            return np.inf
        if sizes[j] > 0.0:
            worst = max(worst, abs(residual[j]) / sizes[j])
    return worst


@kernel
def solve_equilibrium(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> float:
    """Solve for the coordinates in equilibrium with the pressures; return the residual.

    Where no place is found, they stay where they were. ``work`` has `work_size` numbers; those after
    the first four vectors begin with the slopes of the residual.
    """
    m = int(c[1])
    residual, step = work[:m], work[m : 2 * m]
    start, sizes = work[2 * m : 3 * m], work[3 * m : 4 * m]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    left = unbalanced(c, state, way, q, x, p, residual, matrix, sizes, terms)
    before = 2.0 * left + 1.0
    for _ in range(MOST_STEPS):
        if left <= BALANCED or (left >= before and left < NEARLY) or left == np.inf:
            break
        before = left
        for j in range(m):
            step[j] = -residual[j]
            start[j] = q[j]
        eliminate(matrix, step)
        down = 0.0
        for j in range(m):
            down += residual[j] * step[j]
        if not down < 0.0:  # where the energy is not convex: straight down
            down = 0.0
            for j in range(m):
                step[j] = -residual[j]
                down -= residual[j] * residual[j]
        if left <= SURE:
            for j in range(m):
                q[j] += step[j]
            break
        low, high, share = 0.0, -1.0, 1.0
        low_rate, high_rate = down, 0.0
        for _ in range(MOST_SEARCHED):
            for j in range(m):
                q[j] = start[j] + share * step[j]
            left = unbalanced(c, state, way, q, x, p, residual, matrix, sizes, terms)
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
    if DERIVED:
        unbalanced(c, state, way, q, x, p, residual, matrix, sizes, terms)
        eliminate(matrix, residual)
        for j in range(m):
            q[j] -= residual[j]
    if not left < NEARLY:
        for j in range(m):
            q[j] = state[j]
    return left


@kernel
def start_held(c: Array, state: Array, x: Array, q: Array, p: Array) -> None:
    """Start without pressure at given coordinates, whatever that takes."""
    for i in range(state.size):
        state[i] = 0.0
    for k in range(p.size):
        p[k] = 0.0
    update_state(c, state, AT_REST, q, p, x)
    state[state.size - 2] = 1.0


@kernel
def start_at_rest(c: Array, state: Array, x: Array, q: Array, p: Array, work: Array) -> None:
    """Start at rest without pressure, and set the tare there."""
    for i in range(state.size):
        state[i] = 0.0
    for j in range(q.size):
        q[j] = 0.0
    for k in range(p.size):
        p[k] = 0.0
    solve_equilibrium(c, state, AT_REST, q, x, p, work)
    update_state(c, state, AT_REST, q, p, x)
    if c[16] != 0.0:
        for j in range(q.size):
            state[state.size - 2 - q.size + j] = q[j]
    state[state.size - 2] = 1.0


# -- pressures for coordinates -------------------------------------------------------------------


@kernel
def held_force(c: Array, k: int, state: Array, way: int, y: float, x: Array, terms: Array) -> float:
    """Return what muscle k resists with at no pressure, without friction."""
    width, place = n_terms(c), terms_at(c, k)
    first, held = DYNAMIC + int(c[7]), 0.0
    resistance(c, k, state, way, y, 0.0, x, terms[:width], terms[width : 2 * width])
    for i in range(width):
        if i < first or i >= width - int(c[6]):
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
    width = n_terms(c)
    slopes = terms[width : 2 * width]
    held = held_force(c, k, state, way, y, x, terms)
    held -= wanted
    a = area(c, k, y)[0]
    low, high = -NEVER, NEVER
    p = held / a
    for _ in range(MOST_STEPS):
        rubbed, by_p = friction(c, k, state, way, y, p, x, terms[:width], slopes)
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
def undriven(
    c: Array,
    state: Array,
    way: int,
    q: Array,
    x: Array,
    p: Array,
    held: Array,
    ways: Array,
    taut: bool,
    lacks: Array,
    sizes: Array,
    matrix: Array,
    terms: Array,
) -> float:
    """Fill what every coordinate lacks at pressures, and its slopes; return the largest relative one.

    That is infinite where forces are. ``held`` has the forces of `held_force`; slopes are by lambda, and
    those of the pressures are ``ways``. No muscle goes slack where they are ``taut``.
    """
    m, width = int(c[1]), n_terms(c)
    for j in range(m):
        pulled = coupling_force(c, j, q, x, matrix[j])
        lacks[j], sizes[j] = -pulled, abs(pulled)
        for i in range(m):
            sizes[j] += abs(matrix[j, i] * q[i])
            matrix[j, i] = 0.0
    for k in range(int(c[0])):
        own, y = muscle_at(c, k), shortening(c, k, q)
        a = area(c, k, y)[0]
        rubbed, by_p = friction(
            c, k, state, way, y, p[k], x, terms[:width], terms[width : 2 * width]
        )
        force, slope = held[k] + rubbed - p[k] * a, by_p - a
        size = abs(held[k]) + abs(rubbed) + abs(p[k] * a)
        if force > c[own + 3] and not taut:
            force, slope = c[own + 3], 0.0
        for j in range(m):
            pull = c[own + OWN + j]
            lacks[j] -= pull * force
            sizes[j] += abs(pull) * size
            for i in range(m):
                matrix[j, i] -= pull * slope * ways[k, i]
    left = 0.0
    for j in range(m):
        if not sizes[j] < np.inf:
            return np.inf
        if sizes[j] > 0.0:
            left = max(left, abs(lacks[j]) / sizes[j])
    return left


@kernel
def combine(middle: Array, ways: Array, at: Array, p: Array) -> None:
    """Fill the pressures that are so far along their ways from the middle."""
    for k in range(p.size):
        p[k] = middle[k]
        for j in range(at.size):
            p[k] += ways[k, j] * at[j]


@kernel
def balance_driven(
    c: Array,
    state: Array,
    way: int,
    q: Array,
    x: Array,
    p: Array,
    middle: Array,
    spread: Array,
    work: Array,
) -> bool:
    """Fill the pressures that balance nearest to a middle, by a covariance; return whether they do.

    They are found by Newton's method, with a step halved while it does not help; forces are piecewise
    straight in pressure.
    """
    n, m = int(c[0]), int(c[1])
    lacks, step = work[:m], work[m : 2 * m]
    start, sizes = work[2 * m : 3 * m], work[3 * m : 4 * m]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    rest = work[work_size(c) :]
    held, ways, at = rest[:n], rest[n : n + n * m].reshape((n, m)), rest[n + n * m : n + n * m + m]
    for k in range(n):
        held[k] = held_force(c, k, state, way, shortening(c, k, q), x, terms)
        for j in range(m):
            ways[k, j] = 0.0
    for i in range(n):
        a = area(c, i, shortening(c, i, q))[0]
        for k in range(n):
            for j in range(m):
                ways[k, j] += spread[k, i] * a * c[muscle_at(c, i) + OWN + j]
    for j in range(m):
        start[j] = 0.0
        step[j] = 0.0
    left, before = np.inf, np.inf
    for turn in range(MOST_STEPS):
        first = turn == 0  # from where all muscles are taut, since slack ones do not answer
        for j in range(m):
            at[j] = start[j] + step[j]
        combine(middle, ways, at, p)
        left = undriven(c, state, way, q, x, p, held, ways, first, lacks, sizes, matrix, terms)
        if not first and (left <= BALANCED or (not left < before and before < NEARLY)):
            break
        if left < before:
            before = np.inf if first else left
            eliminate(matrix, lacks)
            for j in range(m):
                start[j] = at[j]
                step[j] = -lacks[j]
        else:
            for j in range(m):
                step[j] *= 0.5
    if not left <= before:
        combine(middle, ways, start, p)
    return min(left, before) < NEARLY


@kernel
def drive_pressures(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> bool:
    """Fill the pressures, combined as recorded, that hold the muscles; return whether they exist.

    A muscle beyond the range of pressures stays at its end, and takes the others along as they were
    recorded together; while these are driven in more directions than coordinates, they take its part.
    """
    n, m, n_free = int(c[0]), int(c[1]), int(c[21])
    at, shares, rest = drive_at(c), work[work_size(c) :], work[work_size(c) + n + n * m + m :]
    recorded = c[at + n : at + n + n * n].reshape((n, n))
    middle, spread = rest[:n], rest[n : n + n * n].reshape((n, n))
    for k in range(n):
        middle[k] = c[at + k]
        for i in range(n):
            spread[k, i] = recorded[k, i]
    reached = False
    for _ in range(n):
        if n_free >= m:
            reached = balance_driven(c, state, way, q, x, p, middle, spread, work)
        worst, furthest, end = -1, 0.0, 0.0
        for k in range(n):
            inside = min(max(p[k], c[13]), c[14])
            beyond = abs(p[k] - inside)
            moves = spread[k, k] > HAIR * recorded[k, k]
            if moves and beyond > HAIR * (1.0 + abs(p[k])):
                beyond *= beyond / spread[k, k]
                if beyond > furthest:
                    worst, furthest, end = k, beyond, inside
        if worst < 0:
            return reached
        more, shift, size = end - p[worst], end - middle[worst], spread[worst, worst]
        for k in range(n):
            shares[k] = spread[k, worst] / size
            p[k] += shares[k] * more
            middle[k] += shares[k] * shift
        for k in range(n):
            for i in range(n):
                spread[k, i] -= shares[k] * shares[i] * size
        n_free -= 1
        reached = False
    return False


@kernel
def solve_pressures(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> bool:
    """Fill the pressures that hold the muscles at coordinates; return whether they exist.

    Muscles that are more than coordinates take the forces that they rest with at the pressure they
    share, and the least changes of them that balance; those that would leave the range of pressures, or
    go slack, stay at its end, one by one, and the others take their part; with a drive, see
    `drive_pressures`. ``work`` has two numbers a muscle more than `work_size`, or what a drive needs.
    """
    if c[21] != 0.0:
        return drive_pressures(c, state, way, q, x, p, work)
    n, m = int(c[0]), int(c[1])
    lacks, gradient = work[:m], work[m : 2 * m]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    if c[20] == 0.0:
        reached = True
        for k in range(n):
            pulled = coupling_force(c, k, q, x, gradient)
            most = c[muscle_at(c, k) + 3]
            reached = reached and -pulled <= most
            p[k] = pressure_for(c, k, state, way, q[k], min(-pulled, most), x, terms)
        return reached
    width, n_free, rest = n_terms(c), n, work[work_size(c) :]
    forces, free = rest[:n], rest[n : 2 * n]
    for k in range(n):
        free[k] = 1.0
    for _ in range(n):
        for j in range(m):
            pulled = coupling_force(c, j, q, x, gradient)
            lacks[j] = -pulled
            for i in range(m):
                matrix[j, i] = 0.0
        for k in range(n):
            own, y, known = muscle_at(c, k) + OWN, shortening(c, k, q), way
            if free[k] != 0.0:
                p[k], known = min(max(c[19], c[13]), c[14]), AT_REST
            force = muscle_force(c, k, state, known, y, p[k], x, terms[:width], terms[width:])[0]
            forces[k] = force
            for j in range(m):
                lacks[j] -= c[own + j] * force
                for i in range(m):
                    matrix[j, i] += free[k] * c[own + j] * c[own + i]
        eliminate(matrix, lacks)
        worst, furthest, end = -1, 0.0, 0.0
        for k in range(n):
            if free[k] == 0.0:
                continue
            own, y, wanted, lowest = muscle_at(c, k), shortening(c, k, q), forces[k], c[13]
            for j in range(m):
                wanted += c[own + OWN + j] * lacks[j]
            p[k] = pressure_for(c, k, state, way, y, wanted, x, terms)
            if wanted > c[own + 3]:
                slack = pressure_for(c, k, state, way, y, c[own + 3], x, terms)
                lowest = max(lowest, slack)
            inside = min(max(p[k], lowest), c[14])
            beyond = abs(p[k] - inside) - HAIR * (1.0 + abs(p[k]))
            if beyond > furthest:
                worst, furthest, end = k, beyond, inside
        if worst < 0 or n_free == m:
            return worst < 0
        p[worst] = end
        free[worst] = 0.0
        n_free -= 1
    return False


@kernel
def give_pressures(c: Array, state: Array, scratch: Array, given: Array, p: Array) -> int:
    """Compute the pressures of a sample; scratch then starts with the muscles' positions.

    The last state counts samples that muscles cannot reach.
    """
    m, n_x = int(c[1]), int(c[2]) + int(c[4])
    q, work = scratch[:m], scratch[m:]
    x = given[m : m + n_x]
    way = FROM_REST if state[state.size - 2] != 0.0 else IN_TIME
    for j in range(m):
        q[j] = given[j] + state[state.size - 2 - m + j]
    reached = solve_pressures(c, state, way, q, x, p, work)
    for k in range(p.size):
        inside = min(max(p[k], c[13]), c[14])
        reached = reached and abs(p[k] - inside) <= HAIR * (1.0 + abs(p[k]))
        p[k] = inside
    if not reached:  # where the muscles go instead is what friction will remember
        solve_equilibrium(c, state, way, q, x, p, work)
        state[state.size - 1] += 1.0
    return way


@kernel
def start_balance(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start muscles at rest without pressure, or at the first displacements with unloaded friction."""
    c = coefficients
    n, m, n_x = int(c[0]), int(c[1]), int(c[2]) + int(c[4])
    x, q, p, work = inputs[m : m + n_x], scratch[:m], scratch[m : m + n], scratch[m + n :]
    if c[22] != 0.0:
        fill(q, inputs)
        start_held(c, state, x, q, p)
    else:
        start_at_rest(c, state, x, q, p, work)
    if virgin:
        for j in range(m):
            q[j] = inputs[j] + state[state.size - 2 - m + j]
        solve_pressures(c, state, AT_REST, q, x, p, work)
        for k in range(n):
            p[k] = min(max(p[k], c[13]), c[14])
        update_state(c, state, AT_REST, q, p, x)
