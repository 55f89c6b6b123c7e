"""Fitting a fuzzy network to tables: the paper's particle swarm, and variable projection.

Consequents are linear and solved for by least squares, whatever the antecedents; only the centres and
widths of the sets are searched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Method = Literal["ls", "pso"]

SEARCH_SAMPLES = 6000
"""Samples on which antecedents are searched; consequents are solved for on all."""

NARROWEST, WIDEST = 0.15, 1.5
"""Widths of sets, relative to the range of their input."""

SWARM, ITERATIONS, ATTRACTION = 20, 50, 0.5
"""Particles, iterations and both attractions of the paper's swarm, Section 5.1; inertia 0.7."""

SWARM_INERTIA = 0.7

MOST_STEPS = 15
"""Of variable projection."""


@dataclass(frozen=True)
class Sets:
    """Centres and widths, shape (inputs, sets) each."""

    centres: Array
    widths: Array

    @classmethod
    def even(cls, low: Array, high: Array, n: int) -> Sets:
        """Return sets spread evenly over the range of every input."""
        span = high - low
        places = np.linspace(0.0, 1.0, n) if n > 1 else np.array([0.5])
        widths = np.repeat(span[:, np.newaxis] * 0.6 / max(n - 1, 1), n, axis=1)
        return cls(low[:, np.newaxis] + span[:, np.newaxis] * places, widths)

    @property
    def vector(self) -> Array:
        """All centres, then all widths."""
        return np.concatenate([self.centres.ravel(), self.widths.ravel()])

    def replaced(self, values: Array) -> Sets:
        """Return sets of the same shape from `vector`."""
        n = self.centres.size
        shape = self.centres.shape
        return Sets(values[:n].reshape(shape), values[n:].reshape(shape))


def memberships(x: Array, sets: Sets) -> Array:
    """Return memberships normalised input by input, shape (n, inputs, sets)."""
    z = (x[:, :, np.newaxis] - sets.centres) / sets.widths
    exponent = -0.5 * z**2
    exponent -= exponent.max(axis=2, keepdims=True)
    fired = np.exp(exponent)
    normalised: Array = fired / fired.sum(axis=2, keepdims=True)
    return normalised


def firing(phi: Array) -> Array:
    """Return the normalised firing of every rule, the last input's set running fastest."""
    fired = phi[:, 0]
    for i in range(1, phi.shape[1]):
        fired = (fired[:, :, np.newaxis] * phi[:, i, np.newaxis, :]).reshape(len(phi), -1)
    return fired


def linear_terms(x: Array, constants: bool) -> Array:
    """Return what a consequent multiplies: the inputs, and one where there are constants."""
    return np.column_stack([x, np.ones(len(x))]) if constants else x


def regressors(x: Array, fired: Array, constants: bool) -> Array:
    """Return what all consequents multiply, shape (n, rules * terms)."""
    terms = linear_terms(x, constants)
    return (fired[:, :, np.newaxis] * terms[:, np.newaxis, :]).reshape(len(x), -1)


@dataclass(frozen=True)
class Consequents:
    """How consequents are solved for.

    A rule's consequent is what all rules have in common plus a deviation of its own, and deviations are
    damped: where the data say nothing, the network is then nearly linear rather than anything at all,
    and can be inverted.
    """

    constants: bool
    ridge: float

    def solve(self, gram: Array, right: Array, n_terms: int) -> Array:
        """Return consequents from normal equations, shape (rules * terms, outputs)."""
        n_rules = len(gram) // n_terms
        common = np.tile(np.eye(n_terms), (n_rules, 1))
        parts = np.hstack([common, np.eye(len(gram))])
        whole = parts.T @ gram @ parts
        size = np.diag(whole)[:n_terms]
        damping = np.concatenate([np.zeros(n_terms), np.tile(self.ridge * size, n_rules)])
        whole[np.diag_indices_from(whole)] += damping + 1e-11 * size.max()
        return np.asarray(parts @ np.linalg.solve(whole, parts.T @ right), dtype=np.float64)

    def fit(self, x: Array, columns: Array, y: Array) -> Array:
        """Return consequents by damped least squares, shape (rules * terms, outputs)."""
        n_terms = x.shape[1] + self.constants
        return self.solve(columns.T @ columns, columns.T @ y, n_terms)


@dataclass(frozen=True)
class Fitted:
    """Antecedents and consequents, (rules * terms, outputs)."""

    sets: Sets
    consequents: Array

    def predict(self, x: Array, constants: bool) -> Array:
        """Return the outputs."""
        columns = regressors(x, firing(memberships(x, self.sets)), constants)
        result: Array = columns @ self.consequents
        return result


def fit_network(
    x: Array,
    y: Array,
    n_sets: int,
    *,
    constants: bool,
    method: Method,
    ridge: float,
    seed: int,
    validation: tuple[Array, Array] | None = None,
    tell: Callable[[float], None] = lambda share: None,
) -> Fitted:
    """Fit a network to inputs x (n, inputs) and outputs y (n, outputs)."""
    scale = np.maximum(x.max(axis=0) - x.min(axis=0), 1e-9)
    low, high = x.min(axis=0), x.min(axis=0) + scale
    keep = np.linspace(0, len(x) - 1, min(len(x), SEARCH_SAMPLES)).round().astype(int)
    size = y.std(axis=0) + 1e-12
    solver = Consequents(constants, ridge)
    problem = _Problem(x[keep], y[keep] / size, solver)
    start = Sets.even(low, high, n_sets)
    held = None if validation is None else (validation[0], validation[1] / size)
    search = _swarm if method == "pso" else _project
    sets = search(problem, start, low, scale, seed, held, tell)
    return Fitted(sets, solve_in_parts(x, y, sets, solver))


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


@dataclass(frozen=True)
class _Problem:
    x: Array
    y: Array
    solver: Consequents

    def cost(self, sets: Sets) -> float:
        columns = regressors(self.x, firing(memberships(self.x, sets)), self.solver.constants)
        errors = columns @ self.solver.fit(self.x, columns, self.y) - self.y
        return float(np.sqrt(np.mean(errors**2)))


def _limits(start: Sets, low: Array, scale: Array) -> tuple[Array, Array]:
    n = start.centres.shape[1]
    lowest = np.repeat((low - 0.2 * scale)[:, np.newaxis], n, axis=1)
    highest = np.repeat((low + 1.2 * scale)[:, np.newaxis], n, axis=1)
    wide = np.repeat(scale[:, np.newaxis], n, axis=1)
    return (
        np.concatenate([lowest.ravel(), NARROWEST * wide.ravel()]),
        np.concatenate([highest.ravel(), WIDEST * wide.ravel()]),
    )


def _swarm(
    problem: _Problem,
    start: Sets,
    low: Array,
    scale: Array,
    seed: int,
    validation: tuple[Array, Array] | None,
    tell: Callable[[float], None],
) -> Sets:
    """Return the best antecedents of a particle swarm, as the paper searches them."""
    del validation
    rng = np.random.default_rng(seed)
    lower, upper = _limits(start, low, scale)
    places = rng.uniform(lower, upper, (SWARM, lower.size))
    speeds = np.zeros_like(places)
    own, costs = places.copy(), np.array([problem.cost(start.replaced(p)) for p in places])
    for iteration in range(ITERATIONS):
        best = own[np.argmin(costs)]
        pull = rng.uniform(size=(2, *places.shape))
        speeds = (
            SWARM_INERTIA * speeds
            + ATTRACTION * pull[0] * (own - places)
            + ATTRACTION * pull[1] * (best - places)
        )
        places = np.clip(places + speeds, lower, upper)
        for k, place in enumerate(places):
            cost = problem.cost(start.replaced(place))
            if cost < costs[k]:
                own[k], costs[k] = place, cost
        tell((iteration + 1) / ITERATIONS)
    return start.replaced(own[np.argmin(costs)])


def _project(
    problem: _Problem,
    start: Sets,
    low: Array,
    scale: Array,
    seed: int,
    validation: tuple[Array, Array] | None,
    tell: Callable[[float], None],
) -> Sets:
    """Return antecedents by variable projection (Kaufman's), Levenberg-Marquardt from even sets.

    Among the steps taken, the one that does best on the validation data is kept.
    """
    del seed
    lower, upper = _limits(start, low, scale)
    unit = np.concatenate([np.repeat(scale, start.centres.shape[1])] * 2)
    theta, damping = start.vector, 1e-2
    cost = problem.cost(start)
    kept, least = start, _held(problem, start, validation, cost)
    for step in range(MOST_STEPS):
        sets = start.replaced(theta)
        jacobian, residual = _sensitivities(problem, sets)
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
    problem: _Problem, sets: Sets, validation: tuple[Array, Array] | None, cost: float
) -> float:
    if validation is None:
        return cost
    columns = regressors(problem.x, firing(memberships(problem.x, sets)), problem.solver.constants)
    fitted = Fitted(sets, problem.solver.fit(problem.x, columns, problem.y))
    x, y = validation
    thin = np.linspace(0, len(x) - 1, min(len(x), SEARCH_SAMPLES)).round().astype(int)
    errors = fitted.predict(x[thin], problem.solver.constants) - y[thin]
    return float(np.sqrt(np.mean(errors**2)))


def _sensitivities(problem: _Problem, sets: Sets) -> tuple[Array, Array]:
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
