"""Identification of the generalised Bouc-Wen model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.differential.generalized_bouc_wen import GeneralizedBoucWen
from mckibben.blocks.fields import vector
from mckibben.estimators.best_of import best_of_settings
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.loops import LoopEstimator
from mckibben.estimators.search import Tracker

Array = NDArray[np.float64]

MOST_ASYMMETRIC = 0.19
"""Largest size of each of the five shape numbers: together they stay below 1."""


@dataclass(kw_only=True, repr=False, eq=False)
class GeneralizedBoucWenEstimator(LoopEstimator):
    """Generalised Bouc-Wen model: rate and shape are searched, the rest is solved for.

    Parameters
    ----------
    exponent : {1, 2}, optional
        n. Default: the better of both on the training data.
    """

    effort: ClassVar[float] = 1.3

    exponent: Literal[1, 2] | None = None

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it."""
        if self.exponent is not None:
            return super().identify(data, tracker)
        return best_of_settings(self, "exponent", (1, 2), data, tracker)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log rate by input range, shape]."""
        del data
        most = np.full(5, MOST_ASYMMETRIC)
        return np.array([np.log(0.3), *-most]), np.array([np.log(300.0), *most])

    def shape_bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [rate, shape]."""
        low, high = data.input_range
        most = np.full(5, MOST_ASYMMETRIC)
        return np.array([0.3 / (high - low), *-most]), np.array([300.0 / (high - low), *most])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return symmetric loops of a few rates."""
        del data
        return [np.array([np.log(rate), *np.zeros(5)]) for rate in (3, 10, 30)]

    def unit(self, theta: Array, data: TrainingData) -> GeneralizedBoucWen:
        """Return the model of z alone; its shape turns over at mid-range."""
        low, high = data.input_range
        half = 0.5 * (high - low)
        return GeneralizedBoucWen(
            (0.0,),
            1.0,
            float(np.exp(theta[0])) / (high - low),
            vector(theta[1:]),
            self.exponent or 1,
            low + half,
            half,
            data.input_range,
        )

    def loops(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        """Return z, and the bound of its slope."""
        unit = self.unit(theta, data)
        z = unit.simulate(run.history, initial=self.starting_rule)
        return z[:, np.newaxis], np.array([2 * unit.scale * unit.steepest])

    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> Block:
        """Return the model, its polynomial turned from 0..1 to -1..1."""
        unit = self.unit(theta, data)
        turned = np.polynomial.Polynomial(polynomial)(np.polynomial.Polynomial([0.5, 0.5])).coef
        return GeneralizedBoucWen(
            vector(np.pad(turned, (0, polynomial.size - turned.size))),
            float(weights[0]),
            unit.rate,
            unit.shape,
            unit.exponent,
            unit.centre,
            unit.scale,
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )
