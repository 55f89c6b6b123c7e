"""Separable least squares: linear parameters are solved for, nonlinear ones searched.

This is variable projection: for every trial of the non-linear parameters the weights and the offset
are the exact (non-negative) least-squares solution, so the search runs in a handful of dimensions.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.memoryless import Negative
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Estimator, Start
from mckibben.numerics.descent import Errors, differences
from mckibben.numerics.least_squares import solve_bounded
from mckibben.numerics.multi_start import Choice, multi_start
from mckibben.numerics.tracker import Tracker

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

AT_BOUND = 1.01
"""Largest linear parameter, relative to its lower bound, that counts as held there."""

WORST = 1e150
"""Cost of parameters whose output overflows; its square is finite."""


class SeparableEstimator(Estimator):
    """Estimator of a block that is linear in its weights and offset.

    Parameters
    ----------
    initial : {"first_sample", "virgin"}
        Memory before the first sample of every recording: what its first output determines, else as if
        the input had only risen; or as if nothing had ever happened.
    nonnegative : bool
        Whether each linear parameter is at or above its `lower_bounds`: by default 0, the first a
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

    def output_jacobian(self, theta: Array, linear: Array, data: TrainingData) -> Array:
        """Return the derivative of the output by the nonlinear parameters, at fixed linear ones.

        Shape (samples that count, m); by finite differences of the basis.
        """
        lower, upper = self.bounds(data)
        steps = DIFFERENCE * (upper - lower)
        inside = np.where(theta + steps <= upper, steps, -steps)
        return differences(lambda moved: self.design_matrix(moved, data) @ linear, theta, inside)

    def jacobian(
        self, theta: Array, matrix: Array, linear: Array | None, data: TrainingData
    ) -> Array:
        """Return the derivatives of the projected residuals.

        Shape (samples that count, m). Kaufman's form: how the output moves, less what the linear
        parameters that are free would take up of it. Zero where nothing could be solved for.
        """
        if linear is None:
            return np.zeros((len(matrix), theta.size))
        moves = self.output_jacobian(theta, linear, data)
        directions = np.linalg.qr(self.free_regressors(matrix, linear, data))[0]
        return np.asarray(moves - directions @ (directions.T @ moves))

    def free_regressors(self, matrix: Array, linear: Array, data: TrainingData) -> Array:
        """Return the regressors of linear parameters away from bounds, the offset's first."""
        lower = AT_BOUND * self.lower_bounds(matrix, data) if self.bounds_linear else None
        free = linear != 0 if lower is None else linear > lower
        offset = [np.ones(len(matrix))] if self.fits_offset else []
        return np.column_stack([*offset, matrix[:, free]])

    def choices(self, data: TrainingData) -> list[Choice]:
        """Return alternatives for groups of nonlinear parameters; by default none."""
        return []

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the block for increasing data; mirrored for decreasing data."""
        if not (self.rises and data.falls):
            return self.identify(data, tracker)
        mirrored = data.changed(lambda run: replace(run, outputs=-run.outputs))
        channel = data.outputs[0]
        return Series((self.identify(mirrored, tracker), Negative(channel, channel)))

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the identified block.

        Where `rises`, the output of the data rises with the input.
        """
        theta = self._search(data, tracker)
        linear, offset = self.solve(self.design_matrix(theta, data), data)
        return self.build(theta, linear, offset, data)

    @property
    def most_evaluations(self) -> int:
        """Maximum number of evaluations of a refinement."""
        return self.search_evaluations

    def _search(self, data: TrainingData, tracker: Tracker) -> Array:
        """Return the nonlinear parameters, (m,), from many starts or a search on nearly these data."""
        lower, upper = ends = self.bounds(data)
        if lower.size == 0:
            return lower
        from scipy.stats import qmc

        theta = tracker.near
        if theta is None or theta.shape != lower.shape:
            thin = data.thinned(SEARCH_SAMPLES)
            if self.searches_condensed:
                thin = thin.changed(Run.condensed)
            most = self.most_evaluations
            tracker.budget = self.n_starts + self.n_refined * most
            exponent = int(np.ceil(np.log2(max(self.n_starts, 2))))
            points = qmc.Sobol(lower.size, seed=self.seed).random_base2(exponent)[: self.n_starts]
            starts = [*self.guesses(data), *qmc.scale(points, lower, upper)]
            theta = multi_start(
                self._errors(thin),
                starts,
                ends,
                tracker,
                n_refined=self.n_refined,
                max_evaluations=most,
                choices=self.choices(data),
            )
        tracker.near = multi_start(
            self._errors(data.thinned(POLISH_SAMPLES)),
            [theta],
            ends,
            tracker.part(0.9, 1.0),
            n_refined=1,
            max_evaluations=self.polish_evaluations,
        )
        return tracker.near

    def design_matrix(self, theta: Array, data: TrainingData) -> Array:
        """Return the regressors at the scored samples of all runs, shape (samples, k)."""
        return data.scored(lambda run: self.basis(theta, run, data))

    def solve(self, matrix: Array, data: TrainingData) -> tuple[Array, float]:
        """Return the least-squares linear parameters and offset."""
        lower = self.lower_bounds(matrix, data) if self.bounds_linear else None
        return solve_bounded(matrix, data.target, lower, with_offset=self.fits_offset)

    @property
    def fits_offset(self) -> bool:
        """Whether an offset is fitted; otherwise it is 0."""
        return True

    @property
    def bounds_linear(self) -> bool:
        """Whether the linear parameters have the lower bounds `lower_bounds`."""
        return self.nonnegative

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        """Return the lower bounds of the linear parameters, where `bounds_linear`.

        The first is kept off zero: it belongs to the operator without dead zone, and without it there
        is no inverse.
        """
        floor, reach = np.zeros(matrix.shape[1]), float(np.ptp(matrix[:, 0]))
        floor[0] = LEAST_REVERSIBLE * data.output_span / reach if reach > 0 else 0.0
        return floor

    def _errors(self, data: TrainingData) -> Errors:
        """Return the function from nonlinear parameters to errors, linear ones solved for.

        It returns the errors and a function to their derivatives, which cost more and are needed at few
        points only.
        """

        def errors(theta: Array) -> tuple[Array, Callable[[], Array]]:
            matrix = self.design_matrix(theta, data)
            linear, residuals = None, np.full(data.target.size, WORST)
            if np.isfinite(matrix).all():
                linear, offset = self.solve(matrix, data)
                residuals = np.asarray(matrix @ linear + offset - data.target)
            return residuals, lambda: self.jacobian(theta, matrix, linear, data)

        return errors

    def best_of(
        self, setting: str, values: Sequence[object], data: TrainingData, tracker: Tracker
    ) -> Block:
        """Return the block of smallest error over the values of a setting."""
        fits = []
        for k, value in enumerate(values):
            part = tracker.part(k / len(values), (k + 1) / len(values))
            settings = self.get_params() | {setting: value}
            fits.append((type(self)(**settings).identify(data, part), part))
        block, best = min(fits, key=lambda fit: fit[1].best_cost)
        tracker.best_cost, tracker.best = best.best_cost, best.best
        return block
