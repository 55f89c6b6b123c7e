"""Adaptation of a force balance to measurements, within its physical bounds.

Adaptive parameters of every muscle are a constant force and four factors: on its springs and
elasticity, its area, its friction, and its relaxation. Springs of coordinates change with the factors
of the muscles that move them, in the shares of their work, by the root of both coordinates' factors, so
that they remain symmetric and positive. With R, the terms of `mckibben.blocks.coupled.balance_law`,
coordinates follow by

    dq / dtheta = -(dR / dq)^-1 dR / dtheta,

without stops and lags in dR / dq: a lasting change moves the whole motion, and its stops with it.

Factors are bounded so that areas exceed friction, and stiffness exceeds the loss of area, which ensures
one equilibrium. Stops and lags are displacements of the muscle, which follow from the reference: their
states do not change.

Where no load is measured, forces are relative to the area of muscle 1: that is not adapted, and a loss
of area appears as stiffer springs and more friction.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance_law import (
    DYNAMIC,
    NEVER,
    OWN,
    coordinate_at,
    coupling_force,
    give_pressures,
    muscle_at,
    muscle_force,
    n_terms,
    shortening,
    spring_row,
    start_balance,
    terms_at,
    update_state,
)
from mckibben.blocks.fields import rows, vector
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.kernels import fill, kernel, step
from mckibben.blocks.learning import (
    SENSES,
    Learnable,
    covariant,
    family_at,
    learn,
    pull_back,
    root_size,
    start_learning,
)
from mckibben.blocks.solving import eliminate

if TYPE_CHECKING:
    from mckibben.blocks.coupled.balance import Balance

KINDS = range(5)
OFFSET, STIFFNESS, AREA, FRICTION, RELAXATION = KINDS
"""Adaptive parameters of a muscle; an added force reduces its pull."""

ROW = 9
"""Numbers of a parameter: its muscle, the first of the terms that it is a factor on and the first
behind, the constant force of the muscle that it adds, its ends, the same by the factor on the area, and
the place of that factor among parameters, or -1; then its share in the springs of every coordinate."""

FACTORS = 0.5, 2.0
"""Smallest and largest factor on fitted values."""

MOST_FORCE = 0.3
"""Largest constant force, relative to its scale."""

USUAL_TOP = 10.0
"""Highest pressure if the model has no limit [bar]."""

LEAST_LEFT = 0.05
"""Smallest area left after friction, relative to the area at rest, as in identification."""

GRID = 21
"""Grid points over the known range of a displacement at which constraints are checked."""


@step
def balance_adaptive_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Adapt parameters, and compute pressures.

    The family's coefficients are [coordinates, a row for every parameter, the balance's]. The state is
    [the balance's, coordinates of the last sample, their slopes by parameters, what is adapted]; scratch
    is [work of learning, coefficients now, factors on springs, a balance's, that of `slopes_of`].
    """
    learner, size, at = coefficients, int(coefficients[0]), family_at(coefficients) + 1
    m, n_own = int(learner[at - 1]), own_states(learner, state)
    rows_end = at + (ROW + m) * size
    family, fitted = learner[at:rows_end].reshape((size, ROW + m)), learner[rows_end:]
    n_x = int(fitted[2]) + int(fitted[4])
    memory, asked, rest = state[:n_own], state[n_own : n_own + m], state[n_own + m :]
    slopes, adapted = rest[: m * size], rest[m * size :]
    theta, used, as_fitted = adapted[:size], adapted[size : 2 * size], learner[3 + 2 * size :]
    work, along, more = scratch[: 2 * size], scratch[2 * size : 3 * size], scratch[3 * size :]
    c, g, room = more[: fitted.size], more[fitted.size : fitted.size + m], more[fitted.size + m :]
    changed_any = False
    for j in range(m):
        row = slopes[j * size : (j + 1) * size]
        predicted = asked[j]
        for i in range(size):
            predicted += row[i] * (theta[i] - used[i])
        measured = inputs[m + n_x + j]
        one = learn(learner, adapted, j, row, work, measured, predicted, asked[j])
        changed_any = changed_any or one
    if changed_any:
        pull_back(learner, adapted, along, work)
        keep_balanced(learner, family, adapted, along, work)
        fill(used, theta)
    for i in range(size):
        along[i] = used[i] - as_fitted[i]
    retune(fitted, family, along, c, g)
    way = give_pressures(c, memory, room, inputs, outputs)
    q, x = room[:m], inputs[m : m + n_x]
    slopes_of(c, memory, way, fitted, family, g, q, outputs, x, slopes, room[m:])
    for j in range(m):
        asked[j] = q[j] - memory[n_own - 2 - m + j]
    update_state(c, memory, way, q, outputs, x)


@kernel
def own_states(learner: Array, state: Array) -> int:
    """Return the number of states of the balance."""
    size, m = int(learner[0]), int(learner[family_at(learner)])
    return state.size - m - (m + 2) * size - root_size(size) - SENSES * m


@kernel
def balance_adaptive_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start as the balance does, with the fitted parameters."""
    size, at, n_own = int(coefficients[0]), family_at(coefficients), own_states(coefficients, state)
    m = int(coefficients[at])
    fitted = coefficients[at + 1 + (ROW + m) * size :]
    start_balance(fitted, state[:n_own], scratch, inputs, virgin)
    state[n_own : n_own + m + m * size] = 0.0
    start_learning(coefficients, state[n_own + m + m * size :])


@kernel
def retune(fitted: Array, family: Array, changes: Array, c: Array, g: Array) -> None:
    """Set the coefficients from parameter changes, and the factors on springs of coordinates."""
    fill(c, fitted)
    m, n_powers = int(c[1]), 1 + int(c[2]) * int(c[3])
    g[:] = 1.0
    for i in range(changes.size):
        k, change = int(family[i, 0]), changes[i]
        for t in range(terms_at(c, k) + int(family[i, 1]), terms_at(c, k) + int(family[i, 2])):
            c[t] += change * fitted[t]
        for j in range(m):
            c[coordinate_at(c, j)] += change * family[i, 3] * c[muscle_at(c, k) + OWN + j]
            g[j] += change * family[i, ROW + j]
    for j in range(m):
        for to in range(m):
            for power in range(n_powers):
                c[coordinate_at(c, j) + power * (1 + m) + 1 + to] *= math.sqrt(g[j] * g[to])


@kernel
def slopes_of(
    c: Array,
    state: Array,
    way: int,
    fitted: Array,
    family: Array,
    g: Array,
    q: Array,
    p: Array,
    x: Array,
    slopes: Array,
    work: Array,
) -> None:
    """Fill the derivatives of each coordinate by the parameters."""
    m, width, elastic = int(c[1]), n_terms(c), DYNAMIC + int(c[7])
    size, square = slopes.size // m, m * m
    forces, rest = work[: slopes.size].reshape((m, size)), work[slopes.size :]
    matrix, left = rest[:square].reshape((m, m)), rest[square : 2 * square].reshape((m, m))
    row, terms, by_y = rest[2 * square :], rest[2 * square + m :], rest[2 * square + m + width :]
    for j in range(m):
        spring_row(c, j, x, row)
        for i in range(size):
            forces[j, i] = 0.0
            for to in range(m):
                both = family[i, ROW + j] / g[j] + family[i, ROW + to] / g[to]
                forces[j, i] += 0.5 * both * row[to] * q[to]
        coupling_force(c, j, q, x, matrix[j])
    for k in range(int(c[0])):
        w, own, slope = muscle_at(c, k) + OWN, terms_at(c, k), 0.0
        muscle_force(c, k, state, way, shortening(c, k, q), p[k], x, terms, by_y)
        for t in range(DYNAMIC - 1, elastic + int(c[8])):
            slope += c[own + t] * by_y[t]
        for i in range(size):
            if int(family[i, 0]) == k:
                force = family[i, 3]
                for t in range(int(family[i, 1]), int(family[i, 2])):
                    force += fitted[own + t] * terms[t]
                for j in range(m):
                    forces[j, i] += c[w + j] * force
        for j in range(m):
            for to in range(m):
                matrix[j, to] += c[w + j] * c[w + to] * slope
    right = row[:m]
    for j in range(m):
        for i in range(m):
            right[i] = -1.0 if i == j else 0.0
            for to in range(m):
                left[i, to] = matrix[i, to]
        eliminate(left, right)
        for i in range(size):
            slopes[j * size + i] = 0.0
            for to in range(m):
                slopes[j * size + i] += right[to] * forces[to, i]


@kernel
def keep_balanced(c: Array, family: Array, adapted: Array, along: Array, work: Array) -> None:
    """Project parameters onto the physical bounds of a balance.

    What is changed takes the others along as they are known to go together, which may not be possible
    twice.
    """
    p = along.size
    for turn in range(2):
        for i in range(p):
            by, area = int(family[i, 8]), 1.0
            if by >= 0:
                area = min(max(adapted[by], family[by, 4]), family[by, 5])
            low = max(family[i, 4], area * family[i, 6])
            high = min(family[i, 5], area * family[i, 7])
            inside = min(max(adapted[i], low), high)
            lacks = inside - adapted[i]
            if turn > 0:
                adapted[i] = inside
            elif lacks != 0.0:
                for j in range(p):
                    work[j] = 1.0 if j == i else 0.0
                covariant(adapted, work, along)
                for j in range(p):
                    adapted[j] += lacks * c[3 + j] / c[3 + i] * along[j] / along[i]


# -- what a balance can have -----------------------------------------------------------------------


def learnable_balance(balance: Balance) -> Learnable:
    """Return the adaptive parameters of a balance: factors of 1, and forces of 0.

    Factors are expected to change by 30 %, forces by 10 % of that of the highest pressure at rest.
    """
    m, adapted, known = len(balance.driven), adaptable_of(balance), balance.known_coordinates
    muscles, kinds = np.array(adapted).T
    offsets, at_rest = kinds == OFFSET, np.array(balance.areas)[muscles, 0] * top_of(balance)
    fitted, scales = np.where(offsets, 0.0, 1.0), np.where(offsets, at_rest, 1.0)

    def numbers(sample_time: float | None) -> Array:
        table = family_of(balance, adapted, scales)
        return np.concatenate([[m], table.ravel(), balance.coefficients(sample_time)])

    return Learnable(
        balance_adaptive_step,
        balance_adaptive_start,
        fitted=fitted,
        scales=scales,
        spread=np.diag(np.where(offsets, 0.1, 0.3) ** 2),
        with_parameters=lambda theta: Inverse(changed(balance, adapted, theta - fitted)),
        numbers=numbers,
        known=known,
        compensates=True,
        n_more_states=m + m * fitted.size,
        n_more_scratch=m * fitted.size + 2 * m * m + 2 * m + balance.coefficients(1.0).size,
    )


def adaptable_of(balance: Balance) -> list[tuple[int, int]]:
    """Return muscle and kind of every adaptive parameter."""
    found = []
    for k in range(len(balance.given)):
        lasting = any(balance.friction[k]), any(balance.relaxation[k])
        there = (True, True, k > 0 or balance.n_loads > 0, *lasting)
        found += [
            (k, kind) for kind in (OFFSET, STIFFNESS, AREA, FRICTION, RELAXATION) if there[kind]
        ]
    return found


def top_of(balance: Balance) -> float:
    """Return the highest pressure."""
    reach = balance.pressure_range
    return USUAL_TOP if reach is None else max(abs(reach[0]), abs(reach[1]))


def family_of(balance: Balance, adapted: list[tuple[int, int]], scales: Array) -> Array:
    """Return a row per parameter, shape (k, `ROW` + m)."""
    counts = (balance.elasticity[0], balance.areas[0], balance.limits, balance.lags)
    behind = DYNAMIC + np.cumsum([0, *map(len, counts)])
    table = np.zeros((len(adapted), ROW + len(balance.driven)))
    for row, (k, kind), scale in zip(table, adapted, scales, strict=True):
        friction, stiffness = ratios(balance, k)
        row[0], row[4:ROW] = k, (*FACTORS, -NEVER, NEVER, -1)
        if kind == OFFSET:
            row[3], row[4:6] = 1.0, (-MOST_FORCE * scale, MOST_FORCE * scale)
            continue
        row[1:3] = behind[kind - 1 : kind + 1]
        if kind == STIFFNESS:  # with the muscle's own spring
            row[1], row[6], row[ROW:] = DYNAMIC - 1, 1.0 / stiffness, shares_of(balance)[k]
        elif kind == FRICTION:
            row[7] = friction
        if kind in (STIFFNESS, FRICTION) and (k, AREA) in adapted:
            row[8] = adapted.index((k, AREA))
    return table


def shares_of(balance: Balance) -> Array:
    """Return each muscle's share in the springs of the coordinates, shape (n, m)."""
    squares = balance.moves**2
    return np.asarray(squares / squares.sum(axis=0))


def changed(balance: Balance, adapted: list[tuple[int, int]], changes: Array) -> Balance:
    """Return the balance with changed forces and factors."""
    n, m = balance.moves.shape
    table = np.zeros((len(KINDS), n))
    table[tuple(np.array(adapted).T[::-1])] = changes
    stiffened = 1.0 + shares_of(balance).T @ table[STIFFNESS]
    springs = np.array(balance.springs).reshape(m, -1, 1 + m)
    springs[:, :, 1:] *= np.sqrt(np.outer(stiffened, stiffened))[:, np.newaxis]
    springs[:, 0, 0] += balance.moves.T @ table[OFFSET]
    factors = 1.0 + table[:, :, np.newaxis]
    bladders = np.array(balance.bladders) * factors[STIFFNESS, : len(balance.bladders), 0]
    return replace(
        balance,
        springs=rows(springs.reshape(m, -1)),
        elasticity=rows(np.array(balance.elasticity) * factors[STIFFNESS]),
        areas=rows(np.array(balance.areas) * factors[AREA]),
        friction=rows(np.array(balance.friction) * factors[FRICTION]),
        relaxation=rows(np.array(balance.relaxation) * factors[RELAXATION]),
        bladders=vector(bladders),
    )


def ratios(balance: Balance, k: int) -> tuple[float, float]:
    """Return the bounds on friction over area, and on area over stiffness, as factors.

    At least 1: what was fitted may be. Springs of coordinates add what they have for all muscles
    whatever their factors: f w w' is at most f diag(w w'), times how many coordinates one moves.
    """
    u = np.linspace(balance.hull[k][0], balance.hull[k][1], GRID) / balance.scale
    area = np.polynomial.Polynomial(balance.areas[k])
    elasticity = np.polynomial.Polynomial([0.0, 0.0, *balance.elasticity[k]])
    rubbed = float(np.dot(balance.friction[k], np.array(balance.limits) + balance.walls[k]))
    left = float(area(u).min()) - LEAST_LEFT * balance.areas[k][0]
    moved, most = np.count_nonzero(balance.moves[k]), (balance.moves**2).sum(axis=0).max()
    own = softest_of(balance) / (moved * most) + (balance.bladders[k] if balance.bladders else 0.0)
    stiff = elasticity.deriv()(u) / balance.scale + own
    lost = top_of(balance) * area.deriv()(u) / balance.scale
    loses = lost > 0.0
    least = float(np.min(stiff[loses] / lost[loses], initial=NEVER))
    return max(left / rubbed, 1.0) if rubbed > 0.0 else NEVER, max(least, 1.0)


def softest_of(balance: Balance) -> float:
    """Return the smallest stiffness of the coordinates' springs over all scheduling inputs."""
    m, n_x = len(balance.driven), balance.n_schedules
    springs = np.array(balance.springs).reshape(m, -1, 1 + m)[:, :, 1:]
    ends, least = balance.known[:n_x] or n_x * ((0.0, 0.0),), np.inf
    for x in product(*(np.linspace(low, high, 3) for low, high in ends)):
        powers = [1.0, *(v**d for v in x for d in range(1, balance.degree + 1))]
        matrix = np.tensordot(np.array(powers), springs, (0, 1))
        least = min(least, float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0]))
    return max(least, 0.0)
