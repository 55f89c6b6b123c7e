"""Identification of modified Prandtl-Ishlinskii models: PI, static or rate-dependent, then a map."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.pi import PI, RateDependentPI
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import InverseKind, Operators, Purpose
from mckibben.estimators.core.separable import LEAST_REVERSIBLE, SeparableEstimator
from mckibben.estimators.hysteresis.output_maps import LEAST_PIECE, MAPS, PolynomialMap
from mckibben.estimators.hysteresis.pi import play_operators, spread
from mckibben.numerics.least_squares import solve_bounded
from mckibben.numerics.tracker import Tracker

CROWDED = (1, 2, 4)
"""Exponents of the initial thresholds, as powers of their share of half the input range, if
thresholds are identified.
"""

MOST_BY_RATE = 5.0
"""The same where thresholds are identified, as is printed."""

MOST_STEPS = 150
"""Maximum number of evaluations of a refinement with identified thresholds."""

RAISED, LEAST_DISTANCE = 1e-7, 1e-9
"""Step of thresholds for derivatives, and their smallest distance, relative to the input range."""

RATE_SHARE = 0.5
"""Largest change of a weight by rate, relative to the largest weight, at the fastest recorded
input.
"""


class MPIEstimator(SeparableEstimator):
    """Modified Prandtl-Ishlinskii model: operators and a memoryless map, by variable projection.

    The weights of the operators are searched, scaled so that the PI part spans the output's range; the
    map behind them is solved for.

    Parameters
    ----------
    n_operators : int
        Play operators, the one without dead zone included.
    thresholds : {"spread", "identified"}
        Spread evenly below half the input's range; or searched there with the weights, as that paper's
        Section 4.1 does by least squares. The model printed in its Table 1, of 40 parameters, is
        ``rdpi`` with thresholds identified, nonnegative=False, output_map="free-polynomial",
        map_size=9 and rate_time_constant=0.
    nonnegative : bool
        Whether the map increases, where it can. Where thresholds are identified, also whether weights
        at rest may not be negative.
    output_map : {"polynomial", "free-polynomial"}
        Map behind the operators. The first increases whatever the data, and so has an inverse; the
        second is the papers', and may not.
    map_size : int
        Degree of the map.
    rate_dependent : bool
        Whether weights are linear in the rate of the input, as in "High-Precision Displacement and Force
        Hybrid Modeling of Pneumatic Artificial Muscle Using 3D PI-NARMAX Model", Eqs. (2) to (5).
    rate_time_constant : float, optional
        Time constant of the filter of the rate [s]; 0 as in the paper, which suits commanded inputs.
        Default: the best on the training data of none, 5 and 25 samples.
    """

    title = "Modified Prandtl–Ishlinskii model (MPI)"
    purpose: ClassVar[Purpose] = "memory"
    can = (
        "Prandtl-Ishlinskii memory behind an increasing map: asymmetric by saturation; small "
        "and quick."
    )
    cannot = (
        "Loops that are narrow at one end and wide at the other for other reasons than the "
        "map; no rate, no creep."
    )
    inverse_kind: ClassVar[InverseKind] = "exact"
    quick = True
    makes = ("pi polynomial",)
    effort = 0.2
    # operators are computed once a fit, so there is nothing to gain from fewer inputs
    searches_condensed = False
    # of the operators' sum, which starts at the output's lowest value
    fixed_fields = ("pi.offset", "rate-dependent-pi.offset")

    n_operators: Operators = 10
    thresholds: Literal["spread", "identified"] = "spread"
    output_map: Literal["polynomial", "free-polynomial"] = "polynomial"
    map_size: Annotated[int, Interval(ge=1, le=50)] = 5
    rate_dependent: bool = False
    rate_time_constant: Annotated[float, Ge(0)] | None = None
    n_starts = 8
    n_refined = 3

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        if not self.rate_dependent:
            return super().identify(data, tracker)
        step = data.timed()
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
        raw = np.diff(run.u, prepend=run.u[0]) / step
        return np.asarray(lfilter([1 - smoothing], [1, -smoothing], raw))

    def fastest(self, data: TrainingData) -> float:
        """Return the largest rate in the data, per second."""
        return data.latest(
            "fastest",
            np.array(self.rate_time_constant or 0.0),
            lambda: max(float(np.abs(self.rate(run)).max()) for run in data.runs),
        )

    @property
    def map(self) -> PolynomialMap:
        """The family of maps."""
        return MAPS[self.output_map](self.map_size)

    @property
    def identified(self) -> bool:
        """Whether thresholds are identified."""
        return self.thresholds == "identified"

    @property
    def n_further(self) -> int:
        """Number of identified thresholds."""
        return self.n_operators * self.identified

    @property
    def most_evaluations(self) -> int:
        """Maximum number of evaluations of a refinement, larger if thresholds are searched."""
        return MOST_STEPS if self.identified else self.search_evaluations

    def radii(self, theta: Array, data: TrainingData) -> Array:
        """Return the thresholds, shape (n_operators,)."""
        if not self.identified:
            return spread(self.n_operators, data.input_range)
        return np.asarray(0.5 * data.input_span * theta[-self.n_operators :])

    def weights(self, theta: Array) -> Array:
        """Return the relative weights, then the rate-dependent ones."""
        return theta[: self.n_operators * (1 + self.rate_dependent)]

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the relative weights, then of the rate-dependent ones.

        Then of thresholds that are identified, relative to half the input's range.
        """
        n = self.n_operators
        share = np.full(n * self.rate_dependent, MOST_BY_RATE if self.identified else RATE_SHARE)
        lower, none = np.zeros(n), np.zeros(n * self.identified)
        lower[0] = LEAST_REVERSIBLE
        if self.identified and not self.nonnegative:
            lower[:] = -1.0
        return np.concatenate([lower, -share, none]), np.concatenate([np.ones(n), share, none + 1])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return the weights of the best PI model, and two even distributions, without rate."""
        span, by_rate = data.input_span, np.zeros(self.n_operators * self.rate_dependent)
        even, guesses = spread(self.n_operators, data.input_range), []
        for power in CROWDED if self.identified else (1,):
            share = (2 * even / span) ** power
            radii = even if power == 1 else 0.5 * span * share
            plays = [play_operators(run.u, radii, self.starting_rule) for run in data.runs]
            matrix = np.concatenate(
                [p[run.counts] for p, run in zip(plays, data.runs, strict=True)]
            )
            weights, _ = solve_bounded(matrix, data.target, np.zeros(radii.size))
            top = weights.max() if weights.max() > 0 else 1.0
            fading = np.exp(-3 * radii / span)
            reversible = np.where(radii == 0, 1.0, 0.1)
            for guess in (weights / top, fading, reversible):
                guesses.append(np.concatenate([guess, by_rate, share[: self.n_further]]))
        return guesses

    def operators(self, radii: Array, run: Run, data: TrainingData) -> Array:
        """Return play operators over the run, then their products with the relative rate."""
        play = play_operators(run.u, radii, self.starting_rule)
        if not self.rate_dependent:
            return play
        relative = self.rate(run) / self.fastest(data)
        return np.column_stack([play, play * relative[:, np.newaxis]])

    def level(self, theta: Array, data: TrainingData) -> tuple[float, float]:
        """Return the lowest and highest value that the weighted operators take; see `_ends`."""
        lowest, highest = self._ends(theta, self._operators(theta, data), data)
        weights = self.weights(theta)
        return float(weights @ lowest), float(weights @ highest)

    def _ends(self, theta: Array, columns: Array, data: TrainingData) -> tuple[Array, Array]:
        """Return columns, operators first, at the ends of the map's argument.

        Where the input has only risen to the ends of its range, and rests there; of thresholds that are
        identified, where the weighted sum of the data is least and most.
        """
        if self.identified:
            weights = self.weights(theta)
            total = columns[:, : weights.size] @ weights
            return columns[np.argmin(total)], columns[np.argmax(total)]
        radii, by_rate = self.radii(theta, data), (0, self.n_operators * self.rate_dependent)
        ends_reached = [end - radii for end in data.input_range]
        if self.starting_rule != "first_sample":
            ends_reached = [np.clip(0.0, end - radii, end + radii) for end in data.input_range]
        low, high = (np.pad(values, by_rate) for values in ends_reached)
        return low, high

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the map over the run."""
        return self._pieces(theta, self.operators(self.radii(theta, data), run, data), data)

    def design_matrix(self, theta: Array, data: TrainingData) -> Array:
        """Return the basis at the scored samples; operators are computed only once."""
        return self._pieces(theta, self._operators(theta, data), data)

    def _operators(self, theta: Array, data: TrainingData) -> Array:
        radii = self.radii(theta, data)
        rate = (self.rate_dependent, self.rate_time_constant)
        key = ("operators", self.n_operators, self.initial, *rate)

        def computed() -> Array:
            return data.scored(lambda run: self.operators(radii, run, data))

        return data.latest(key, radii, computed)

    def _pieces(self, theta: Array, operators: Array, data: TrainingData) -> Array:
        low, high = self.level(theta, data)
        return self.map.pieces((operators @ self.weights(theta) - low) / (high - low))

    def output_jacobian(self, theta: Array, linear: Array, data: TrainingData) -> Array:
        """Return the derivative of the map's argument times the slope of the map."""
        operators, weights = self._operators(theta, data), self.weights(theta)
        columns = operators
        if self.identified:
            span = data.input_span
            radii = self.radii(theta, data) + RAISED * span
            there = data.scored(lambda run: self.operators(radii, run, data))
            by_radii = weights * (there - operators) / (RAISED * span) * (0.5 * span)
            by_radii = by_radii.reshape(len(operators), -1, self.n_operators).sum(axis=1)
            columns = np.column_stack([operators, by_radii])
        lowest, highest = self._ends(theta, columns, data)
        low, high = self.level(theta, data)
        x = (operators @ weights - low) / (high - low)
        moves = (columns - lowest - np.outer(x, highest - lowest)) / (high - low)
        return np.asarray((self.map.slopes(x) @ linear)[:, np.newaxis] * moves)

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        """Return a small lower bound of every piece, so that the map increases."""
        return np.full(matrix.shape[1], LEAST_PIECE * data.output_span)

    @property
    def bounds_linear(self) -> bool:
        """Whether linear parameters must be non-negative: for an increasing map only."""
        return self.nonnegative and self.output_map == "polynomial"

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Series:
        """Return the series, its PI part scaled to the output's range."""
        low, high = self.level(theta, data)
        bottom, top = data.output_range
        scale = (top - bottom) / (high - low)
        first = self.first_part(theta, scale, bottom - low * scale, data)
        channel = data.outputs[0]
        return Series((first, self.map.build(linear, offset, bottom, top, channel)))

    def first_part(self, theta: Array, scale: float, offset: float, data: TrainingData) -> Block:
        """Return the hysteresis part, with sorted distinct thresholds."""
        n, radii = self.n_operators, self.radii(theta, data)
        weights = (scale * self.weights(theta)).reshape(-1, n)
        if self.identified:
            order = np.argsort(radii, kind="stable")
            least = LEAST_DISTANCE * data.input_span * np.arange(n)
            radii = np.maximum.accumulate(radii[order] - least) + least
            weights = weights[:, order]
        static, thresholds = vector(weights[0]), vector(radii)
        fields = self.common_fields(data)
        if not self.rate_dependent:
            return PI(thresholds, static, offset, **fields)
        by_rate, tau = vector(weights[1] / self.fastest(data)), self.rate_time_constant or 0.0
        return RateDependentPI(thresholds, by_rate, static, offset, tau, **fields)


class RDPIEstimator(MPIEstimator):
    """Rate-dependent modified Prandtl-Ishlinskii model by variable projection."""

    title = "Rate-dependent Prandtl–Ishlinskii model (RDPI)"
    purpose = "rate"
    can = "Prandtl-Ishlinskii memory with weights that follow the rate."
    cannot = (
        "Extrapolates badly beyond the recorded rates; its inverse oscillates where weights by rate "
        "are strongly negative."
    )
    caution = "weights that follow the rate are arbitrary at other rates"
    inverse_kind = "solved"
    quick = False
    makes = ("rate-dependent-pi polynomial",)
    needs_time = True
    effort = 0.9
    rate_dependent = True
