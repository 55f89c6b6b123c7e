"""Identification of the elastic-plastic model.

--- For the author: copy this file beside its kin in src/mckibben/estimators. A model that is linear in
--- most of its parameters is a `SeparableEstimator`: it says what those multiply, and how to build the
--- block; they are solved for exactly in every trial of the others, which are searched from many
--- starts. Import your block from where you have put it, mckibben.blocks.<family>.<your_model>.
--- Comments that start with three dashes are for you; take them out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from my_block import ElasticPlastic

from mckibben.blocks.base import Block
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.separable import LEAST_REVERSIBLE, Array, SeparableEstimator


@dataclass(kw_only=True, repr=False, eq=False)
class ElasticPlasticEstimator(SeparableEstimator):
    """Elastic-plastic model by variable projection: its threshold is searched, the rest is solved for.

    y = (gain + weight) E_r[u] + gain F_r[u], and both slopes are kept positive, so that it has an
    inverse; data are taken to start from 0, for the model has no offset.
    """

    # --- What is said of the model; the README lists all that may be declared.
    title = "Elastic-plastic model"
    purpose = "memory"
    can = "One loop of straight branches, with nonlocal memory."
    cannot = "No curved branches, no rate, no creep."
    inverse_kind = "exact"
    makes = ("elastic-plastic",)

    # --- A setting of its own is a field with a default, validated by its type:
    # --- n_terms: Annotated[int, Ge(1)] = 4

    @property
    def solves_offset(self) -> bool:
        """No: the model has none."""
        return False

    # --- What is searched, theta, is scaled to numbers near 1.
    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [threshold by input range]."""
        return np.array([0.005]), np.array([0.45])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return a few thresholds."""
        return [np.array([share]) for share in (0.02, 0.08, 0.2)]

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the stop and the play operator over the run's history, side by side."""
        play = self.build(theta, np.array([0.0, 1.0]), 0.0, data).simulate(run.history)
        return np.column_stack([run.history - play, play])

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return the least slopes, so that both ends of a branch move the output."""
        return LEAST_REVERSIBLE * np.ptp(data.output_range) / np.ptp(matrix, axis=0)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        """Return the model; linear are its slopes while it sticks, and while it slips."""
        sticking, slipping = linear.tolist()
        return ElasticPlastic(
            slipping,
            sticking - slipping,
            float(theta[0] * np.ptp(data.input_range)),
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )

    # --- Particle swarms go over all parameters of the block, in the order of its `pack`.
    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return a model, and bounds of [gain, weight, threshold] around mean slopes of the data."""
        width, slope = (
            np.ptp(data.input_range),
            np.ptp(data.output_range) / np.ptp(data.input_range),
        )
        template = self.build(np.array([0.1]), np.array([slope, slope]), 0.0, data)
        lower = np.array([0.1 * slope, -0.09 * slope, 0.005 * width])
        return template, lower, np.array([3 * slope, 3 * slope, 0.45 * width])
