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


def regressors(x: Array, fired: Array, constants: bool) -> Array:
    """Return what consequents multiply, shape (n, rules * terms)."""
    terms = np.column_stack([x, np.ones(len(x))]) if constants else x
    return (fired[:, :, np.newaxis] * terms[:, np.newaxis, :]).reshape(len(x), -1)


def solve(columns: Array, y: Array, ridge: float) -> Array:
    """Return consequents by least squares with a little damping, shape (rules * terms, outputs)."""
    gram = columns.T @ columns
    size = np.maximum(np.diag(gram), 1e-9 * np.diag(gram).max())
    gram[np.diag_indices_from(gram)] += ridge * size + 1e-12 * size.max()
    return np.asarray(np.linalg.solve(gram, columns.T @ y), dtype=np.float64)


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
    problem = _Problem(x[keep], y[keep] / size, constants, ridge)
    start = Sets.even(low, high, n_sets)
    held = None if validation is None else (validation[0], validation[1] / size)
    search = _swarm if method == "pso" else _project
    sets = search(problem, start, low, scale, seed, held, tell)
    whole = regressors_in_parts(x, y, sets, constants, ridge)
    return Fitted(sets, whole)


def regressors_in_parts(x: Array, y: Array, sets: Sets, constants: bool, ridge: float) -> Array:
    """Return consequents by least squares on all samples, without a table of all regressors."""
    gram: Array | None = None
    right: Array | None = None
    for start in range(0, len(x), 8192):
        part = slice(start, start + 8192)
        columns = regressors(x[part], firing(memberships(x[part], sets)), constants)
        gram = columns.T @ columns + (0.0 if gram is None else gram)
        right = columns.T @ y[part] + (0.0 if right is None else right)
    assert gram is not None
    assert right is not None
    size = np.maximum(np.diag(gram), 1e-9 * np.diag(gram).max())
    gram[np.diag_indices_from(gram)] += ridge * size + 1e-12 * size.max()
    return np.asarray(np.linalg.solve(gram, right), dtype=np.float64)


@dataclass(frozen=True)
class _Problem:
    x: Array
    y: Array
    constants: bool
    ridge: float

    def cost(self, sets: Sets) -> float:
        columns = regressors(self.x, firing(memberships(self.x, sets)), self.constants)
        errors = columns @ solve(columns, self.y, self.ridge) - self.y
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
    columns = regressors(problem.x, firing(memberships(problem.x, sets)), problem.constants)
    fitted = Fitted(sets, solve(columns, problem.y, problem.ridge))
    x, y = validation
    thin = np.linspace(0, len(x) - 1, min(len(x), SEARCH_SAMPLES)).round().astype(int)
    errors = fitted.predict(x[thin], problem.constants) - y[thin]
    return float(np.sqrt(np.mean(errors**2)))


def _sensitivities(problem: _Problem, sets: Sets) -> tuple[Array, Array]:
    """Return the derivatives of the errors by centres and widths, projected, and the errors."""
    x, y = problem.x, problem.y
    n, n_in = x.shape
    n_sets, n_out = sets.centres.shape[1], y.shape[1]
    phi = memberships(x, sets)
    fired = firing(phi)
    columns = regressors(x, fired, problem.constants)
    consequents = solve(columns, y, problem.ridge)
    terms = np.column_stack([x, np.ones(n)]) if problem.constants else x
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
    projected = flat - columns @ solve(columns, flat, problem.ridge)
    jacobian = projected.reshape(n, n_out, -1).reshape(n * n_out, -1)
    return jacobian, (f - y).ravel()
