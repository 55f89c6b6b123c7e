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
from collections.abc import Callable

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance_bounds import places_of, ratios
from mckibben.blocks.coupled.balance_law import (
    coordinate_at,
    coupling_force,
    muscle_at,
    muscle_force,
    shortening,
    spring_row,
    terms_at,
    update_state,
)
from mckibben.blocks.coupled.balance_solving import give_pressures, start_balance
from mckibben.blocks.coupled.balance_terms import NEVER
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

(FACTOR_OF, FIRST, BEHIND, FORCE, LOW, HIGH, AREA_LOW, AREA_HIGH, BY_AREA, ROW) = range(10)
"""Numbers of a parameter: its muscle, the first of the terms that it is a factor on and the first
behind, the constant force of the muscle that it adds, its ends, the same by the factor on the area, and
the place of that factor among parameters, or -1; then its share in the springs of every coordinate."""


@step
def balance_adaptive_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Adapt parameters, and compute pressures.

    The family's coefficients are [coordinates, a row for every parameter, the balance's]. The state is
    [the balance's, coordinates of the last sample, their slopes by parameters, what is adapted]; scratch
    is [work of learning, coefficients now, factors on springs, a balance's, that of `slopes_of`].
    """
    learner, size, begin = coefficients, int(coefficients[0]), family_at(coefficients) + 1
    m, n_own = int(learner[begin - 1]), own_states(learner, state)
    rows_end = begin + (ROW + m) * size
    family, fitted = learner[begin:rows_end].reshape((size, ROW + m)), learner[rows_end:]
    n_x = int(fitted[at.N_SCHEDULES]) + int(fitted[at.N_LOADS])
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
        asked[j] = q[j] - memory[int(c[at.TARE]) + j]
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
    size, n_own, begin = (
        int(coefficients[0]),
        own_states(coefficients, state),
        family_at(coefficients),
    )
    m = int(coefficients[begin])
    fitted = coefficients[begin + 1 + (ROW + m) * size :]
    start_balance(fitted, state[:n_own], scratch, inputs, virgin)
    state[n_own : n_own + m + m * size] = 0.0
    start_learning(coefficients, state[n_own + m + m * size :])


@kernel
def retune(fitted: Array, family: Array, changes: Array, c: Array, g: Array) -> None:
    """Set the coefficients from parameter changes, and the factors on springs of coordinates."""
    fill(c, fitted)
    m, n_powers = int(c[at.N_COORDINATES]), 1 + int(c[at.N_SCHEDULES]) * int(c[at.DEGREE])
    g[:] = 1.0
    for i in range(changes.size):
        k, change = int(family[i, FACTOR_OF]), changes[i]
        own, ways = terms_at(c, k), muscle_at(c, k) + at.WAYS
        for t in range(own + int(family[i, FIRST]), own + int(family[i, BEHIND])):
            c[t] += change * fitted[t]
        for j in range(m):
            c[coordinate_at(c, j)] += change * family[i, FORCE] * c[ways + j]
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
    m, width = int(c[at.N_COORDINATES]), int(c[at.N_TERMS])
    size, square = slopes.size // m, m * m
    forces, rest = work[: slopes.size].reshape((m, size)), work[slopes.size :]
    matrix, left = rest[:square].reshape((m, m)), rest[square : 2 * square].reshape((m, m))
    row, terms = rest[2 * square :], rest[2 * square + m :]
    for j in range(m):
        spring_row(c, j, x, row)
        for i in range(size):
            forces[j, i] = 0.0
            for to in range(m):
                both = family[i, ROW + j] / g[j] + family[i, ROW + to] / g[to]
                forces[j, i] += 0.5 * both * row[to] * q[to]
        coupling_force(c, j, q, x, matrix[j])
    for k in range(int(c[at.N_MUSCLES])):
        w, own, slope = muscle_at(c, k) + at.WAYS, terms_at(c, k), 0.0
        muscle_force(c, k, state, way, shortening(c, k, q), p[k], x, terms)
        for t in range(at.BLADDER, int(c[at.STOP])):
            slope += c[own + t] * terms[width + t]
        for i in range(size):
            if int(family[i, FACTOR_OF]) == k:
                force = family[i, FORCE]
                for t in range(int(family[i, FIRST]), int(family[i, BEHIND])):
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
            by, area = int(family[i, BY_AREA]), 1.0
            if by >= 0:
                area = min(max(adapted[by], family[by, LOW]), family[by, HIGH])
            low = max(family[i, LOW], area * family[i, AREA_LOW])
            high = min(family[i, HIGH], area * family[i, AREA_HIGH])
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


# -- the parameters of a balance -------------------------------------------------------------------

KINDS = range(5)
OFFSET, STIFFNESS, AREA, FRICTION, RELAXATION = KINDS
"""Adaptive parameters of a muscle; an added force reduces its pull."""

FACTORS = 0.5, 2.0
"""Smallest and largest factor on fitted values."""

MOST_FORCE = 0.3
"""Largest constant force, relative to its scale."""


def learnable_balance(
    coefficients: Callable[[float | None], Array],
    inverse_with: Callable[[Array], Inverse],
    *,
    known: Array,
    scheduled: Array,
) -> Learnable:
    """Return the adaptive parameters of a balance: factors of 1, and forces of 0.

    Factors are expected to change by 30 %, forces by 10 % of that of the highest pressure at rest.

    Parameters
    ----------
    coefficients : callable
        Returns the coefficients of the balance, given the sample time.
    inverse_with : callable
        Returns the inverse of the balance with other coefficients.
    known, scheduled : array, shapes (m, 2), (s, 2)
        Lowest and highest of the coordinates, and of what schedules.
    """
    c = coefficients(1.0)
    m, adapted, places = int(c[at.N_COORDINATES]), adaptable_in(c), places_of(c)
    muscles, kinds = np.array(adapted).T
    offsets, at_rest = kinds == OFFSET, c[places["areas"]][muscles, 0] * c[at.TOP]
    fitted, scales = np.where(offsets, 0.0, 1.0), np.where(offsets, at_rest, 1.0)
    table = family_of(c, adapted, scales, scheduled)

    def with_parameters(theta: Array) -> Inverse:
        changed = np.empty_like(c)
        retune(c, table, theta - fitted, changed, np.empty(m))
        return inverse_with(changed)

    def numbers(sample_time: float | None) -> Array:
        return np.concatenate([[m], table.ravel(), coefficients(sample_time)])

    return Learnable(
        balance_adaptive_step,
        balance_adaptive_start,
        fitted=fitted,
        scales=scales,
        spread=np.diag(np.where(offsets, 0.1, 0.3) ** 2),
        with_parameters=with_parameters,
        numbers=numbers,
        known=known,
        compensates=True,
        n_more_states=m + m * fitted.size,
        n_more_scratch=m * fitted.size + 2 * m * m + 2 * m + c.size,
    )


def adaptable_in(c: Array) -> list[tuple[int, int]]:
    """Return muscle and kind of every adaptive parameter, of a balance's coefficients."""
    places, adaptable = places_of(c), list[tuple[int, int]]()
    for k in range(int(c[at.N_MUSCLES])):
        lasting = (bool(c[places[name][k]].any()) for name in ("friction", "relaxation"))
        is_there = (True, True, k > 0 or c[at.N_LOADS] > 0, *lasting)
        adaptable += [(k, kind) for kind in KINDS if is_there[kind]]
    return adaptable


def family_of(c: Array, adapted: list[tuple[int, int]], scales: Array, scheduled: Array) -> Array:
    """Return a row per parameter, shape (k, `ROW` + m)."""
    ends = at.ELASTIC, *c[at.AREA : at.N_TERMS + 1]
    ways = c[places_of(c)["directions"]] ** 2
    table = np.zeros((len(adapted), ROW + int(c[at.N_COORDINATES])))
    for row, (k, kind), scale in zip(table, adapted, scales, strict=True):
        friction, stiffness = ratios(c, k, scheduled)
        row[FACTOR_OF], row[LOW:ROW] = k, (*FACTORS, -NEVER, NEVER, -1)
        if kind == OFFSET:
            row[FORCE], row[LOW : HIGH + 1] = 1.0, (-MOST_FORCE * scale, MOST_FORCE * scale)
            continue
        row[FIRST : BEHIND + 1] = ends[kind - 1 : kind + 1]
        if kind == STIFFNESS:  # with the muscle's own spring, and its share in those of coordinates
            row[FIRST], row[AREA_LOW] = at.BLADDER, 1.0 / stiffness
            row[ROW:] = (ways / ways.sum(axis=0))[k]
        elif kind == FRICTION:
            row[AREA_HIGH] = friction
        if kind in (STIFFNESS, FRICTION) and (k, AREA) in adapted:
            row[BY_AREA] = adapted.index((k, AREA))
    return table
