"""Identification of the Preisach and Krasnosel'skii-Pokrovskii models: weights on a triangular grid."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.preisach import KrasnoselskiiPokrovskii, Preisach
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid, InverseKind
from mckibben.estimators.core.separable import SeparableEstimator

LEAST_REVERSIBLE = 1e-4
"""Smallest share of the output's range for each operator on the diagonal."""


class PreisachEstimator(SeparableEstimator):
    """Preisach model by (non-negative) least squares on its cells, a triangular grid of thresholds.

    Parameters
    ----------
    relays : {"sudden", "gradual"}
        What the weights are of: Preisach's relays, or Krasnosel'skii and Pokrovskii's, which take a
        level to switch.
    n_levels : int
        Intervals that the input range is cut into.
    """

    title = "Preisach model"
    purpose = "memory"
    can = "Loops of any shape whose minor loops are congruent."
    cannot = (
        "Weights that no reversal has excited are not determined; constant beyond the largest "
        "recorded input."
    )
    inverse_kind: ClassVar[InverseKind] = "exact"
    param_grid: ClassVar[Grid] = {"n_levels": (6, 10, 15)}
    effort = 0.15

    relays: Literal["sudden", "gradual"] = "sudden"
    n_levels: Annotated[int, Interval(ge=1, le=60)] = 10

    def grid(self, data: TrainingData) -> Preisach | KrasnoselskiiPokrovskii:
        """Return the model of these levels, without weights."""
        block = Preisach if self.relays == "sudden" else KrasnoselskiiPokrovskii
        levels = vector(np.linspace(*data.input_range, self.n_levels + 1))
        n = self.n_levels * (self.n_levels + 1) // 2
        keywords: dict[str, Any] = {"initial": self.starting_rule} | self.channels(data)
        return block(levels, (0.0,) * n, 0.0, **keywords)

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the output of every cell separately, over the run."""
        grid = self.grid(data)
        n = len(grid.weights)
        alone = np.column_stack([np.eye(n), np.zeros(n)])
        return grid.simulate_many(alone, run.u, initial=self.starting_rule).T

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        """Return a small lower bound of every diagonal cell, which the inverse needs."""
        floor = np.zeros(matrix.shape[1])
        diagonal = np.cumsum(np.arange(1, self.n_levels + 1)) - 1
        floor[diagonal] = LEAST_REVERSIBLE * data.output_span
        return floor

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        return self.grid(data).unpack([*linear, offset])


class KPEstimator(PreisachEstimator):
    """Krasnosel'skii-Pokrovskii model by (non-negative) least squares on its operators."""

    title = "Krasnosel'skii–Pokrovskii model (KP)"
    can = "Loops of any shape whose minor loops are congruent, with ridges of finite slope."
    inverse_kind = "solved"
    quick = True
    relays = "gradual"
