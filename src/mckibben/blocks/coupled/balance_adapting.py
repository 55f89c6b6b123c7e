"""How a balance of forces follows what is measured, and stays one that it can be.

Of every muscle a constant force and four factors are learnt: on its springs and elasticity, its area,
its friction, and what relaxes. Springs that couple two are scaled by the root of both factors, so
that they stay symmetric and positive. The residual is linear in all of this. A displacement follows by

    dy / dtheta = -(dR / dy)^-1 dR / dtheta,

stops and lags left out of dR / dy: a change that stays moves a motion as a whole, and its stops with it.

Stops and lags are displacements of the muscle, which the reference gives, so that memory is carried over
as it is. Factors keep to bounds within which areas outweigh friction, and stiffness what areas lose.
"""

from __future__ import annotations

import math

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance_law import (
    OWN,
    area,
    start_balance,
)
from mckibben.blocks.coupled.balance_law import inverse_step as press
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.learning import (
    SENSES,
    family_at,
    learn,
    root_size,
    start_learning,
    trusted,
)
from mckibben.blocks.solving import eliminate

KINDS = 5
OFFSET, STIFFNESS, AREA, FRICTION, RELAXATION = range(KINDS)
"""What is learnt of a muscle; a parameter is named by its muscle times `KINDS`, plus this."""

LEAST_FACTOR, MOST_FACTOR = 0.5, 2.0
"""Of what was fitted."""

MOST_FORCE = 0.3
"""Constant force, relative to its scale."""

HAIR = 1e-9
"""Slack that is none, relative to the scale."""

SINGLE = {"HAIR": 1e-6}


@step
def balance_adaptive_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Learn, and give pressures.

    The family's coefficients are [n, which parameters, bounds of `keep_balanced`, the balance's]. The
    state is [the balance's, displacements, pressures and what scheduled of the last sample, what is
    learnt]; scratch is [work of learning, slopes and matrices, coefficients now, a balance's].
    """
    learner, family = coefficients, coefficients[family_at(coefficients) :]
    size, n = int(learner[0]), int(family[0])
    which, bounds = family[1 : 1 + size], family[1 + size : 1 + size + 2 * n]
    fitted = family[1 + size + 2 * n :]
    scales, widest = learner[4 : 4 + size], learner[4 + size : 4 + 2 * size]
    fresh = learner[4 + 3 * size : family_at(learner)]
    n_x = int(fitted[1]) + int(fitted[3])
    n_learnt = 2 * size + fresh.size + SENSES * n
    n_own = state.size - n_learnt - 2 * n - n_x
    own, was = state[:n_own], state[n_own : state.size - n_learnt]
    learnt = state[state.size - n_learnt :]
    y, p, x = was[:n], was[n : 2 * n], was[2 * n :]
    tare = own[n_own - 2 - n :]
    theta, used = learnt[:size], learnt[size : 2 * size]
    root, senses = learnt[2 * size : 2 * size + fresh.size], learnt[2 * size + fresh.size :]
    work, slopes, rest = scratch[: 2 * size], scratch[2 * size : 3 * size], scratch[3 * size :]
    terms = rest[: n * size].reshape((n, size))
    matrix = rest[n * size : n * size + n * n].reshape((n, n))
    row = rest[n * size + n * n : n * size + 2 * n * n + n]
    c = rest[n * size + 2 * n * n + n : n * size + 2 * n * n + n + fitted.size]
    room = rest[n * size + 2 * n * n + n + fitted.size :]
    for i in range(fitted.size):
        c[i] = fitted[i]
    retune(fitted, which, used, c)
    slopes_of(c, own, which, used, y, p, x, terms, matrix, row)
    taught = False
    for k in range(n):
        answer(terms, matrix, n, k, row, slopes)
        asked = y[k] - tare[k]
        believed, expected = asked, asked
        for i in range(size):
            believed += slopes[i] * (theta[i] - used[i])
            expected += slopes[i] * (as_fitted(which, i) - used[i])
        measured = inputs[n + n_x + k]
        one = learn(learner, learnt, k, slopes, work, measured, believed, asked, expected)
        taught = taught or one
    if taught:
        pull_back(learner[1], which, scales, widest, root, theta, slopes, work)
        keep_balanced(which, bounds, scales, root, theta, slopes, work)
        share = trusted(senses)
        for i in range(size):
            used[i] = as_fitted(which, i) + share * (theta[i] - as_fitted(which, i))
        retune(fitted, which, used, c)
    press(c, own, room, inputs, outputs)
    for k in range(n):
        y[k], p[k] = room[k], outputs[k]
    for i in range(n_x):
        x[i] = inputs[n + i]


@kernel
def balance_adaptive_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start as the balance does, with the parameters as fitted."""
    family = coefficients[family_at(coefficients) :]
    size, n = int(coefficients[0]), int(family[0])
    n_more = inputs.size  # displacements, pressures and what schedules, of the last sample
    n_own = state.size - 2 * size - root_size(size) - SENSES * n - n_more
    start_balance(family[1 + size + 2 * n :], state[:n_own], scratch, inputs, virgin)
    state[n_own : n_own + n_more] = 0.0
    start_learning(coefficients, state[n_own + n_more :])


@kernel
def as_fitted(which: Array, i: int) -> float:
    """Return parameter i as it was fitted."""
    return 0.0 if int(which[i]) % KINDS == OFFSET else 1.0


@kernel
def retune(fitted: Array, which: Array, theta: Array, c: Array) -> None:
    """Make the coefficients what they are with some parameters."""
    n, n_powers, n_e, n_a = int(c[0]), 1 + int(c[1]) * int(c[2]), int(c[6]), int(c[7])
    first, width = muscles(c), muscle_width(c)
    for i in range(first, first + n * width):
        c[i] = fitted[i]
    for i in range(which.size):
        k, kind = int(which[i]) // KINDS, int(which[i]) % KINDS
        factor = theta[i]
        springs = first + k * width + OWN
        elasticity = springs + n_powers * (1 + n)
        friction = elasticity + n_e + n_a
        relaxation = friction + int(c[4])
        if kind == OFFSET:
            c[springs] += factor
        elif kind == STIFFNESS:
            c[springs - OWN + 6] *= factor
            shared = math.sqrt(factor)
            for q in range(n_powers):
                for j in range(n):
                    c[springs + q * (1 + n) + 1 + j] *= shared
                    c[first + j * width + OWN + q * (1 + n) + 1 + k] *= shared
            for j in range(elasticity, elasticity + n_e):
                c[j] *= factor
        elif kind == AREA:
            for j in range(elasticity + n_e, friction):
                c[j] *= factor
        elif kind == FRICTION:
            for j in range(friction, relaxation):
                c[j] *= factor
        else:
            for j in range(relaxation, relaxation + int(c[5])):
                c[j] *= factor


@kernel
def slopes_of(
    c: Array,
    state: Array,
    which: Array,
    theta: Array,
    y: Array,
    p: Array,
    x: Array,
    terms: Array,
    matrix: Array,
    gradient: Array,
) -> None:
    """Fill what the residuals change by with parameters, and with displacements where stops go along.

    Shapes (n, parameters) and (n, n); ``gradient`` has n numbers to compute in.
    """
    n, m, n_l = int(c[0]), int(c[4]), int(c[5])
    for k in range(n):
        own = muscles(c) + k * muscle_width(c)
        sprung(c, own, k, y, x, gradient[:n])
        pulled = 0.0
        for j in range(n):
            matrix[k, j] = gradient[j]
            pulled += gradient[j] * y[j]
        taut = y[k] - state[k] <= HAIR * c[8]
        held, stiff = elastic(c, own, y[k])
        a, a_slope = area(c, own, y[k])
        if taut:
            matrix[k, k] += stiff - p[k] * a_slope
        relaxation = own + muscle_width(c) - int(c[3]) - n_l
        for i in range(which.size):
            muscle, kind = int(which[i]) // KINDS, int(which[i]) % KINDS
            force = 0.0
            if kind == STIFFNESS:
                force = 0.5 * gradient[muscle] * y[muscle]
            if muscle == k:
                if kind == OFFSET:
                    force = 1.0
                elif kind == STIFFNESS:
                    force += 0.5 * pulled + (held if taut else 0.0)
                elif kind == AREA and taut:
                    force = -p[k] * a
                elif kind == FRICTION and taut:
                    for q in range(m):
                        force += c[relaxation - m + q] * state[2 * n + k * m + q]
                elif kind == RELAXATION and taut:
                    for q in range(n_l):
                        force += c[relaxation + q] * state[2 * n + n * m + k * n_l + q]
            terms[k, i] = force if kind == OFFSET else force / theta[i]


@kernel
def answer(terms: Array, matrix: Array, n: int, k: int, row: Array, slopes: Array) -> None:
    """Fill the slopes of displacement k by the parameters; ``row`` has n n + n numbers."""
    right = row[:n]
    left = row[n : n + n * n].reshape((n, n))
    for i in range(n):
        right[i] = -1.0 if i == k else 0.0
        for j in range(n):
            left[i, j] = matrix[i, j]
    eliminate(left, right)
    for i in range(slopes.size):
        slopes[i] = 0.0
        for j in range(n):
            slopes[i] += right[j] * terms[j, i]


@kernel
def pull_back(
    share: float,
    which: Array,
    scales: Array,
    widest: Array,
    root: Array,
    theta: Array,
    along: Array,
    work: Array,
) -> None:
    """Bring what measurements do not tell back to what was fitted, in the time to learn in.

    It is weighed as if the fit were measured too: by the covariance, over the widest.
    """
    p = theta.size
    for i in range(p):
        work[i] = share * (as_fitted(which, i) - theta[i]) / (scales[i] * widest[i])
    covariant(root, work, along)
    for i in range(p):
        theta[i] += scales[i] * along[i]


@kernel
def covariant(root: Array, vector: Array, product: Array) -> None:
    """Multiply by the covariance U D U'."""
    p = product.size
    first = p + (p * (p - 1)) // 2
    for j in range(p - 1, -1, -1):
        first -= j
        total = vector[j]
        for i in range(j):
            total += root[first + i] * vector[i]
        product[j] = root[j] * total
    first = p
    for j in range(p):
        for i in range(j):
            product[i] += root[first + i] * product[j]
        first += j


@kernel
def keep_balanced(
    which: Array,
    bounds: Array,
    scales: Array,
    root: Array,
    theta: Array,
    along: Array,
    work: Array,
) -> None:
    """Bring parameters into what a balance can have.

    ``bounds`` has for every muscle the most friction by area, and the most area by stiffness. What is
    changed takes the others along as they are known to go together, which may not be possible twice.
    """
    for turn in range(2):
        for i in range(which.size):
            lacks = short_of(which, bounds, scales, theta, i)
            if lacks == 0.0:
                continue
            if turn > 0:
                theta[i] += lacks
                continue
            for j in range(which.size):
                work[j] = 1.0 if j == i else 0.0
            covariant(root, work, along)
            for j in range(which.size):
                theta[j] += lacks * scales[j] / scales[i] * along[j] / along[i]


@kernel
def short_of(which: Array, bounds: Array, scales: Array, theta: Array, i: int) -> float:
    """Return how far parameter i is short of what a balance can have."""
    k, kind = int(which[i]) // KINDS, int(which[i]) % KINDS
    low, high = LEAST_FACTOR, MOST_FACTOR
    if kind == OFFSET:
        high = MOST_FORCE * scales[i]
        low = -high
    elif kind != AREA:
        area_factor = 1.0
        for j in range(which.size):
            if int(which[j]) == k * KINDS + AREA:
                area_factor = theta[j]
        if kind == STIFFNESS:
            low = max(low, area_factor / bounds[2 * k + 1])
        elif kind == FRICTION:
            high = min(high, area_factor * bounds[2 * k])
    return min(max(theta[i], low), high) - theta[i]
