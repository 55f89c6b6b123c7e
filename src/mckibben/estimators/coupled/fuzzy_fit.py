"""Fitting a fuzzy network to tables: antecedents searched on some samples, consequents on all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.estimators.coupled.fuzzy import (
    Consequents,
    Fitted,
    Problem,
    Sets,
    firing,
    memberships,
    regressors,
)
from mckibben.estimators.coupled.fuzzy_projection import project
from mckibben.estimators.coupled.fuzzy_swarm import swarmed
from mckibben.estimators.coupled.swarm import Swarm
from mckibben.estimators.optimisers.tracker import Tracker

Method = Literal["ls", "pso"]


@dataclass(frozen=True)
class Search:
    """How antecedents are searched.

    Parameters
    ----------
    method : {"ls", "pso"}
        By variable projection, or by the paper's particle swarm.
    samples : int
        On how many samples, spread evenly.
    swarm : Swarm
        Of the particle swarm.
    seed : int
        Of the particle swarm.
    """

    method: Method
    samples: int
    swarm: Swarm
    seed: int


def fit_network(
    x: Array,
    y: Array,
    n_sets: int,
    solver: Consequents,
    search: Search,
    *,
    tracker: Tracker,
    validation: tuple[Array, Array] | None = None,
) -> Fitted:
    """Fit a network to inputs x (n, inputs) and outputs y (n, outputs).

    Variable projection keeps the step that does best on the validation data, if there are any.
    """
    problem = Problem(*thinned(x, y, search.samples), solver)
    if search.method == "pso":
        sets = swarmed(problem, n_sets, search.swarm, search.seed, tracker)
    else:
        held = None if validation is None else thinned(*validation, search.samples)
        sets = project(problem, n_sets, x.min(axis=0), x.max(axis=0), held, tracker)
    return Fitted(sets, solve_in_parts(x, y, sets, solver))


def thinned(x: Array, y: Array, most: int) -> tuple[Array, Array]:
    """Return at most so many samples, spread evenly."""
    keep = np.linspace(0, len(x) - 1, min(len(x), most)).round().astype(int)
    return x[keep], y[keep]


def solve_in_parts(x: Array, y: Array, sets: Sets, solver: Consequents) -> Array:
    """Return consequents by least squares on all samples, without a table of all regressors."""
    n_terms = x.shape[1] + solver.constants
    n = len(sets.centres[0]) ** x.shape[1] * n_terms
    gram, right = np.zeros((n, n)), np.zeros((n, y.shape[1]))
    for start in range(0, len(x), 8192):
        part = slice(start, start + 8192)
        columns = regressors(x[part], firing(memberships(x[part], sets)), solver.constants)
        gram += columns.T @ columns
        right += columns.T @ y[part]
    return solver.solve(gram, right, n_terms)
