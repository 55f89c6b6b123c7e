"""Identification of the generalised Bouc-Wen model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.generalized_bouc_wen import GeneralizedBoucWen
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.hysteresis.differential_loops import DifferentialLoopEstimator

MOST_ASYMMETRIC = 0.19
"""Largest size of each of the five shape numbers: together they stay below 1."""


@dataclass(kw_only=True, repr=False, eq=False)
class GeneralizedBoucWenEstimator(DifferentialLoopEstimator):
    """Generalised Bouc-Wen model: rate and shape are searched, the rest is solved for."""

    title = "Generalised Bouc–Wen model (GBW)"
    purpose = "memory"
    can = "Asymmetric saturating loops, by five shape numbers."
    cannot = "Minor loops need not close; many starts are needed to identify it."
    inverse_kind = "solved"
    makes = ("generalized-bouc-wen",)
    effort: ClassVar[float] = 1.3

    lowest: ClassVar[tuple[float, ...]] = (-MOST_ASYMMETRIC,) * 5
    highest: ClassVar[tuple[float, ...]] = (MOST_ASYMMETRIC,) * 5

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return symmetric loops of a few rates."""
        return [np.array([np.log(rate), *np.zeros(5)]) for rate in (3, 10, 30)]

    def unit(self, theta: Array, data: TrainingData) -> GeneralizedBoucWen:
        """Return the model of z alone; its shape turns over at mid-range."""
        low, high = data.input_range
        half = 0.5 * (high - low)
        return GeneralizedBoucWen(
            (0.0,),
            1.0,
            self.rate(theta, data),
            vector(theta[1:]),
            self.exponent or 1,
            low + half,
            half,
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )

    def steepest(self, theta: Array, data: TrainingData) -> float:
        unit = self.unit(theta, data)
        return 2 * unit.scale * unit.steepest

    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> Block:
        """Return the model, its polynomial turned from 0..1 to -1..1."""
        turned = np.polynomial.Polynomial(polynomial)(np.polynomial.Polynomial([0.5, 0.5])).coef
        padded = np.pad(turned, (0, polynomial.size - turned.size))
        unit = self.unit(theta, data)
        return replace(unit, polynomial=vector(padded), weight=float(weights[0]))
