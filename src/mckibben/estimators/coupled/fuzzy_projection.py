"""Antecedents of a fuzzy network by variable projection.

Kaufman's form, with Levenberg-Marquardt steps from even sets.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mckibben.estimators.coupled.fuzzy import (
    Fitted,
    Problem,
    Sets,
    firing,
    linear_terms,
    memberships,
    regressors,
)

Array = NDArray[np.float64]

NARROWEST, WIDEST = 0.15, 1.5
"""Widths of sets, relative to the range of their input."""

MOST_STEPS = 15


def project(
    problem: Problem,
    n_sets: int,
    low: Array,
    high: Array,
    validation: tuple[Array, Array] | None,
    tell: Callable[[float], None],
) -> Sets:
    """Return antecedents found from sets spread evenly between low and high, (inputs,) each.

    Among the steps taken, the one that does best on the validation data is kept.
    """
    scale = np.maximum(high - low, 1e-9)
    start = Sets.even(low, low + scale, n_sets)
    if n_sets == 1:  # it fires alone, wherever it is
        return start
    lower, upper = _limits(start, low, scale)
    unit = np.concatenate([np.repeat(scale, start.centres.shape[1])] * 2)
    theta, damping = start.vector, 1e-2
    cost = problem.cost(start)
    kept, least = start, _held(problem, start, validation, cost)
    for step in range(MOST_STEPS):
        sets = start.replaced(theta)
        jacobian, residual = sensitivities(problem, sets)
        jacobian = jacobian * unit
        gram, slope = jacobian.T @ jacobian, jacobian.T @ residual
        improved = False
        for _ in range(6):
            damped = gram + damping * np.diag(np.diag(gram) + 1e-9 * np.trace(gram))
            move = -np.linalg.solve(damped, slope) * unit
            trial = np.clip(theta + move, lower, upper)
            trial_cost = problem.cost(start.replaced(trial))
            if trial_cost < cost:
                improved = cost - trial_cost > 1e-4 * cost
                theta, cost, damping = trial, trial_cost, damping / 5
                break
            damping *= 5
        found = start.replaced(theta)
        held = _held(problem, found, validation, cost)
        if held < least:
            kept, least = found, held
        tell((step + 1) / MOST_STEPS)
        if not improved:
            break
    return kept


def _held(
    problem: Problem, sets: Sets, validation: tuple[Array, Array] | None, cost: float
) -> float:
    if validation is None:
        return cost
    columns = regressors(problem.x, firing(memberships(problem.x, sets)), problem.solver.constants)
    fitted = Fitted(sets, problem.solver.fit(problem.x, columns, problem.y))
    x, y = validation
    errors = fitted.predict(x, problem.solver.constants) - y
    return float(np.sqrt(np.mean(errors**2)))


def sensitivities(problem: Problem, sets: Sets) -> tuple[Array, Array]:
    """Return the derivatives of the errors by centres and widths, projected, and the errors."""
    x, y = problem.x, problem.y
    n, n_in = x.shape
    n_sets, n_out = sets.centres.shape[1], y.shape[1]
    phi = memberships(x, sets)
    fired = firing(phi)
    columns = regressors(x, fired, problem.solver.constants)
    consequents = problem.solver.fit(x, columns, y)
    terms = linear_terms(x, problem.solver.constants)
    answers = np.einsum("nt,rto->nro", terms, consequents.reshape(-1, terms.shape[1], n_out))
    weighted = answers * fired[:, :, np.newaxis]
    f = weighted.sum(axis=1)
    grid = weighted.reshape(n, *[n_sets] * n_in, n_out)
    derivative = np.empty((n, n_out, 2, n_in, n_sets))
    for i in range(n_in):
        axes = tuple(1 + k for k in range(n_in) if k != i)
        own = grid.sum(axis=axes)  # (n, sets, outputs): what fires through each set of this input
        change = own - phi[:, i, :, np.newaxis] * f[:, np.newaxis, :]
        away = x[:, i, np.newaxis] - sets.centres[i]
        by_centre = away / sets.widths[i] ** 2
        by_width = away**2 / sets.widths[i] ** 3
        derivative[:, :, 0, i] = np.moveaxis(change * by_centre[:, :, np.newaxis], 2, 1)
        derivative[:, :, 1, i] = np.moveaxis(change * by_width[:, :, np.newaxis], 2, 1)
    table = derivative.reshape(n, n_out, -1)
    # what consequents can take up is projected out
    flat = table.reshape(n, -1)
    projected = flat - columns @ problem.solver.fit(x, columns, flat)
    jacobian = projected.reshape(n, n_out, -1).reshape(n * n_out, -1)
    return jacobian, (f - y).ravel()


def _limits(start: Sets, low: Array, scale: Array) -> tuple[Array, Array]:
    n = start.centres.shape[1]
    lowest = np.repeat((low - 0.2 * scale)[:, np.newaxis], n, axis=1)
    highest = np.repeat((low + 1.2 * scale)[:, np.newaxis], n, axis=1)
    wide = np.repeat(scale[:, np.newaxis], n, axis=1)
    return (
        np.concatenate([lowest.ravel(), NARROWEST * wide.ravel()]),
        np.concatenate([highest.ravel(), WIDEST * wide.ravel()]),
    )
