"""Identification of the Maxwell-slip model, and of its modified, asymmetric form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.maxwell_slip import MaxwellSlip, slip_matrix
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Operators
from mckibben.estimators.hysteresis.play_loops import LoopEstimator
from mckibben.estimators.hysteresis.thresholds import spread
from mckibben.presets import preset

MOST_UNEQUAL = np.log(4.0)


@dataclass(kw_only=True, repr=False, eq=False)
class MaxwellSlipEstimator(LoopEstimator):
    """Maxwell-slip model: by least squares, but for the ratios of its directions where it has any.

    Parameters
    ----------
    n_operators : int
        Springs.
    spacing : {"even", "dense"}
        How the deflections at which they slip spread over half the input range.
    asymmetric : bool
        Whether rising and falling differ in stiffness and in slip, by ratios that are searched.
    """

    purpose = "memory"
    inverse_kind = "solved"
    effort: ClassVar[float] = 0.02

    n_operators: Operators = 8
    spacing: Literal["even", "dense"] = "even"
    asymmetric: bool = False

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the logarithms of both ratios, if there are any."""
        most = np.full(2 * self.asymmetric, MOST_UNEQUAL)
        return -most, most

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return the symmetric model, and slightly asymmetric ones."""
        if not self.asymmetric:
            return []
        return [np.array([a, b]) for a in (0.0, 0.3, -0.3) for b in (0.0, 0.3, -0.3)]

    def shape_bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of both ratios."""
        lower, upper = self.bounds(data)
        return (np.exp(lower), np.exp(upper)) if lower.size else (np.ones(2), np.ones(2))

    def springs(self, theta: Array, data: TrainingData) -> MaxwellSlip:
        """Return the springs, without weights."""
        low, high = data.input_range
        limits = spread(self.n_operators + 1, high - low, self.spacing)[1:]
        kappa, ratio = np.exp(theta) if theta.size else (1.0, 1.0)
        nothing = (0.0,) * self.n_operators
        return MaxwellSlip(
            vector(limits), nothing, (0.0,), float(kappa), float(ratio), low, high - low
        )

    def loops(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        springs = self.springs(theta, data)
        n = self.n_operators
        u = run.history
        start = springs.initial_state(u[:1], self.starting_rule)[:n]
        deflections = np.empty((u.size, n))
        limits = np.array(springs.breakaways)
        slip_matrix(u, limits, springs.stiffness_ratio, springs.limit_ratio, start, deflections)
        low, high = data.input_range
        return deflections, np.full(n, (high - low) * max(1.0, springs.stiffness_ratio))

    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> Block:
        springs = self.springs(theta, data)
        return MaxwellSlip(
            springs.breakaways,
            vector(weights),
            vector(polynomial),
            springs.stiffness_ratio,
            springs.limit_ratio,
            springs.centre,
            springs.scale,
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )


MAXWELL_SLIP = preset(
    MaxwellSlipEstimator,
    "Maxwell-slip model by least squares.",
    title="Maxwell-slip model",
    can="Springs that slip beside a reversible curve; symmetric loops.",
    cannot="Asymmetry only by the curve.",
    quick=True,
    asymmetric=False,
)

MMS = preset(
    MaxwellSlipEstimator,
    "Modified Maxwell-slip model: the two ratios of its directions are searched.",
    title="Modified Maxwell-slip model (MMS)",
    can="Springs that slip, of different stiffness and limit up and down.",
    cannot="One asymmetry for all springs.",
    asymmetric=True,
    effort=0.5,
)
