"""Identification of the Duhem model."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.differential import Duhem
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.separable import SeparableEstimator


class DuhemEstimator(SeparableEstimator):
    """Duhem model by variable projection: its output is linear in both polynomials.

    Parameters
    ----------
    degree : int
        Of the curve that the output tends to.
    slope_degree : int
        Of the slope right after a reversal.
    """

    title = "Duhem model"
    purpose = "memory"
    can = "Loops that tend to a curve, with polynomial slopes; in closed form."
    cannot = (
        "Minor loops are not congruent and need not close; the inverse exists only where the "
        "slopes stay positive."
    )
    makes = ("duhem",)
    effort = 1.1

    nonnegative = False
    degree: Annotated[int, Interval(ge=1, le=9)] = 4
    slope_degree: Annotated[int, Interval(ge=0, le=9)] = 3

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log alpha], alpha by half the input range."""
        return np.array([np.log(0.1)]), np.array([np.log(100.0)])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return a few rates."""
        return [np.array([np.log(alpha)]) for alpha in (0.5, 1.5, 4.0, 12.0)]

    def unit(self, theta: Array, data: TrainingData) -> Duhem:
        """Return the model with zero polynomials."""
        low, high = data.input_range
        half = 0.5 * (high - low)
        return Duhem(
            (0.0,) * (self.degree + 1),
            (0.0,) * (self.slope_degree + 1),
            float(np.exp(theta[0])),
            low + half,
            half,
            **self.common_fields(data),
        )

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the output per coefficient, without the constant, over the run."""
        unit = self.unit(theta, data)
        n = unit.n_parameters - 1
        alone = np.column_stack([np.eye(n)[1:], np.full(n - 1, unit.alpha)])
        return np.column_stack([unit.unpack(row).simulate(run.u) for row in alone])

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        target = (offset, *linear[: self.degree].tolist())
        return replace(self.unit(theta, data), target=target, slope=vector(linear[self.degree :]))
