"""Identification of fuzzy networks: antecedents by search, consequents by least squares.

Consequents are linear and solved for by least squares, whatever the antecedents; only the centres and
widths of the sets are searched: by variable projection (Kaufman's form, with Levenberg-Marquardt steps
from even sets), or by the particle swarm of "Modeling and Compensation of Stiffness-Dependent Hysteresis
Coupling Behavior for Parallel Pneumatic Artificial Muscle-Driven Soft Manipulator", Algorithm 1. There
centres and widths start from N(0, 1), in the inputs' own units; the consequents' printed start is of no
effect, and the inertia is not printed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork
from mckibben.blocks.fields import Channels, rows, vector
from mckibben.numerics.descent import trust_region
from mckibben.numerics.statistics import rms
from mckibben.numerics.swarm import Swarm, particle_swarm
from mckibben.numerics.tracker import Tracker

LIGHTEST = 1e-11
"""Smallest ridge of a consequent, relative to its regressor."""

NARROWEST, WIDEST = 0.15, 1.5
"""Widths of sets, relative to the range of their input."""

STAYING = 1e-3
"""Weight that holds sets near their start, relative to the error there."""

MOST_STEPS = 15
"""Maximum number of steps of variable projection."""

LEAST_GAIN = 2e-4
"""Smallest relative reduction of the squared error for another step."""

ATTRACTION, INERTIA = 0.5, 0.7
"""Particle swarm: c_1 and c_2 as printed, and the inertia."""

LEAST_WIDTH = 1e-3
"""Smallest width of a set in the swarm; its sign has no meaning, as only its square is used."""

PART = 8192
"""Number of samples whose regressors are in memory at once."""

Method = Literal["ls", "pso"]


@dataclass(frozen=True)
class Sets:
    """Centres and widths, shape (inputs, sets) each."""

    centres: Array
    widths: Array

    @classmethod
    def even(cls, low: Array, high: Array, n: int) -> Sets:
        """Return sets evenly spaced over the range of every input."""
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
        return Sets(*values.reshape(2, *self.centres.shape))


def memberships(x: Array, sets: Sets) -> Array:
    """Return memberships normalised input by input, shape (n, inputs, sets)."""
    z = (x[:, :, np.newaxis] - sets.centres) / sets.widths
    exponent = -0.5 * z**2
    fired = np.exp(exponent - exponent.max(axis=2, keepdims=True))
    return np.asarray(fired / fired.sum(axis=2, keepdims=True))


def firing(phi: Array) -> Array:
    """Return the normalised firing strength of every rule, the last input's set running fastest."""
    fired = phi[:, 0]
    for i in range(1, phi.shape[1]):
        fired = (fired[:, :, np.newaxis] * phi[:, i, np.newaxis, :]).reshape(len(phi), -1)
    return fired


def linear_terms(x: Array, constants: bool) -> Array:
    """Return the regressors of a consequent: the inputs, and 1 if there are constants."""
    return np.column_stack([x, np.ones(len(x))]) if constants else x


def regressors(x: Array, fired: Array, constants: bool) -> Array:
    """Return the regressors of all consequents, shape (n, rules * terms)."""
    terms = linear_terms(x, constants)
    return (fired[:, :, np.newaxis] * terms[:, np.newaxis, :]).reshape(len(x), -1)


@dataclass(frozen=True)
class Consequents:
    """Least squares of consequents.

    A rule's consequent is what all rules have in common plus a deviation of its own, and deviations are
    damped: where the data say nothing, the network is then nearly linear rather than anything at all,
    and can be inverted.
    """

    constants: bool
    ridge: float

    def solve(self, gram: Array, right: Array, n_terms: int) -> Array:
        """Return consequents from normal equations, shape (rules * terms, outputs)."""
        n_rules = len(gram) // n_terms
        parts = np.hstack([np.tile(np.eye(n_terms), (n_rules, 1)), np.eye(len(gram))])
        normal = parts.T @ gram @ parts
        size = np.diag(normal)[:n_terms]
        unit = np.tile(1.0 / np.sqrt(np.where(size > 0, size, 1.0)), 1 + n_rules)
        normal *= unit * unit[:, np.newaxis]
        damping = np.repeat([0.0, self.ridge], [n_terms, len(gram)])
        normal[np.diag_indices_from(normal)] += damping + LIGHTEST
        solution = np.linalg.solve(normal, unit[:, np.newaxis] * (parts.T @ right))
        return np.asarray(parts @ (unit[:, np.newaxis] * solution))

    def fit(self, x: Array, columns: Array, y: Array) -> Array:
        """Return consequents by damped least squares, shape (rules * terms, outputs)."""
        return self.solve(columns.T @ columns, columns.T @ y, x.shape[1] + self.constants)


@dataclass(frozen=True)
class Problem:
    """Inputs x (n, inputs) and outputs y (n, outputs) for the antecedents."""

    x: Array
    y: Array
    solver: Consequents

    def columns(self, sets: Sets) -> Array:
        """Return the regressors of the consequents, shape (n, rules * terms)."""
        return regressors(self.x, firing(memberships(self.x, sets)), self.solver.constants)

    def errors(self, sets: Sets) -> Array:
        """Return the errors with optimal consequents, shape (n, outputs)."""
        columns = self.columns(sets)
        return np.asarray(columns @ self.solver.fit(self.x, columns, self.y) - self.y)

    def cost(self, sets: Sets) -> float:
        """Return the root mean square over all outputs, ordered as the paper's Eq. (26)."""
        return rms(self.errors(sets))


@dataclass(frozen=True)
class Search:
    """Search of antecedents: variable projection, or the paper's particle swarm."""

    method: Method
    samples: int
    """Number of samples, evenly spaced, that are used."""

    swarm: Swarm
    seed: int


def printed_swarm(particles: int = 20, iterations: int = 50) -> Swarm:
    """Return the paper's swarm, of its size or another."""
    return Swarm(particles, iterations, (INERTIA, INERTIA), ATTRACTION, ATTRACTION)


def fit_network(
    x: Array,
    y: Array,
    n_sets: int,
    solver: Consequents,
    search: Search,
    channels: tuple[Channels, Channels, Channels],
    *,
    beyond: float,
    tracker: Tracker,
) -> FuzzyNetwork:
    """Return a network fitted to inputs x (n, inputs) and outputs y (n, outputs).

    Channels are those driven, those that schedule, and the outputs; its inverse ends a share ``beyond``
    of the range of each driven one away from the data.
    """
    # damped from the least of every input on, which a constant makes up for, inputs may have any zero
    origin = x.min(axis=0) if solver.constants else np.zeros(x.shape[1])
    x = x - origin
    keep = np.linspace(0, len(x) - 1, min(len(x), search.samples)).round().astype(int)
    problem = Problem(x[keep], y[keep], solver)
    if search.method == "pso":
        sets = swarmed(problem, n_sets, search.swarm, search.seed, tracker)
    else:
        sets = project(problem, n_sets, x.min(axis=0), x.max(axis=0), tracker)
    gram, right = np.zeros(()), np.zeros(())
    for start in range(0, len(x), PART):
        part = slice(start, start + PART)
        columns = Problem(x[part], y[part], solver).columns(sets)
        gram, right = gram + columns.T @ columns, right + columns.T @ y[part]
    n_terms = x.shape[1] + solver.constants
    driven, scheduled, outputs = channels
    consequents = solver.solve(gram, right, n_terms).reshape(-1, n_terms, len(outputs))
    if solver.constants:
        consequents[:, -1] -= np.einsum("i,rij->rj", origin, consequents[:, :-1])
    ends = (end(x + origin, axis=0) for end in (np.min, np.max))
    low, high = (end[: len(driven)] for end in ends)
    margin = beyond * (high - low)
    return FuzzyNetwork(
        rows(sets.centres + origin[:, np.newaxis]),
        rows(sets.widths),
        vector(np.moveaxis(consequents, 2, 1).ravel()),
        driven,
        outputs,
        scheduled,
        solver.constants,
        rows(np.column_stack([low - margin, high + margin])),
    )


def project(problem: Problem, n_sets: int, low: Array, high: Array, tracker: Tracker) -> Sets:
    """Return antecedents by variable projection from evenly spaced sets."""
    scale = np.where(high > low, high - low, 1.0)
    start = Sets.even(low, low + scale, n_sets)
    if n_sets == 1:  # it fires alone, wherever it is
        return start
    wide, lowest = np.repeat(scale, n_sets), np.repeat(low, n_sets)
    lower = np.concatenate([lowest - 0.2 * wide, NARROWEST * wide])
    upper = np.concatenate([lowest + 1.2 * wide, WIDEST * wide])
    unit = np.concatenate([wide, wide])

    staying = STAYING * float(np.linalg.norm(problem.errors(start))) / unit

    def errors(theta: Array) -> tuple[Array, Callable[[], Array]]:
        sets = start.replaced(theta)
        with_bounds = np.append(problem.errors(sets), staying * (theta - start.vector))
        return with_bounds, lambda: np.vstack([sensitivities(problem, sets), np.diag(staying)])

    tracker.budget = MOST_STEPS + 1
    path = trust_region(
        tracker.watched(errors),
        start.vector,
        bounds=(lower, upper),
        least_gain=LEAST_GAIN,
        max_evaluations=MOST_STEPS + 1,
    )
    return start.replaced(path[-1][0])


def sensitivities(problem: Problem, sets: Sets) -> Array:
    """Return the projected derivatives of the errors by centres and widths."""
    x, y, solver = problem.x, problem.y, problem.solver
    n, n_in = x.shape
    n_sets, n_out = sets.centres.shape[1], y.shape[1]
    phi = memberships(x, sets)
    fired = firing(phi)
    columns = regressors(x, fired, solver.constants)
    terms = linear_terms(x, solver.constants)
    consequents = solver.fit(x, columns, y).reshape(-1, terms.shape[1], n_out)
    weighted = np.einsum("nt,rto->nro", terms, consequents) * fired[:, :, np.newaxis]
    f = weighted.sum(axis=1)
    grid = weighted.reshape(n, *[n_sets] * n_in, n_out)
    derivative = np.empty((n, n_out, 2, n_in, n_sets))
    for i in range(n_in):
        # what fires through each set of this input, (n, sets, outputs)
        others_product = grid.sum(axis=tuple(1 + k for k in range(n_in) if k != i))
        change = others_product - phi[:, i, :, np.newaxis] * f[:, np.newaxis, :]
        away = x[:, i, np.newaxis] - sets.centres[i]
        for place, slope in enumerate((away / sets.widths[i] ** 2, away**2 / sets.widths[i] ** 3)):
            derivative[:, :, place, i] = np.moveaxis(change * slope[:, :, np.newaxis], 2, 1)
    flat = derivative.reshape(n, -1)
    projected = flat - columns @ solver.fit(x, columns, flat)  # less what consequents can take up
    return np.asarray(projected.reshape(n * n_out, -1))


def swarmed(problem: Problem, n_sets: int, swarm: Swarm, seed: int, tracker: Tracker) -> Sets:
    """Return the best antecedents of a swarm without bounds."""
    rng = np.random.default_rng(seed)
    shape = (problem.x.shape[1], n_sets)
    start = rng.standard_normal((swarm.particles, 2 * shape[0] * shape[1]))
    nowhere = np.full(start.shape[1], np.inf)

    def sets(position: Array) -> Sets:
        centres, widths = position.reshape(2, *shape)
        return Sets(centres, np.maximum(np.abs(widths), LEAST_WIDTH))

    def costs(positions: Array) -> Array:
        return np.array([problem.cost(sets(position)) for position in positions])

    return sets(particle_swarm(costs, -nowhere, nowhere, swarm, tracker, rng, start=start))
