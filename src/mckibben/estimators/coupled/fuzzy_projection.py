"""Antecedents of a fuzzy network by variable projection.

Kaufman's form, by a trust region from even sets.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.estimators.coupled.fuzzy import (
    Problem,
    Sets,
    firing,
    linear_terms,
    memberships,
    regressors,
)
from mckibben.estimators.optimisers.multi_start import trust_region
from mckibben.estimators.optimisers.tracker import Tracker

NARROWEST, WIDEST = 0.15, 1.5
"""Widths of sets, relative to the range of their input."""

MOST_STEPS = 15

HELD = 1e-3
"""How strongly sets stay where they start, relative to the error there, if errors hardly change."""

LEAST_GAIN = 2e-4
"""Share of the squared error that a step has to gain for another to follow."""


def project(
    problem: Problem,
    n_sets: int,
    low: Array,
    high: Array,
    validation: tuple[Array, Array] | None,
    tracker: Tracker,
) -> Sets:
    """Return antecedents found from sets spread evenly between low and high, (inputs,) each.

    Among the steps taken, the one that does best on the validation data is kept.
    """
    scale = np.where(high > low, high - low, 1.0)
    start = Sets.even(low, low + scale, n_sets)
    if n_sets == 1:  # it fires alone, wherever it is
        return start
    lower, upper = _limits(start, low, scale)
    unit = np.concatenate([np.repeat(scale, start.centres.shape[1])] * 2)

    held = HELD * float(np.linalg.norm(problem.errors(start))) / unit

    def errors(theta: Array) -> Array:
        left = problem.errors(start.replaced(theta)).ravel()
        return np.append(left, held * (theta - start.vector))

    def slopes(theta: Array) -> Array:
        sets = start.replaced(theta)
        by_theta, left = sensitivities(problem, sets)
        cost = float(np.sqrt(np.mean(left**2)))
        if validation is not None:
            cost = _held(problem, sets, *validation)
        tracker.saw(theta, cost)
        return np.vstack([by_theta, np.diag(held)])

    tracker.budget = MOST_STEPS + 1
    with tracker.searching():
        trust_region(
            errors,
            slopes,
            start.vector,
            scale=unit,
            bounds=(lower, upper),
            least_gain=LEAST_GAIN,
            max_evaluations=MOST_STEPS + 1,
        )
    return start if tracker.best is None else start.replaced(tracker.best)


def _held(problem: Problem, sets: Sets, x: Array, y: Array) -> float:
    """Return the RMSE on data held back."""
    errors = problem.fitted(sets).predict(x, problem.solver.constants) - y
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
