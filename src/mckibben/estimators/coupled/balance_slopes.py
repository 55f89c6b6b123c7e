"""How a balance of forces runs, and how that moves with every coefficient, exactly.

Either free, where its displacements are what matters, or held where the muscles were measured, where
the forces that it then lacks are: those are linear in all coefficients but walls, grip and lags.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance_law import keep, settle, shortened, unbalanced
from mckibben.blocks.coupled.balance_terms import (
    AT_REST,
    FROM_REST,
    HEAD,
    IN_TIME,
    OWN,
    accelerated,
    area,
    damped,
    flowing,
    muscle_width,
    muscles,
    resisted,
)
from mckibben.blocks.kernels import kernel
from mckibben.blocks.solving import eliminate

NOTHING: Array = np.zeros(0)
"""Where no stops and lags begin: at rest."""


@kernel
def slower(c: Array, i: int, before: float, moved: float) -> float:
    """Return how what a lag is behind moves with the logarithm of its time constant."""
    n_l = int(c[5])
    place = HEAD + int(c[4]) + i
    return c[c.size - n_l + i] * before + (c[place + n_l] - c[place]) * moved


@kernel
def mixed(to: Array, kept: float, share: float, row: Array) -> None:
    """Keep a share of some numbers, and add a share of others: the one loop over all coefficients."""
    for j in range(to.size):
        to[j] = kept * to[j] + share * row[j]


@kernel
def by_springs(c: Array, k: int, y: Array, x: Array, slopes: Array) -> None:
    """Fill how springs and loads of muscle k move with the coefficients."""
    n, n_x, degree, n_loads = int(c[0]), int(c[1]), int(c[2]), int(c[3])
    width = muscle_width(c)
    for i in range(slopes.size):
        slopes[i] = 0.0
    place = k * width + OWN
    slopes[place] = 1.0
    for j in range(n):
        slopes[place + 1 + j] = y[j]
    for i in range(n_x):
        power = 1.0
        for _ in range(degree):
            power *= x[i]
            place += 1 + n
            slopes[place] = power
            for j in range(n):
                slopes[place + 1 + j] = power * y[j]
    place = (k + 1) * width - n_loads
    for i in range(n_loads):
        slopes[place + i] = x[n_x + i]


@kernel
def direct(c: Array, state: Array, way: int, k: int, u: float, p: float, slopes: Array) -> None:
    """Add how what muscle k resists with moves with the coefficients, where it and its past stay."""
    n, m, n_l, n_e, n_a = int(c[0]), int(c[4]), int(c[5]), int(c[6]), int(c[7])
    width, scale = muscle_width(c), c[8]
    own = muscles(c) + k * width
    slopes[k * width + 6] = u
    place = k * width + OWN + (1 + int(c[1]) * int(c[2])) * (1 + n)
    inside = min(max(u, c[own]), c[own + 1])
    v, beyond = inside / scale, (u - inside) / scale
    power = v
    for i in range(n_e):
        slopes[place + i] = power * v + (i + 2) * power * beyond
        power *= v
    place += n_e
    power, below = 1.0, 0.0
    for i in range(n_a):
        slopes[place + i] = -p * (power + i * below * beyond)
        below = power
        power *= v
    place += n_a
    wall, grown = c[own + 2], max(p + c[9], 0.0)
    moved = u + wall * p - state[n + k]
    for i in range(m):
        if way == AT_REST:
            break
        h, limit = c[own + place - k * width + i], c[HEAD + i] * grown
        s = state[2 * n + k * m + i] + moved
        slopes[place + i] = min(max(s, -limit), limit)
        if -limit <= s <= limit:
            slopes[k * width + 2] += h * p
        elif grown > 0.0:
            by_grip = h * c[HEAD + i] if s > 0.0 else -h * c[HEAD + i]
            slopes[n * width] += by_grip
    place += m
    if way != AT_REST:
        speed = c[12] * (u - state[k]) if way == IN_TIME else 0.0
        flow, first = flowing(c, own, state[k]), place - m - n_a
        slopes[k * width + 4] = speed
        slopes[k * width + 5] = speed * flow * flow
        power = 2.0 * c[own + 5] * flow * speed / c[own + first - k * width]
        slopes[first] -= power * flow
        for i in range(n_a):
            slopes[first + i] += power
            power *= min(max(state[k], c[own]), c[own + 1]) / scale
        if way == IN_TIME and c[15] != 0.0:
            slopes[k * width + 7] = accelerated(c, k, state, u - state[k])
        for i in range(n_l):
            q_before = state[2 * n + n * m + k * n_l + i]
            gain = c[HEAD + m + n_l + i] if way == IN_TIME else c[14]
            decay = c[HEAD + m + i]
            slopes[place + i] = decay * q_before + gain * (u - state[k])
            if way == IN_TIME:
                kappa = c[own + place - k * width + i]
                slopes[n * width + 1 + i] = kappa * slower(c, i, q_before, u - state[k])


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

    ``memory`` has, by coefficient, how the state moves: displacements, stretches, stops less their
    muscle's stretch, which stays while they stick, lags, and the last moves.
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
            mixed(slopes, 1.0, c[place + i], memory[row])
    carried = 0.0
    if way == IN_TIME:
        carried = damped(c, own, state[k])
        if c[own] < state[k] < c[own + 1]:
            a, by_y = area(c, own, state[k])
            flow = flowing(c, own, state[k])
            carried -= 2.0 * c[own + 5] * flow * flow / a * by_y * c[12] * (y - state[k])
    for i in range(n_l):
        kappa = c[own + width - n_loads - n_l + i]
        carried += kappa * (c[HEAD + m + n_l + i] if way == IN_TIME else c[14])
        mixed(slopes, 1.0, kappa * c[HEAD + m + i], memory[2 * n + n * m + k * n_l + i])
    if way == IN_TIME and c[15] != 0.0:
        row, heavy = 2 * n + n * (m + n_l) + 2 * k, c[own + 7] * c[12] * c[12]
        carried += 2.0 * heavy
        mixed(slopes, 1.0, -3.0 * heavy, memory[row])
        mixed(slopes, 1.0, heavy, memory[row + 1])
    mixed(slopes, 1.0, -carried, memory[k])


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
    mixed(memory[k], -1.0, 1.0, moves)
    for i in range(n_l):
        row = 2 * n + n * m + k * n_l + i
        gain = c[HEAD + m + n_l + i] if way == IN_TIME else c[14]
        if way == AT_REST:
            mixed(memory[row], 0.0, 0.0, moves)
        else:
            mixed(memory[row], c[HEAD + m + i], gain, memory[k])
        if way == IN_TIME:
            memory[row, n * width + 1 + i] += slower(c, i, state[row], y - state[k])
    if way == IN_TIME and c[15] != 0.0:
        row = 2 * n + n * (m + n_l) + 2 * k
        mixed(memory[row + 1], 0.0, 1.0, memory[row])
        mixed(memory[row], 0.0, 1.0, memory[k])
    mixed(memory[k], 0.0, 1.0, moves)
    mixed(memory[n + k], 0.0, 1.0, moves)
    memory[n + k, k * width + 2] += p
    for i in range(m):
        row = 2 * n + k * m + i
        s = state[row] + moved
        if way != AT_REST and abs(s) <= c[HEAD + i] * grown:
            continue
        mixed(memory[row], 0.0, -1.0, memory[n + k])
        if way != AT_REST and grown > 0.0:
            memory[row, n * width] += c[HEAD + i] if s > 0.0 else -c[HEAD + i]


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
    """Make one move, free or held, with all slopes; found are displacements, or what forces lack.

    Slopes of no columns are not computed.
    """
    n, n_c, width = int(c[0]), slopes.shape[1], muscle_width(c)
    vectors = scratch[: 3 * n].reshape((3, n))
    residual, column, gradient = vectors[0], vectors[1], vectors[2]
    matrix = scratch[3 * n : 3 * n + n * n].reshape((n, n))
    copied = scratch[3 * n + n * n : 3 * n + 2 * n * n].reshape((n, n))
    reverse = scratch[3 * n + 2 * n * n : 3 * n + 3 * n * n].reshape((n, n))
    if not held:
        settle(c, state, way, y, x, p, scratch[3 * n + 3 * n * n :])
    if held or n_c:
        unbalanced(c, state, way, y, x, p, residual, matrix, gradient)
    for k in range(n):
        found[k] = residual[k] if held else y[k]
    if not n_c:
        keep(c, state, way, y, p)
        return
    for k in range(n):
        by_springs(c, k, y, x, slopes[k])
        residual[k], slack = shortened(c, muscles(c) + k * width, k, state, way, y[k], p[k])
        if slack:
            slopes[k, k * width + 3] = 1.0
        else:
            direct(c, state, way, k, y[k], p[k], slopes[k])
            remembered(c, state, way, k, y[k], p[k], memory, slopes[k])
    for i in range(0 if held else n):
        for k in range(n):
            column[k] = -1.0 if i == k else 0.0
            for j in range(n):
                copied[k, j] = matrix[k, j]
        eliminate(copied, column)
        for k in range(n):
            reverse[k, i] = column[k]
    for k in range(n):
        moves = memory[memory.shape[0] - n + k]
        mixed(moves, 0.0, 0.0, moves)
        for i in range(0 if held else n):
            mixed(moves, 1.0, reverse[k, i], slopes[i])
    for k in range(n):
        own, moves = muscles(c) + k * width, memory[memory.shape[0] - n + k]
        if not held:
            mixed(slopes[k], 0.0, 1.0, moves)
        u = residual[k]
        if u < y[k]:  # slack
            mixed(moves, 0.0, 0.0, moves)
            direct(c, state, way, k, u, p[k], moves)
            remembered(c, state, way, k, u, p[k], memory, moves)
            moves[k * width + 3] -= 1.0
            mixed(moves, -1.0 / resisted(c, own, k, state, way, u, p[k])[1], 0.0, moves)
        carry(c, state, way, k, u, p[k], memory, moves)
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
        Coefficients of the block, then decay times its logarithm, negative, of every lag.
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
    memory : array, shape (states + n, coefficients)
        To compute in; so is ``scratch``.
    found : array, shape (t / every, n)
        Displacements [mm], or forces that are lacking [N].
    slopes : array, shape (t / every, n, coefficients)
        By every muscle's coefficients, the grip, the lags' logarithms, and ``begun``; of no columns if
        not wanted.
    """
    n = int(c[0])
    n_states = memory.shape[0] - n
    state, rest = scratch[:n_states], scratch[n_states:]
    y, p, now = rest[:n], rest[n : 2 * n], rest[2 * n : 3 * n]
    work = rest[3 * n :]
    tare = memory[n_states - 2 - n : n_states - 2]
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
                tare[k, j] = 0.0 if held else row[k, j]
    if begun.size > 0:
        for k in range(n):
            p[k] = driven[0, k]
        move(c, state, AT_REST, False, y, x[0], p, memory, now, row, work)
        for i in range(begun.size):
            state[2 * n + i] = begun[i]
            if memory.shape[1] > 0:
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
                mixed(row[k], 1.0, -1.0, tare[k])


def run(
    c: Array,
    driven: Array,
    measured: Array,
    x: Array,
    *,
    held: bool,
    every: int = 1,
    settled: bool = False,
    sloped: bool = True,
    begun: Array = NOTHING,
) -> tuple[Array, Array]:
    """Return what `follow` finds, of whose every so many samples the last is kept, and the slopes."""
    n, m, n_l = int(c[0]), int(c[4]), int(c[5])
    width = (c.size - HEAD - m - 2 * n_l) // n
    n_states = n * (3 + m + n_l + (2 if c[15] else 0)) + 2
    n_c = (n * width + 1 + n_l + begun.size) * sloped
    decays = c[HEAD + m : HEAD + m + n_l]
    c = np.concatenate([c, -decays * np.log(decays)])
    kept = -(-len(driven) // every)
    found, slopes = np.empty((kept, n)), np.empty((kept, n, n_c))
    memory = np.zeros((n_states + n, n_c))
    scratch = np.zeros(n_states + 10 * n + 4 * n * n)
    follow(c, driven, measured, x, held, settled, every, begun, memory, scratch, found, slopes)
    return found, slopes
