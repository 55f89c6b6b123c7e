"""Identification of the normalised Bouc-Wen model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.differential.bouc_wen import BoucWen
from mckibben.blocks.fields import vector
from mckibben.estimators.best_of import best_of_settings
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.loops import LoopEstimator
from mckibben.estimators.search import Tracker

Array = NDArray[np.float64]

STEEPEST_SIGMA = 6.0


@dataclass(kw_only=True, repr=False, eq=False)
class BoucWenEstimator(LoopEstimator):
    """Bouc-Wen model by variable projection: rate and sigma are searched, the rest is solved for.

    Parameters
    ----------
    exponent : {1, 2}, optional
        n. Default: the better of both on the training data.
    """

    effort: ClassVar[float] = 0.6

    exponent: Literal[1, 2] | None = None

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it."""
        if self.exponent is not None:
            return super().identify(data, tracker)
        return best_of_settings(self, "exponent", (1, 2), data, tracker)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log rate by input range, sigma]."""
        del data
        return np.array([np.log(0.3), 0.5]), np.array([np.log(300.0), STEEPEST_SIGMA])

    def shape_bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [rate, sigma]."""
        low, high = data.input_range
        slowest, fastest = 0.3 / (high - low), 300.0 / (high - low)
        return np.array([slowest, 0.5]), np.array([fastest, STEEPEST_SIGMA])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return loops that saturate over a tenth, a third and all of the range."""
        del data
        return [np.array([np.log(rate), sigma]) for rate in (3, 10, 30) for sigma in (0.6, 1.5)]

    def unit(self, theta: Array, data: TrainingData) -> BoucWen:
        """Return the model of z alone."""
        low, high = data.input_range
        rate, sigma = float(np.exp(theta[0])) / (high - low), float(theta[1])
        return BoucWen((0.0,), 1.0, rate, sigma, self.exponent or 1, low, high - low)

    def loops(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        """Return z, and the bound of its slope."""
        z = self.unit(theta, data).simulate(run.history, initial=self.starting_rule)
        return z[:, np.newaxis], np.array([np.exp(theta[0]) * max(1.0, 2 * theta[1])])

    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> Block:
        """Return the Bouc-Wen model."""
        unit = self.unit(theta, data)
        return BoucWen(
            vector(polynomial),
            float(weights[0]),
            unit.rate,
            unit.sigma,
            unit.exponent,
            unit.centre,
            unit.scale,
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )
