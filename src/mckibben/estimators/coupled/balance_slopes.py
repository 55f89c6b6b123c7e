"""How a balance of forces runs, and how that moves with every coefficient, exactly.

Either free, where its displacements are what matters, or held where the muscles were measured, where
the forces that it then lacks are: those are linear in all coefficients but walls, grip and lags.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.kernels import kernel
from mckibben.blocks.core.linear_system import eliminate
from mckibben.blocks.coupled.balance_law import (
    AT_REST,
    FROM_REST,
    HEAD,
    IN_TIME,
    keep,
    muscle_width,
    muscles,
    settle,
    unbalanced,
)

NOTHING: Array = np.zeros(0)
"""Where no stops and lags begin: at rest."""


@kernel
def slower(decay: float, gain: float, before: float, moved: float) -> float:
    """Return how what a lag is behind moves with the logarithm of its time constant."""
    return -decay * np.log(decay) * before + (gain - decay) * moved


@kernel
def direct(
    c: Array, state: Array, way: int, k: int, y: Array, x: Array, p: Array, slopes: Array
) -> None:
    """Fill how the forces of muscle k move with the coefficients, where it and its past stay."""
    n, n_x, degree, n_loads = int(c[0]), int(c[1]), int(c[2]), int(c[3])
    m, n_l, n_e, n_a, scale = int(c[4]), int(c[5]), int(c[6]), int(c[7]), c[8]
    width = muscle_width(c)
    own = muscles(c) + k * width
    for i in range(slopes.size):
        slopes[i] = 0.0
    place = k * width + 4
    for q in range(1 + n_x * degree):
        power = 1.0
        if q > 0:
            for _ in range((q - 1) % degree + 1):
                power *= x[(q - 1) // degree]
        slopes[place] = power
        for j in range(n):
            slopes[place + 1 + j] = power * y[j]
        place += 1 + n
    inside = min(max(y[k], c[own]), c[own + 1])
    u, beyond = inside / scale, (y[k] - inside) / scale
    power = u
    for i in range(n_e):
        slopes[place + i] = power * u + (i + 2) * power * beyond
        power *= u
    place += n_e
    power = 1.0
    for i in range(n_a):
        slopes[place + i] = -p[k] * power
        if i > 0:
            slopes[place + i] -= p[k] * beyond * i * power / u if u != 0.0 else 0.0
        power *= u
    place += n_a
    wall, grown = c[own + 2], max(p[k] + c[9], 0.0)
    moved = y[k] + wall * p[k] - state[n + k]
    for i in range(m):
        if way == AT_REST:
            break
        h, limit = c[own + place - k * width + i], c[HEAD + i] * grown
        s = state[2 * n + k * m + i] + moved
        slopes[place + i] = min(max(s, -limit), limit)
        if -limit <= s <= limit:
            slopes[k * width + 2] += h * p[k]
        elif grown > 0.0:
            by_grip = h * c[HEAD + i] if s > 0.0 else -h * c[HEAD + i]
            slopes[n * width] += by_grip
    place += m
    if way != AT_REST:
        slopes[k * width + 3] = c[12] * (y[k] - state[k]) if way == IN_TIME else 0.0
        for i in range(n_l):
            q_before = state[2 * n + n * m + k * n_l + i]
            gain = c[HEAD + m + n_l + i] if way == IN_TIME else 1.0
            decay = c[HEAD + m + i]
            slopes[place + i] = decay * q_before + gain * (y[k] - state[k])
            if way == IN_TIME:
                kappa = c[own + place - k * width + i]
                slopes[n * width + 1 + i] = kappa * slower(decay, gain, q_before, y[k] - state[k])
    place += n_l
    for i in range(n_loads):
        slopes[place + i] = x[n_x + i]


@kernel
def remembered(
    c: Array,
    state: Array,
    way: int,
    k: int,
    y: float,
    p: float,
    memory: Array,
    slopes: Array,
) -> None:
    """Add how the forces of muscle k move with the coefficients through its past.

    ``memory`` has, by coefficient, how the state moves: displacements, stretches, stops, lags.
    """
    n, n_loads, m, n_l = int(c[0]), int(c[3]), int(c[4]), int(c[5])
    width = muscle_width(c)
    own = muscles(c) + k * width
    if way == AT_REST:
        return
    place = own + width - n_loads - n_l - m
    grown = max(p + c[9], 0.0)
    moved = y + c[own + 2] * p - state[n + k]
    for i in range(m):
        row = 2 * n + k * m + i
        if abs(state[row] + moved) <= c[HEAD + i] * grown:
            for j in range(slopes.size):
                slopes[j] += c[place + i] * (memory[row, j] - memory[n + k, j])
    carried = c[own + 3] * c[12] if way == IN_TIME else 0.0
    for i in range(n_l):
        kappa = c[own + width - n_loads - n_l + i]
        carried += kappa * (c[HEAD + m + n_l + i] if way == IN_TIME else 1.0)
        row = 2 * n + n * m + k * n_l + i
        for j in range(slopes.size):
            slopes[j] += kappa * c[HEAD + m + i] * memory[row, j]
    for j in range(slopes.size):
        slopes[j] -= carried * memory[k, j]


@kernel
def carry(
    c: Array,
    state: Array,
    way: int,
    k: int,
    y: float,
    p: float,
    memory: Array,
    moves: Array,
) -> None:
    """Bring to now how the past of muscle k moves, whose displacement moves so by the coefficients."""
    n, m, n_l = int(c[0]), int(c[4]), int(c[5])
    width = muscle_width(c)
    own = muscles(c) + k * width
    grown = max(p + c[9], 0.0)
    moved = y + c[own + 2] * p - state[n + k]
    stretch = k * width + 2
    for i in range(m):
        row = 2 * n + k * m + i
        s = state[row] + moved
        limit = c[HEAD + i] * grown
        sticks = way != AT_REST and abs(s) <= limit
        for j in range(moves.size):
            if sticks:
                memory[row, j] += moves[j] - memory[n + k, j]
            else:
                memory[row, j] = 0.0
        if sticks:
            memory[row, stretch] += p
        elif way != AT_REST and grown > 0.0:
            memory[row, n * width] = c[HEAD + i] if s > 0.0 else -c[HEAD + i]
    for i in range(n_l):
        row = 2 * n + n * m + k * n_l + i
        gain = c[HEAD + m + n_l + i] if way == IN_TIME else 1.0
        longer = slower(c[HEAD + m + i], gain, state[row], y - state[k])
        for j in range(moves.size):
            if way == AT_REST:
                memory[row, j] = 0.0
            else:
                memory[row, j] = c[HEAD + m + i] * memory[row, j] + gain * (moves[j] - memory[k, j])
        if way == IN_TIME:
            memory[row, n * width + 1 + i] += longer
    for j in range(moves.size):
        memory[k, j] = moves[j]
        memory[n + k, j] = moves[j]
    memory[n + k, stretch] += p


@kernel
def move(
    c: Array,
    state: Array,
    way: int,
    held: bool,
    y: Array,
    x: Array,
    p: Array,
    memory: Array,
    found: Array,
    slopes: Array,
    scratch: Array,
) -> None:
    """Make one move, free or held, with all slopes; found are displacements, or what forces lack."""
    n = int(c[0])
    vectors = scratch[: 3 * n].reshape((3, n))
    residual, column, gradient = vectors[0], vectors[1], vectors[2]
    matrix = scratch[3 * n : 3 * n + n * n].reshape((n, n))
    copied = scratch[3 * n + n * n : 3 * n + 2 * n * n].reshape((n, n))
    reverse = scratch[3 * n + 2 * n * n : 3 * n + 3 * n * n].reshape((n, n))
    if not held:
        settle(c, state, way, y, x, p, scratch[3 * n + 3 * n * n :])
    unbalanced(c, state, way, y, x, p, residual, matrix, gradient)
    for k in range(n):
        direct(c, state, way, k, y, x, p, slopes[k])
        remembered(c, state, way, k, y[k], p[k], memory, slopes[k])
        found[k] = residual[k] if held else y[k]
    if not held:
        for i in range(n):
            for k in range(n):
                column[k] = 1.0 if i == k else 0.0
                for j in range(n):
                    copied[k, j] = matrix[k, j]
            eliminate(copied, column)
            for k in range(n):
                reverse[k, i] = column[k]
        for j in range(slopes.shape[1]):
            for k in range(n):
                column[k] = 0.0
                for i in range(n):
                    column[k] -= reverse[k, i] * slopes[i, j]
            for k in range(n):
                slopes[k, j] = column[k]
    moves = memory[memory.shape[0] - 1]
    for k in range(n):
        for j in range(slopes.shape[1]):
            moves[j] = 0.0 if held else slopes[k, j]
        carry(c, state, way, k, y[k], p[k], memory, moves)
    keep(c, state, way, y, p)


@kernel
def follow(
    c: Array,
    driven: Array,
    measured: Array,
    x: Array,
    held: bool,
    settled: bool,
    every: int,
    begun: Array,
    memory: Array,
    scratch: Array,
    found: Array,
    slopes: Array,
) -> None:
    """Run from rest, or from where stops and lags begin, to every sample; keep every so manieth.

    Parameters
    ----------
    c : array
        Coefficients of the block.
    driven, measured, x : arrays, shapes (t, n), (t, n), (t, s)
        Pressures, displacements, what schedules and loads.
    held : bool
        Whether the muscles are where they were measured.
    settled : bool
        Whether they have long been there at the start.
    every : int
    begun : array, shape (n times stops and lags,)
        Stops and lags before the first sample [mm], of muscles that are where its pressures hold them
        without; none of those that come from rest.
    memory : array, shape (states + 1, coefficients)
        To compute in; so is ``scratch``.
    found : array, shape (t / every, n)
        Displacements [mm], or forces that are lacking [N].
    slopes : array, shape (t / every, n, coefficients)
        By every muscle's coefficients, the grip, the lags' logarithms, and ``begun``.
    """
    n = int(c[0])
    n_states = memory.shape[0] - 1
    state, rest = scratch[:n_states], scratch[n_states:]
    y, p, now = rest[:n], rest[n : 2 * n], rest[2 * n : 3 * n]
    work = rest[3 * n :]
    tare = memory[2 * n + n * int(c[4]) + n * int(c[5]) : n_states - 2]
    row = slopes[0]
    for i in range(memory.shape[0]):
        for j in range(memory.shape[1]):
            memory[i, j] = 0.0
    for i in range(n_states):
        state[i] = 0.0
    for k in range(n):
        y[k] = measured[0, k] if settled else 0.0
        p[k] = driven[0, k] if settled else 0.0
    if settled:
        keep(c, state, AT_REST, y, p)
    if not held:  # where they rest says nothing of forces where they were measured
        move(c, state, AT_REST, False, y, x[0], p, memory, now, row, work)
    offset = scratch[n_states - 2 - n : n_states - 2]
    if c[13] != 0.0:
        for k in range(n):
            offset[k] = y[k]
            for j in range(memory.shape[1]):
                tare[k, j] = memory[k, j]
    if begun.size > 0:
        for k in range(n):
            p[k] = driven[0, k]
        move(c, state, AT_REST, False, y, x[0], p, memory, now, row, work)
        for i in range(begun.size):
            state[2 * n + i] = begun[i]
            memory[2 * n + i, memory.shape[1] - begun.size + i] = 1.0
    for t in range(driven.shape[0]):
        for k in range(n):
            p[k] = driven[t, k]
            if held:
                y[k] = measured[t, k] + offset[k]
        row = slopes[t // every]
        way = FROM_REST if t == 0 else IN_TIME
        move(c, state, way, held, y, x[t], p, memory, now, row, work)
        for k in range(n):
            found[t // every, k] = now[k] if held else now[k] - offset[k]
            if not held and c[13] != 0.0:
                for j in range(memory.shape[1]):
                    row[k, j] -= tare[k, j]


def run(
    c: Array,
    driven: Array,
    measured: Array,
    x: Array,
    *,
    held: bool,
    every: int = 1,
    settled: bool = False,
    begun: Array = NOTHING,
) -> tuple[Array, Array]:
    """Return what `follow` finds, of whose every so many samples the last is kept, and the slopes."""
    n, m, n_l = int(c[0]), int(c[4]), int(c[5])
    width = (c.size - HEAD - m - 2 * n_l) // n
    n_states, n_c = n * (3 + m + n_l) + 2, n * width + 1 + n_l + begun.size
    kept = -(-len(driven) // every)
    found, slopes = np.empty((kept, n)), np.empty((kept, n, n_c))
    memory = np.zeros((n_states + 1, n_c))
    scratch = np.zeros(n_states + 10 * n + 4 * n * n)
    follow(c, driven, measured, x, held, settled, every, begun, memory, scratch, found, slopes)
    return found, slopes
