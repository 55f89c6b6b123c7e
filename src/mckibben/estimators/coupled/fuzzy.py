"""A fuzzy network as identification sees it: sets, what fires, and consequents.

Consequents are linear and solved for by least squares, whatever the antecedents; only the centres and
widths of the sets are searched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array

LIGHTEST = 1e-11
"""Damping of every consequent, relative to the size of what it multiplies."""


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
        unit = np.tile(1.0 / np.sqrt(np.where(size > 0, size, 1.0)), 1 + n_rules)
        whole *= unit * unit[:, np.newaxis]
        damping = np.repeat([0.0, self.ridge], [n_terms, len(gram)])
        whole[np.diag_indices_from(whole)] += damping + LIGHTEST
        found = np.linalg.solve(whole, unit[:, np.newaxis] * (parts.T @ right))
        return np.asarray(parts @ (unit[:, np.newaxis] * found), dtype=np.float64)

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


@dataclass(frozen=True)
class Problem:
    """Inputs x (n, inputs) and outputs y (n, outputs) to which antecedents are searched."""

    x: Array
    y: Array
    solver: Consequents

    def fitted(self, sets: Sets) -> Fitted:
        """Return the antecedents with consequents solved for."""
        columns = regressors(self.x, firing(memberships(self.x, sets)), self.solver.constants)
        return Fitted(sets, self.solver.fit(self.x, columns, self.y))

    def errors(self, sets: Sets) -> Array:
        """Return the errors, shape (n, outputs), the consequents solved for."""
        return self.fitted(sets).predict(self.x, self.solver.constants) - self.y

    def cost(self, sets: Sets) -> float:
        """Return the root of the mean square over all outputs, the consequents solved for.

        It orders antecedents as the paper's loss does, Eq. (26): the plain sum of squares.
        """
        return float(np.sqrt(np.mean(self.errors(sets) ** 2)))
