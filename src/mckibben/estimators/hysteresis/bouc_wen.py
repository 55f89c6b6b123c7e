"""Identification of the normalised Bouc-Wen model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.bouc_wen import BoucWen
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.hysteresis.differential_loops import DifferentialLoopEstimator


@dataclass(kw_only=True, repr=False, eq=False)
class BoucWenEstimator(DifferentialLoopEstimator):
    """Bouc-Wen model by variable projection: rate and sigma are searched, the rest is solved for."""

    title = "Bouc–Wen model"
    purpose = "memory"
    can = "A loop that saturates, with five numbers or so, and a reversible polynomial."
    cannot = "Minor loops need not close; loops are symmetric but for the polynomial."
    inverse_kind = "solved"
    quick = True
    makes = ("bouc-wen",)
    effort: ClassVar[float] = 0.6

    lowest: ClassVar[tuple[float, ...]] = (0.5,)
    highest: ClassVar[tuple[float, ...]] = (6.0,)

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return loops that saturate over a tenth, a third and all of the range."""
        return [np.array([np.log(rate), sigma]) for rate in (3, 10, 30) for sigma in (0.6, 1.5)]

    def unit(self, theta: Array, data: TrainingData) -> BoucWen:
        low, high = data.input_range
        return BoucWen(
            (0.0,),
            1.0,
            self.rate(theta, data),
            float(theta[1]),
            self.exponent or 1,
            low,
            high - low,
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )

    def steepest(self, theta: Array, data: TrainingData) -> float:
        return float(np.exp(theta[0]) * max(1.0, 2 * theta[1]))

    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> Block:
        unit = self.unit(theta, data)
        return replace(unit, polynomial=vector(polynomial), weight=float(weights[0]))
