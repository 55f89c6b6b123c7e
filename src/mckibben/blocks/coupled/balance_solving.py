"""The two solvers of a balance: coordinates for pressures, and pressures for coordinates.

Pressures follow from coordinates muscle by muscle; coordinates from pressures as the minimum of a convex
energy, by Newton's method with a search along every step. Muscles that are more than coordinates take
the pressures nearest to the middle d of those that were recorded, in the metric of their covariance C:

    p = d + C A W z,

with one z a coordinate. So they stay on the line on which a differential drive was recorded.

Forces are those of `mckibben.blocks.coupled.balance_law`.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance_law import (
    AT_REST,
    FROM_REST,
    IN_TIME,
    area,
    coupling_force,
    dynamic_terms,
    friction,
    lag_terms,
    muscle_at,
    muscle_force,
    polynomial_terms,
    shortening,
    terms_at,
    update_state,
)
from mckibben.blocks.kernels import DERIVED, fill, kernel, short_kernel
from mckibben.blocks.solving import eliminate

MOST_STEPS, MOST_SEARCHED = 60, 25
"""Maximum number of Newton steps, and of line-search steps in each."""

BALANCED, NEARLY = 2e-15, 1e-9
"""Relative residual of an equilibrium, and of one to within rounding."""

SURE = 1e-11
"""Residual from which one further Newton step converges without a check."""

HAIR = 1e-9
"""Relative difference of pressures that is rounding."""

SINGLE = {"BALANCED": 1e-6, "NEARLY": 1e-4, "SURE": 1e-5, "HAIR": 1e-6}


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
def coupling_forces(
    c: Array, q: Array, x: Array, forces: Array, sizes: Array, matrix: Array
) -> None:
    """Fill the force of loads, springs and obstacles on every coordinate, its size, and its slopes."""
    for j in range(q.size):
        forces[j] = coupling_force(c, j, q, x, matrix[j])
        sizes[j] = abs(forces[j])
        for i in range(q.size):
            sizes[j] += abs(matrix[j, i] * q[i])


@kernel
def unbalanced(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> float:
    """Fill the residual force of every coordinate and its slopes; return the largest relative one."""
    m = int(c[at.N_COORDINATES])
    residual, sizes = work[:m], work[3 * m : 4 * m]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    coupling_forces(c, q, x, residual, sizes, matrix)
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

    Where no place is found, they stay where they were. ``work`` has `WORK` numbers.
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

    Free muscles have the pressure that they share, at rest; what follows `WORK` are forces and
    whether each is free.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    lacks, gradient, rest = work[:m], work[m : 2 * m], work[int(c[at.WORK]) :]
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
    lacks, terms, rest = work[:m], work[4 * m + m * m :], work[int(c[at.WORK]) :]
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
    """Fill the residual force of every coordinate, and its slopes; return the largest relative one.

    Slopes are by z. What follows `WORK` are the forces of `held_force`, and the slopes of the
    pressures by z. No muscle goes slack where they are ``taut``.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    residual, sizes, rest = work[:m], work[3 * m : 4 * m], work[int(c[at.WORK]) :]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    held, ways = rest[:n], rest[n : n + n * m].reshape((n, m))
    coupling_forces(c, q, x, residual, sizes, matrix)
    work[4 * m : 4 * m + m * m] = 0.0
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
            residual[j] += pull * force
            sizes[j] += abs(pull) * size
            for i in range(m):
                matrix[j, i] += pull * slope * ways[k, i]
    return largest_share(residual, sizes)


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
    residual, step, start = work[:m], work[m : 2 * m], work[2 * m : 3 * m]
    matrix, terms = work[4 * m : 4 * m + m * m].reshape((m, m)), work[4 * m + m * m :]
    rest = work[int(c[at.WORK]) :]
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
            eliminate(matrix, residual)
            for j in range(m):
                start[j] = shares[j]
                step[j] = -residual[j]
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
    drive, rest = int(c[at.DRIVE]), work[int(c[at.WORK]) + n + n * m + m :]
    recorded = c[drive + n : drive + n + n * n].reshape((n, n))
    spread = rest[n : n + n * n].reshape((n, n))
    fill(rest[: n + n * n], c[drive:])
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
        hold(worst, end, p, rest, work[int(c[at.WORK]) :])
        n_free -= 1
        reached = False
    return False


@kernel
def solve_pressures(
    c: Array, state: Array, way: int, q: Array, x: Array, p: Array, work: Array
) -> bool:
    """Fill the pressures that hold the muscles at coordinates; return whether they exist.

    ``work`` has two numbers a muscle more than `WORK`, or what a drive needs.
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
