"""Loops that follow a differential equation in the input, of Bouc and Wen's kind."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.hysteresis.bouc_wen import BoucWen
from mckibben.blocks.hysteresis.generalized_bouc_wen import GeneralizedBoucWen
from mckibben.estimators.core.best_of import best_of_settings
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.hysteresis.play_loops import LoopEstimator
from mckibben.estimators.optimisers.tracker import Tracker

SLOWEST, FASTEST = 0.3, 300.0
"""Rates, relative to one over the range of the input."""


@dataclass(kw_only=True, repr=False, eq=False)
class DifferentialLoopEstimator(LoopEstimator):
    """An estimator of a loop z whose rate and shape are searched; the rest is solved for.

    Parameters
    ----------
    exponent : {1, 2}, optional
        n. Default: the better of both on the training data.
    """

    exponent: Literal[1, 2] | None = None

    lowest: ClassVar[tuple[float, ...]]
    highest: ClassVar[tuple[float, ...]]
    """Bounds of the shape."""

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        if self.exponent is not None:
            return super().identify(data, tracker)
        return best_of_settings(self, "exponent", (1, 2), data, tracker)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log rate by input range, shape]."""
        slow, fast = np.log([SLOWEST, FASTEST])
        return np.array([slow, *self.lowest]), np.array([fast, *self.highest])

    def shape_bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [rate, shape]."""
        low, high = data.input_range
        slow, fast = SLOWEST / (high - low), FASTEST / (high - low)
        return np.array([slow, *self.lowest]), np.array([fast, *self.highest])

    def rate(self, theta: Array, data: TrainingData) -> float:
        """Return the rate, per unit of the input."""
        low, high = data.input_range
        return float(np.exp(theta[0])) / (high - low)

    @abstractmethod
    def unit(self, theta: Array, data: TrainingData) -> BoucWen | GeneralizedBoucWen:
        """Return the model of z alone."""

    @abstractmethod
    def steepest(self, theta: Array, data: TrainingData) -> float:
        """Return the bound of the slope of z over the input's range."""

    def loops(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        z = self.unit(theta, data).simulate(run.history, initial=self.starting_rule)
        return z[:, np.newaxis], np.array([self.steepest(theta, data)])
