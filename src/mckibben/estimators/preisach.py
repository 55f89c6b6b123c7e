"""Identification of the Preisach and Krasnosel'skii-Pokrovskii models: weights on a triangular grid."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.krasnoselskii_pokrovskii import KrasnoselskiiPokrovskii
from mckibben.blocks.preisach import Preisach
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.separable import SeparableEstimator

Array = NDArray[np.float64]

LEAST_REVERSIBLE = 1e-4
"""Least share of the output's range that each operator on the diagonal gives."""


@dataclass(kw_only=True, repr=False, eq=False)
class GridEstimator(SeparableEstimator):
    """An estimator of weights on a triangular grid of thresholds, by (non-negative) least squares.

    Parameters
    ----------
    n_levels : int
        Intervals that the input range is cut into.
    """

    n_levels: Annotated[int, Interval(ge=1, le=60)] = 10

    @abstractmethod
    def grid(self, data: TrainingData) -> Preisach | KrasnoselskiiPokrovskii:
        """Return the model of these levels, without weights."""

    def levels(self, data: TrainingData) -> tuple[float, ...]:
        """Return the levels: evenly spread over the input range."""
        return vector(np.linspace(*data.input_range, self.n_levels + 1))

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return nothing: every parameter is linear."""
        del data
        return np.empty(0), np.empty(0)

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return nothing to guess."""
        del data
        return []

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the output of every cell alone, over the run's history."""
        del theta
        grid = self.grid(data)
        n = len(grid.weights)
        alone = np.column_stack([np.eye(n), np.zeros(n)])
        return grid.simulate_many(alone, run.history, initial=self.starting_rule).T

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return a little of every cell on the diagonal: without, there is no inverse."""
        floor = np.zeros(matrix.shape[1])
        low, high = data.output_range
        diagonal = np.cumsum(np.arange(1, self.n_levels + 1)) - 1
        floor[diagonal] = LEAST_REVERSIBLE * (high - low)
        return floor

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        """Return the model."""
        del theta
        return self.grid(data).unpack([*linear, offset])

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return the model without weights, and weights up to a share of the output's range."""
        template = self.grid(data)
        low, high = data.output_range
        n = template.n_parameters - 1
        most = 2 * (high - low) / n
        return template, np.array([*np.zeros(n), low - most]), np.array([*np.full(n, most), high])


@dataclass(kw_only=True, repr=False, eq=False)
class PreisachEstimator(GridEstimator):
    """Preisach model by (non-negative) least squares on its cells."""

    effort: ClassVar[float] = 0.15

    def grid(self, data: TrainingData) -> Preisach:
        """Return the Preisach model without weights."""
        n = self.n_levels * (self.n_levels + 1) // 2
        rule = self.starting_rule
        return Preisach(self.levels(data), (0.0,) * n, 0.0, rule, **self.channels(data))


@dataclass(kw_only=True, repr=False, eq=False)
class KrasnoselskiiPokrovskiiEstimator(GridEstimator):
    """Krasnosel'skii-Pokrovskii model by (non-negative) least squares on its operators."""

    effort: ClassVar[float] = 0.15

    def grid(self, data: TrainingData) -> KrasnoselskiiPokrovskii:
        """Return the Krasnosel'skii-Pokrovskii model without weights."""
        n = self.n_levels * (self.n_levels + 1) // 2
        rule = self.starting_rule
        return KrasnoselskiiPokrovskii(
            self.levels(data), (0.0,) * n, 0.0, rule, **self.channels(data)
        )
