"""Identification of the rate-dependent modified Prandtl-Ishlinskii model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.rate_dependent_pi import RateDependentPI
from mckibben.estimators.core.best_of import best_of_settings
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.hysteresis.mpi import MappedPIEstimator
from mckibben.estimators.hysteresis.pi import play_operators
from mckibben.estimators.optimisers.tracker import Tracker

RATE_SHARE = 0.5
"""Largest change of a weight by rate, relative to the largest weight, at the fastest input seen."""


@dataclass(kw_only=True, repr=False, eq=False)
class RDPIEstimator(MappedPIEstimator):
    """Rate-dependent modified Prandtl-Ishlinskii model by variable projection.

    Weights are linear in the rate of the input, as in "High-Precision Displacement and Force Hybrid
    Modeling of Pneumatic Artificial Muscle Using 3D PI-NARMAX Model", Eqs. (2) to (5).

    Parameters
    ----------
    rate_time_constant : float, optional
        Time constant of the filter of the rate [s]; 0 as in the paper, which suits commanded inputs.
        Default: the best on the training data of none, 5 and 25 samples.
    """

    title = "Rate-dependent Prandtl–Ishlinskii model (RDPI)"
    purpose = "rate"
    can = "Prandtl-Ishlinskii memory with weights that follow the rate."
    cannot = (
        "Extrapolates badly beyond the rates seen; its inverse swings where weights by rate "
        "are strongly negative."
    )
    caution = "weights that follow the rate are arbitrary at other rates"
    inverse_kind = "solved"
    makes = ("rate-dependent-pi polynomial",)
    needs_time: ClassVar[bool] = True

    effort: ClassVar[float] = 0.9

    rate_time_constant: Annotated[float, Ge(0)] | None = None

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        step = data.timed(instead=", or use mpi")
        if self.rate_time_constant is not None:
            return super().identify(data, tracker)
        values = [samples * step for samples in (0, 5, 25)]
        return best_of_settings(self, "rate_time_constant", values, data, tracker)

    def rate(self, run: Run) -> Array:
        """Return the filtered rate of the run's input, per second."""
        from scipy.signal import lfilter

        assert run.sample_time is not None
        step = run.sample_time
        tau = self.rate_time_constant or 0.0
        smoothing = np.exp(-step / tau) if tau > 0 else 0.0
        raw = np.diff(run.history, prepend=run.history[0]) / step
        return np.asarray(lfilter([1 - smoothing], [1, -smoothing], raw))

    def fastest(self, data: TrainingData) -> float:
        """Return the largest rate in the data, per second."""
        rates = data.once(
            ("fastest", self.rate_time_constant),
            lambda: np.array([np.abs(self.rate(run)).max() for run in data.runs]),
        )
        return float(rates.max())

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the weights at rest, then of those by rate relative to the fastest."""
        lower, upper = super().bounds(data)
        share = np.full(self.n_operators, RATE_SHARE)
        return np.concatenate([lower, -share]), np.concatenate([upper, share])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return the guesses of the static model, without dependence on rate."""
        return [np.concatenate([guess, np.zeros_like(guess)]) for guess in super().guesses(data)]

    def operators(self, run: Run, data: TrainingData) -> Array:
        """Return the play operators, then the same times the rate relative to the fastest."""
        play = play_operators(run.history, self.radii(data), self.starting_rule)
        relative = self.rate(run) / self.fastest(data)
        return np.column_stack([play, play * relative[:, np.newaxis]])

    @property
    def operators_key(self) -> tuple[object, ...]:
        return (*super().operators_key, self.rate_time_constant)

    def _ends(self, data: TrainingData) -> tuple[Array, Array]:
        """Return the operators at both ends of the input's range, at rest."""
        lowest, highest = super()._ends(data)
        return np.pad(lowest, (0, lowest.size)), np.pad(highest, (0, highest.size))

    def first_part(self, weights: Array, offset: float, data: TrainingData) -> Block:
        n = self.n_operators
        return RateDependentPI(
            vector(self.radii(data)),
            vector(weights[n:] / self.fastest(data)),
            vector(weights[:n]),
            offset,
            self.rate_time_constant or 0.0,
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return a series, and bounds like those of the static model, with weights by rate inside."""
        template, lower, upper = super().parameter_bounds(data)
        n = self.n_operators
        low, high = data.input_range
        slope = (data.output_range[1] - data.output_range[0]) / (high - low)
        by_rate = RATE_SHARE * slope / self.fastest(data)
        lower[:n], upper[:n] = -by_rate, by_rate
        return template, lower, upper
