"""Identification of modified Prandtl-Ishlinskii models: PI, static or rate-dependent, then a map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.pi import PI, RateDependentPI
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Operators
from mckibben.estimators.core.separable import LEAST_REVERSIBLE, SeparableEstimator, counting
from mckibben.estimators.hysteresis.output_maps import MAPS, OutputMap
from mckibben.estimators.hysteresis.pi import play_operators, spread
from mckibben.estimators.optimisers.linear import solve_linear
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.presets import preset

LEAST_PIECE = 1e-6
"""Least share of the output's range that a piece of an increasing map gives."""

RATE_SHARE = 0.5
"""Largest change of a weight by rate, relative to the largest weight, at the fastest input seen."""


@dataclass(kw_only=True, repr=False, eq=False)
class MPIEstimator(SeparableEstimator):
    """Modified Prandtl-Ishlinskii model: operators and a memoryless map, by variable projection.

    The weights of the operators are searched, scaled so that the PI part spans the output's range; the
    map behind them is solved for.

    Parameters
    ----------
    n_operators : int
        Play operators, the one without dead zone included.
    output_map : {"piecewise-linear", "polynomial", "free-polynomial", "odd-polynomial"}
        Map behind the operators. The first two increase, and so have an inverse, whatever the data;
        the last two are the papers' and may not.
    map_size : int
        Straight lines of the map, or degree of the polynomial.
    rate_dependent : bool
        Whether weights are linear in the rate of the input, as in "High-Precision Displacement and Force
        Hybrid Modeling of Pneumatic Artificial Muscle Using 3D PI-NARMAX Model", Eqs. (2) to (5).
    rate_time_constant : float, optional
        Time constant of the filter of the rate [s]; 0 as in the paper, which suits commanded inputs.
        Default: the best on the training data of none, 5 and 25 samples.
    """

    title = "Modified Prandtl–Ishlinskii model (MPI)"
    purpose = "memory"
    can = (
        "Prandtl-Ishlinskii memory behind an increasing map: asymmetric by saturation; small "
        "and quick."
    )
    cannot = (
        "Loops that are narrow at one end and wide at the other for other reasons than the "
        "map; no rate, no creep."
    )
    inverse_kind = "exact"
    quick = True
    default_for = "load"
    makes = ("pi polynomial",)
    effort: ClassVar[float] = 0.2

    n_operators: Operators = 10
    output_map: Literal["piecewise-linear", "polynomial", "free-polynomial", "odd-polynomial"] = (
        "polynomial"
    )
    map_size: Annotated[int, Interval(ge=1, le=50)] = 5
    rate_dependent: bool = False
    rate_time_constant: Annotated[float, Ge(0)] | None = None
    n_starts: Annotated[int, Ge(1)] = 8
    n_refined: Annotated[int, Ge(1)] = 3

    # Operators are computed once a fit, so there is nothing to gain from fewer inputs.
    searches_condensed: ClassVar[bool] = False

    @property
    def fixed_fields(self) -> tuple[str, ...]:
        """The offset of the operators' sum, which begins at the output's lowest."""
        return ("pi.offset", "rate-dependent-pi.offset")

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        if not self.rate_dependent:
            return super().identify(data, tracker)
        step = data.timed(instead=", or use mpi")
        if self.rate_time_constant is not None:
            return super().identify(data, tracker)
        values = [samples * step for samples in (0, 5, 25)]
        return self.best_of("rate_time_constant", values, data, tracker)

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

    @property
    def map(self) -> OutputMap:
        """The family of maps."""
        return MAPS[self.output_map](self.map_size)

    def radii(self, data: TrainingData) -> Array:
        """Return the thresholds, shape (n_operators,)."""
        return spread(self.n_operators, data.input_range)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the relative weights, then of those by rate relative to the fastest."""
        n = self.n_operators
        share = np.full(n * self.rate_dependent, RATE_SHARE)
        lower = np.zeros(n)
        lower[0] = LEAST_REVERSIBLE
        return np.concatenate([lower, -share]), np.concatenate([np.ones(n), share])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return the weights of the best PI model, and two even distributions, whatever the rate."""
        low, high = data.input_range
        radii = self.radii(data)
        matrix = counting(data, lambda run: play_operators(run.history, radii, self.starting_rule))
        weights, _ = solve_linear(matrix, data.target, nonnegative=True)
        top = weights.max() if weights.max() > 0 else 1.0
        fading = np.exp(-3 * radii / (high - low))
        reversible = np.where(radii == 0, 1.0, 0.1)
        by_rate = (0, self.n_operators * self.rate_dependent)
        return [np.pad(guess, by_rate) for guess in (weights / top, fading, reversible)]

    def operators(self, run: Run, data: TrainingData) -> Array:
        """Return play operators over the run's history, then these times the relative rate."""
        play = play_operators(run.history, self.radii(data), self.starting_rule)
        if not self.rate_dependent:
            return play
        relative = self.rate(run) / self.fastest(data)
        return np.column_stack([play, play * relative[:, np.newaxis]])

    def level(self, theta: Array, data: TrainingData) -> tuple[float, float]:
        """Return the lowest and highest value that the weighted operators take when static."""
        lowest, highest = self._ends(data)
        return float(theta @ lowest), float(theta @ highest)

    def _ends(self, data: TrainingData) -> tuple[Array, Array]:
        """Return the operators at rest when the input has only risen, at both ends of its range."""
        radii, by_rate = self.radii(data), (0, self.n_operators * self.rate_dependent)
        held = [end - radii for end in data.input_range]
        if self.starting_rule != "first_sample":
            held = [np.clip(0.0, end - radii, end + radii) for end in data.input_range]
        low, high = (np.pad(values, by_rate) for values in held)
        return low, high

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the map over the run's history."""
        return self._pieces(theta, self.operators(run, data), data)

    def matrix(self, theta: Array, data: TrainingData) -> Array:
        """Return the basis at the samples that count; the operators are computed only once."""
        return self._pieces(theta, self._operators(data), data)

    def _operators(self, data: TrainingData) -> Array:
        rate = (self.rate_dependent, self.rate_time_constant)
        key = ("operators", self.n_operators, self.initial, *rate)
        return data.once(key, lambda: counting(data, lambda run: self.operators(run, data)))

    def _pieces(self, theta: Array, operators: Array, data: TrainingData) -> Array:
        low, high = self.level(theta, data)
        return self.map.pieces((operators @ theta - low) / (high - low))

    def moves(self, theta: Array, linear: Array, data: TrainingData) -> Array:
        """Return the derivative of the map's argument times the slope of the map."""
        operators = self._operators(data)
        lowest, highest = self._ends(data)
        low, high = self.level(theta, data)
        x = (operators @ theta - low) / (high - low)
        moved = (operators - lowest - np.outer(x, highest - lowest)) / (high - low)
        return np.asarray((self.map.slopes(x) @ linear)[:, np.newaxis] * moved)

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return a little of every piece, so that the map increases everywhere."""
        span = data.output_range[1] - data.output_range[0]
        return np.full(matrix.shape[1], LEAST_PIECE * span)

    @property
    def solves_nonnegative(self) -> bool:
        """Whether the linear parameters may not be negative: for increasing maps only."""
        return self.nonnegative and self.output_map in ("piecewise-linear", "polynomial")

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Series:
        """Return the series, its PI part scaled to the output's range."""
        low, high = self.level(theta, data)
        bottom, top = data.output_range
        scale = (top - bottom) / (high - low)
        first = self.first_part(theta * scale, bottom - low * scale, data)
        channel = data.outputs[0]
        return Series((first, self.map.build(linear, offset, bottom, top, channel)))

    def first_part(self, weights: Array, offset: float, data: TrainingData) -> Block:
        """Return the hysteresis part."""
        n, radii = self.n_operators, vector(self.radii(data))
        fields = self.common_fields(data)
        if not self.rate_dependent:
            return PI(radii, vector(weights), offset, **fields)
        by_rate, tau = vector(weights[n:] / self.fastest(data)), self.rate_time_constant or 0.0
        return RateDependentPI(radii, by_rate, vector(weights[:n]), offset, tau, **fields)


RDPI = preset(
    MPIEstimator,
    "Rate-dependent modified Prandtl-Ishlinskii model by variable projection.",
    title="Rate-dependent Prandtl–Ishlinskii model (RDPI)",
    purpose="rate",
    can="Prandtl-Ishlinskii memory with weights that follow the rate.",
    cannot=(
        "Extrapolates badly beyond the rates seen; its inverse swings where weights by rate "
        "are strongly negative."
    ),
    caution="weights that follow the rate are arbitrary at other rates",
    inverse_kind="solved",
    quick=False,
    default_for=None,
    makes=("rate-dependent-pi polynomial",),
    needs_time=True,
    effort=0.9,
    rate_dependent=True,
)
