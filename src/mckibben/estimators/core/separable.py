"""Separable least squares: linear parameters are solved for, nonlinear ones searched.

This is variable projection: for every trial of the non-linear parameters the weights and the offset
are the exact (non-negative) least-squares solution, so the search runs in a handful of dimensions.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.derivatives import differences
from mckibben.blocks.memoryless import Negative
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Estimator, Start
from mckibben.estimators.optimisers.linear import solve_linear
from mckibben.estimators.optimisers.multi_start import Choice, multi_start
from mckibben.estimators.optimisers.tracker import Tracker

SEARCH_SAMPLES = 1500
"""Largest number of samples used to compare starts."""

POLISH_SAMPLES = 20_000
"""Largest number of samples used to refine the best start; linear parameters are then solved on all
samples.
"""

LEAST_REVERSIBLE = 1e-3
"""Smallest share of the output's range for the operator without dead zone."""

DIFFERENCE = 1e-7
"""Step of finite differences, relative to the range that a parameter is searched in."""

WORST = 1e150
"""Cost of parameters whose output overflows; its square is finite."""


@dataclass(kw_only=True, repr=False, eq=False)
class SeparableEstimator(Estimator):
    """Estimator of a block that is linear in its weights and offset.

    Parameters
    ----------
    input, output : str
        Channels to learn from.
    initial : {"first_sample", "virgin"}
        Memory before the first sample of every recording: what its first output determines, else as if
        the input had only risen; or as if nothing had ever happened.
    nonnegative : bool
        Whether each linear parameter is held at or above what `least` returns: by default 0, the first a
        little above it. Of most models that gives an inverse.
    n_starts : int
        Starting points tried for the non-linear parameters.
    n_refined : int
        How many of them, the most promising, are refined.
    """

    input: str = "pressure"
    output: str = "displacement"
    initial: Start = "first_sample"
    nonnegative: bool = True
    n_starts: Annotated[int, Ge(1)] = 48
    n_refined: Annotated[int, Ge(1)] = 4

    search_evaluations: ClassVar[int] = 15
    polish_evaluations: ClassVar[int] = 10
    """Maximum number of evaluations of a refinement, and of the final one on more samples."""

    searches_condensed: ClassVar[bool] = True
    """Whether the search may use turning points of the input only."""

    rises: ClassVar[bool] = True
    """Whether the block's output increases with its input; decreasing data are then mirrored."""

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the nonlinear parameters, each of shape (m,); by default none."""
        return np.empty(0), np.empty(0)

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return initial guesses of the nonlinear parameters, each of shape (m,)."""
        return []

    @abstractmethod
    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the regressors of the linear parameters over a run, shape (n, k)."""

    @abstractmethod
    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        """Return the block with these parameters."""

    def moves(self, theta: Array, linear: Array, data: TrainingData) -> Array:
        """Return the derivative of the output by the nonlinear parameters, at fixed linear ones.

        Shape (samples that count, m); by finite differences of the basis.
        """
        lower, upper = self.bounds(data)
        steps = DIFFERENCE * (upper - lower)
        inside = np.where(theta + steps <= upper, steps, -steps)
        return differences(lambda moved: self.matrix(moved, data) @ linear, theta, inside)

    def jacobian(
        self, theta: Array, matrix: Array, linear: Array | None, data: TrainingData
    ) -> Array:
        """Return the derivatives of the projected residuals.

        Shape (samples that count, m). Kaufman's form: how the output moves, less what the linear
        parameters that are free would take up of it. Zero where nothing could be solved for.
        """
        if linear is None:
            return np.zeros((len(matrix), theta.size))
        moves = self.moves(theta, linear, data)
        directions = np.linalg.qr(self.free(matrix, linear, data))[0]
        return np.asarray(moves - directions @ (directions.T @ moves))

    def free(self, matrix: Array, linear: Array, data: TrainingData) -> Array:
        """Return the regressors of linear parameters away from bounds, the offset's first."""
        free = linear > 1.01 * self.least(matrix, data) if self.solves_nonnegative else linear != 0
        offset = [np.ones(len(matrix))] if self.solves_offset else []
        return np.column_stack([*offset, matrix[:, free]])

    def choices(self, data: TrainingData) -> list[Choice]:
        """Return alternatives for groups of nonlinear parameters; by default none."""
        return []

    def find(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block for increasing data; mirrored for decreasing data."""
        if not (self.rises and data.falls):
            return self.identify(data, tracker), data
        rising = self.identify(data.negated(), tracker)
        channel = self.channels(data)["output"]
        return Series((rising, Negative(channel, channel))), data

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the identified block.

        Where `rises`, the output of the data rises with the input.
        """
        theta = self._search(data, tracker)
        linear, offset = self.solve(self.matrix(theta, data), data)
        return self.build(theta, linear, offset, data)

    def most_evaluations(self, size: int) -> int:
        """Return the maximum number of evaluations of a refinement."""
        return self.search_evaluations

    def _search(self, data: TrainingData, tracker: Tracker) -> Array:
        lower, upper = self.bounds(data)
        if lower.size == 0:
            return lower
        if tracker.near is not None and tracker.near.shape == lower.shape:
            tracker.near = self._polish(np.clip(tracker.near, lower, upper), data, tracker)
            return tracker.near
        thin = data.thinned(SEARCH_SAMPLES)
        if self.searches_condensed:
            thin = thin.condensed()
        most = self.most_evaluations(lower.size)
        tracker.budget = self.n_starts + self.n_refined * most
        residuals, jacobian = self._errors(thin)
        theta = multi_start(
            residuals,
            self.guesses(data) + self._scattered(lower, upper),
            lower,
            upper,
            tracker,
            n_refined=self.n_refined,
            max_evaluations=most,
            jacobian=jacobian,
            choices=self.choices(data),
        )
        tracker.near = self._polish(theta, data, tracker)
        return tracker.near

    def _scattered(self, lower: Array, upper: Array) -> list[Array]:
        from scipy.stats import qmc

        exponent = int(np.ceil(np.log2(max(self.n_starts, 2))))
        points = qmc.Sobol(lower.size, seed=self.seed).random_base2(exponent)[: self.n_starts]
        return list(qmc.scale(points, lower, upper))

    def _polish(self, theta: Array, data: TrainingData, tracker: Tracker) -> Array:
        lower, upper = self.bounds(data)
        if lower.size == 0:
            return theta
        residuals, jacobian = self._errors(data.thinned(POLISH_SAMPLES))
        own = tracker.part(0.9, 1.0)
        best = multi_start(
            residuals,
            [theta],
            lower,
            upper,
            own,
            n_refined=1,
            max_evaluations=self.polish_evaluations,
            jacobian=jacobian,
        )
        tracker.update_from(own)
        return best

    def matrix(self, theta: Array, data: TrainingData) -> Array:
        """Return the regressors at the scored samples of all runs, shape (samples, k)."""
        return counting(data, lambda run: self.basis(theta, run, data))

    def solve(self, matrix: Array, data: TrainingData) -> tuple[Array, float]:
        """Return the least-squares linear parameters and offset."""
        return solve_linear(
            matrix,
            data.target,
            nonnegative=self.solves_nonnegative,
            least=self.least(matrix, data),
            with_offset=self.solves_offset,
        )

    @property
    def solves_offset(self) -> bool:
        """Whether an offset is fitted; otherwise it is 0."""
        return True

    @property
    def solves_nonnegative(self) -> bool:
        """Whether the linear parameters must be non-negative."""
        return self.nonnegative

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return lower bounds of the linear parameters, if they must be non-negative.

        The first is kept off zero: it belongs to the operator without dead zone, and without it there
        is no inverse.
        """
        floor = np.zeros(matrix.shape[1])
        reach = float(np.ptp(matrix[:, 0]))
        span = data.output_range[1] - data.output_range[0]
        floor[0] = LEAST_REVERSIBLE * span / reach if reach > 0 else 0.0
        return floor

    def _solved(self, theta: Array, data: TrainingData) -> tuple[Array, Array | None, Array]:
        """Return regressors, linear parameters if finite, and residuals."""
        matrix = self.matrix(theta, data)
        if not np.isfinite(matrix).all():
            return matrix, None, np.full(data.target.size, WORST)
        linear, offset = self.solve(matrix, data)
        return matrix, linear, np.asarray(matrix @ linear + offset - data.target)

    def _errors(
        self, data: TrainingData
    ) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
        """Return functions for residuals and derivatives by the nonlinear parameters.

        A search asks for both at one place, where the linear parameters are solved for once.
        """

        @lru_cache(maxsize=1)
        def solved(place: bytes) -> tuple[Array, Array | None, Array]:
            return self._solved(np.frombuffer(place).copy(), data)

        def residuals(theta: Array) -> Array:
            return solved(theta.tobytes())[2]

        def jacobian(theta: Array) -> Array:
            return self.jacobian(theta, *solved(theta.tobytes())[:2], data)

        return residuals, jacobian

    def best_of(
        self, setting: str, values: Sequence[float], data: TrainingData, tracker: Tracker
    ) -> Block:
        """Return the block of smallest error over the values of a setting."""
        found = []
        for place, value in enumerate(values):
            own = tracker.part(place / len(values), (place + 1) / len(values))
            settings = self.get_params() | {setting: value}
            found.append((type(self)(**settings).identify(data, own), own))
            tracker.update_from(own)
        block, best = min(found, key=lambda item: item[1].best_cost)
        tracker.best_cost, tracker.best = best.best_cost, best.best
        return block


def counting(data: TrainingData, of_run: Callable[[Run], Array]) -> Array:
    """Return a quantity of every run, shape (n, ...), at the scored samples of all runs."""
    return np.concatenate([of_run(run)[run.counts] for run in data.runs])
