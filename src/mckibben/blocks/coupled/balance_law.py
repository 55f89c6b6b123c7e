"""What holds in every sample of a balance of forces, and its two solutions.

    loads + S_k(x) (1, y) + min(R_k, b_k) = 0

Of muscle k: R, in `mckibben.blocks.coupled.balance_terms`, is what it resists shortening with, up to b,
at which it buckles. Taut, it is as short as its ends are near, u = y; slack, u is where it resists with
b. Pressures follow from displacements muscle by muscle; displacements from pressures as the minimum of a
convex energy, by Newton's method with a search along every step.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance_terms import (
    AT_REST,
    FROM_REST,
    HEAD,
    IN_TIME,
    area,
    elastic,
    lagging,
    muscle_width,
    muscles,
    resisted,
    rubbed,
    sprung,
)
from mckibben.blocks.kernels import DERIVED, kernel
from mckibben.blocks.solving import eliminate

NEVER = 1e30
"""Force at which what never goes slack would."""

MOST_STEPS, MOST_SEARCHED = 60, 25
"""Of Newton's method, and along each step."""

BALANCED, NEARLY = 2e-15, 1e-9
"""Residual, relative to the forces, that is an equilibrium, and that is one but for rounding."""

SURE = 1e-11
"""Residual from which one step more, be it not looked at, ends at an equilibrium."""

HAIR = 1e-9
"""Relative difference of pressures that is rounding."""

SINGLE = {"BALANCED": 1e-6, "NEARLY": 1e-4, "SURE": 1e-5, "HAIR": 1e-6}


@kernel
def shortened(
    c: Array, own: int, k: int, state: Array, way: int, y: float, p: float
) -> tuple[float, bool]:
    """Return how short muscle k is where its ends are y nearer, and whether it is slack."""
    least = c[own + 3]
    if least >= NEVER:
        return y, False
    excess, slope, _ = resisted(c, own, k, state, way, y, p)
    excess -= least
    if not excess > 0.0:
        return y, False
    low, high, u = -NEVER, y, y
    reach = 1e-3 * c[8]
    for _ in range(MOST_STEPS):
        guess = u - excess / slope if slope > 0.0 else -NEVER
        if not low < guess < high:
            guess = high - reach if low == -NEVER else 0.5 * (low + high)
            reach *= 2.0
        u = guess
        force, slope, size = resisted(c, own, k, state, way, u, p)
        excess = force - least
        if abs(excess) <= BALANCED * (size + least):
            break
        if excess > 0.0:
            high = u
        else:
            low = u
    if DERIVED:
        u -= excess / slope
    return u, True


@kernel
def keep(c: Array, state: Array, way: int, y: Array, p: Array) -> None:
    """Bring the state to where the muscles are now."""
    n, m, n_l = int(c[0]), int(c[4]), int(c[5])
    for k in range(n):
        own = muscles(c) + k * muscle_width(c)
        u = shortened(c, own, k, state, way, y[k], p[k])[0]
        z = u + c[own + 2] * p[k]
        grown = max(p[k] + c[9], 0.0) if way != AT_REST else 0.0
        for i in range(m):
            s = state[2 * n + k * m + i] + z - state[n + k]
            limit = c[HEAD + i] * grown
            state[2 * n + k * m + i] = min(max(s, -limit), limit)
        for i in range(n_l):
            place = 2 * n + n * m + k * n_l + i
            gain = c[HEAD + m + n_l + i] if way == IN_TIME else c[14]
            if way == AT_REST:
                state[place] = 0.0
            else:
                state[place] = c[HEAD + m + i] * state[place] + gain * (u - state[k])
        if c[15] != 0.0:
            place = 2 * n + n * (m + n_l) + 2 * k
            state[place + 1] = state[place] if way == IN_TIME else 0.0
            state[place] = u - state[k] if way == IN_TIME else 0.0
        state[k] = u
        state[n + k] = z


@kernel
def pressed(
    c: Array, k: int, state: Array, way: int, y: Array, x: Array, gradient: Array
) -> tuple[float, bool]:
    """Return the pressure of muscle k that balances it where all muscles are, and whether one does.

    It is the one root of a function that rises piecewise straight, since areas are larger than what
    friction grows with pressure. Where the muscle would have to push more than it can, it is the
    pressure at which it is about to go slack.
    """
    own = muscles(c) + k * muscle_width(c)
    asked = sprung(c, own, k, y, x, gradient)
    reached = asked >= -c[own + 3]
    held = max(asked, -c[own + 3]) + elastic(c, own, y[k])[0]
    held += lagging(c, own, k, state, way, y[k])[0]
    a = area(c, own, y[k])[0]
    low, high = -NEVER, NEVER
    p = held / a
    for _ in range(MOST_STEPS):
        force, _, by_p = rubbed(c, own, k, state, way, y[k], p)
        excess = p * a - held - force
        if abs(excess) <= BALANCED * (abs(p * a) + abs(held) + abs(force)):
            break
        if excess > 0.0:
            high = p
        else:
            low = p
        slope = a - by_p
        p -= excess / slope if slope > 0.0 else excess / a
        if not low < p < high:  # only where friction outgrows the area
            p = 0.5 * (low + high)
    return p, reached


@kernel
def unbalanced(
    c: Array,
    state: Array,
    way: int,
    y: Array,
    x: Array,
    p: Array,
    residual: Array,
    matrix: Array,
    gradient: Array,
) -> float:
    """Fill what every muscle's forces lack to a balance, and its slopes; return the largest share.

    That is infinite where forces are.
    """
    n = int(c[0])
    worst = 0.0
    for k in range(n):
        own = muscles(c) + k * muscle_width(c)
        force = sprung(c, own, k, y, x, gradient)
        resisting, slope, size = resisted(c, own, k, state, way, y[k], p[k])
        if resisting > c[own + 3]:
            resisting, slope = c[own + 3], 0.0
        residual[k] = force + resisting
        for j in range(n):
            matrix[k, j] = gradient[j]
            size += abs(gradient[j] * y[j])
        matrix[k, k] += slope
        size += abs(force)
        if not size < np.inf:
            return np.inf
        if size > 0.0:
            worst = max(worst, abs(residual[k]) / size)
    return worst


@kernel
def settle(c: Array, state: Array, way: int, y: Array, x: Array, p: Array, scratch: Array) -> float:
    """Move the displacements to where pressures hold them; return what is left of the residual.

    Where no place is found, they stay where they were. ``scratch`` has n n + 4 n numbers.
    """
    n = int(c[0])
    vectors = scratch[: 4 * n].reshape((4, n))
    residual, step, start, gradient = vectors[0], vectors[1], vectors[2], vectors[3]
    matrix = scratch[4 * n : 4 * n + n * n].reshape((n, n))
    left = unbalanced(c, state, way, y, x, p, residual, matrix, gradient)
    before = 2.0 * left + 1.0
    for _ in range(MOST_STEPS):
        if left <= BALANCED or (left >= before and left < NEARLY) or left == np.inf:
            break
        before = left
        for k in range(n):
            step[k] = -residual[k]
            start[k] = y[k]
        eliminate(matrix, step)
        down = 0.0
        for k in range(n):
            down += residual[k] * step[k]
        if not down < 0.0:  # where the energy is not convex: straight down
            down = 0.0
            for k in range(n):
                step[k] = -residual[k]
                down -= residual[k] * residual[k]
        if left <= SURE:
            for k in range(n):
                y[k] += step[k]
            break
        low, high, share = 0.0, -1.0, 1.0
        low_rate, high_rate = down, 0.0
        for _ in range(MOST_SEARCHED):
            for k in range(n):
                y[k] = start[k] + share * step[k]
            left = unbalanced(c, state, way, y, x, p, residual, matrix, gradient)
            rate = 0.0
            for k in range(n):
                rate += residual[k] * step[k]
            if left <= BALANCED or abs(rate) <= 0.7 * abs(down) or left == np.inf:
                break
            if rate > 0.0:
                high, high_rate = share, rate
            else:
                low, low_rate = share, rate
            if high < 0.0:
                share *= 2.0
            else:  # where the rate would vanish were it straight, but well inside
                width = high - low
                share = low + width * min(max(-low_rate / (high_rate - low_rate), 0.1), 0.9)
    if DERIVED:
        unbalanced(c, state, way, y, x, p, residual, matrix, gradient)
        eliminate(matrix, residual)
        for k in range(n):
            y[k] -= residual[k]
    if not left < NEARLY:
        for k in range(n):
            y[k] = state[k]
    return left


@kernel
def begin(c: Array, state: Array, x: Array, p: Array, scratch: Array) -> None:
    """Rest without pressure, and take the tare there; nothing has come before the first sample."""
    n = int(c[0])
    for i in range(state.size):
        state[i] = 0.0
    y = scratch[:n]
    for k in range(n):
        y[k] = 0.0
        p[k] = 0.0
    settle(c, state, AT_REST, y, x, p, scratch[n:])
    keep(c, state, AT_REST, y, p)
    if c[13] != 0.0:
        for k in range(n):
            state[state.size - 2 - n + k] = y[k]
    state[state.size - 2] = 1.0


@kernel
def press(c: Array, state: Array, scratch: Array, given: Array, p: Array) -> None:
    """Give the pressures of a sample, and bring the state there; then scratch begins with where.

    The last state counts samples that muscles cannot reach.
    """
    n, n_x = int(c[0]), int(c[1]) + int(c[3])
    y, gradient = scratch[:n], scratch[2 * n : 3 * n]
    tare, x = state[state.size - 2 - n :], given[n : n + n_x]
    way = FROM_REST if state[state.size - 2] != 0.0 else IN_TIME
    amiss = False
    for j in range(n):
        y[j] = given[j] + tare[j]
    for k in range(n):
        found, reached = pressed(c, k, state, way, y, x, gradient)
        p[k] = min(max(found, c[10]), c[11])
        amiss = amiss or not (reached and abs(p[k] - found) <= HAIR * (1.0 + abs(found)))
    if amiss:  # where the muscles go instead is what friction will remember
        settle(c, state, way, y, x, p, scratch[2 * n :])
        state[state.size - 1] += 1.0
    keep(c, state, way, y, p)
    state[state.size - 2] = 0.0


@kernel
def start_balance(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start muscles at rest without pressure, or at the first displacements, with nothing loaded."""
    c = coefficients
    n, n_x = int(c[0]), int(c[1]) + int(c[3])
    x, p = inputs[n : n + n_x], scratch[:n]
    begin(c, state, x, p, scratch[n:])
    if virgin:
        y, gradient = scratch[n : 2 * n], scratch[2 * n : 3 * n]
        for k in range(n):
            y[k] = inputs[k] + state[state.size - 2 - n + k]
        for k in range(n):
            found, _ = pressed(c, k, state, AT_REST, y, x, gradient)
            p[k] = min(max(found, c[10]), c[11])
        keep(c, state, AT_REST, y, p)
        state[state.size - 2] = 0.0
