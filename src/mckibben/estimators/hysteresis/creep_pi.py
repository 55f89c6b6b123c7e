"""Identification of a Prandtl-Ishlinskii memory followed by an increasing map and visco-elastic creep.

Everything is identified jointly by variable projection: weights of the
operators, offset, compliances and time constants are searched, the map is solved for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.memoryless.logarithm import Logarithm
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.core.output_maps import PolynomialMap
from mckibben.estimators.core.separable import LEAST_REVERSIBLE, counting
from mckibben.estimators.hysteresis.creeping import CreepingEstimator, creep_moves, with_creep
from mckibben.estimators.hysteresis.pi import play_operators, spread

RAISED = 1e-5
"""Step either way, of the logarithm of what is added to the input, for its derivative."""


@dataclass(kw_only=True, repr=False, eq=False)
class CreepPIEstimator(CreepingEstimator):
    """Prandtl-Ishlinskii memory on the logarithm of the input, an increasing map, and creep.

    Parameters
    ----------
    map_size : int
        Degree of the increasing polynomial behind them.
    threshold_share : float
        The largest threshold, relative to half the range of the logarithm.
    """

    title = "Prandtl–Ishlinskii model with creep (CPI)"
    purpose = "rate"
    can = (
        "Asymmetric loops, minor loops, and creep: memory on log(pressure), an increasing "
        "map, visco-elastic elements."
    )
    cannot = "Its loops' shape does not change with rate or load; needs time."
    inverse_kind = "exact"
    quick = True
    param_grid: ClassVar[Grid] = {
        "n_operators": (4, 6, 8),
        "n_creep": (1, 2, 3),
    }
    makes = ("logarithm pi polynomial creep",)
    effort: ClassVar[float] = 1.0

    map_size: Annotated[int, Interval(ge=1, le=12)] = 6
    threshold_share: Annotated[float, Interval(gt=0, le=1)] = 1.0
    n_starts: Annotated[int, Ge(1)] = 8
    n_refined: Annotated[int, Ge(1)] = 3

    reach: ClassVar[tuple[float, float]] = (0.3, 0.1)
    search_evaluations: ClassVar[int] = 30  # the valleys are flat

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        return self.bounds_about(data, 20.0, ((), ()))

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return fading weights, on the logarithm and nearly on the input itself, with some creep."""
        lower, upper = self.bounds(data)
        n, k = self.n_operators, self.n_creep
        place = np.linspace(lower[n + 1 : n + 1 + k], upper[n + 1 : n + 1 + k], 5)[1:4]
        spreads = [np.array([place[min(1 + j, 2), j] for j in range(k)]), place[0]]
        guesses = []
        for fading in (0.5, 1.5):
            weights = np.maximum(np.exp(-fading * np.arange(n)), LEAST_REVERSIBLE)
            for offset in (lower[n] + 0.5, upper[n] - 1):
                for taus in spreads:
                    guesses.append(np.concatenate([weights, [offset], taus, np.full(k, 0.07)]))
        return guesses

    def memory(self, theta: Array, data: TrainingData) -> tuple[float, Array]:
        """Return the offset of the logarithm, and the thresholds on it."""
        offset = float(np.exp(theta[self.n_operators]))
        low, high = self._logs(offset, data)
        return offset, self.threshold_share * spread(self.n_operators, high - low, "even")

    @staticmethod
    def _logs(offset: float, data: TrainingData) -> tuple[float, float]:
        ends = Logarithm(offset).simulate(np.array(data.input_range))
        return float(ends[0]), float(ends[1])

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the map over the run's history, with their creep."""
        x, _ = self.argument(theta, run, data)
        crept = with_creep(
            PolynomialMap(self.map_size).pieces(x), *self.creep(theta), run.sample_time
        )
        return np.hstack([crept, self.begun(theta, run, data)])

    def argument(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        """Return the argument of the map, 0 to 1, and its derivatives by the relative weights."""
        weights = theta[: self.n_operators]
        offset, radii = self.memory(theta, data)
        low, high = self._logs(offset, data)
        operators = play_operators(
            Logarithm(offset).simulate(run.history), radii, self.starting_rule
        )
        bottom, top = float(weights @ (low - radii)), float(weights @ (high - radii))
        x = (operators @ weights - bottom) / (top - bottom)
        above = operators - (low - radii)
        return x, (above - x[:, np.newaxis] * (high - low)) / (top - bottom)

    def moves(self, theta: Array, linear: Array, data: TrainingData) -> Array:
        pieces = PolynomialMap(self.map_size)
        step = RAISED * (np.arange(theta.size) == self.n_operators)
        taus, compliances = self.tail(theta)
        linear, left = np.split(linear, [self.map_size])

        def of(run: Run) -> Array:
            x, by_weights = self.argument(theta, run, data)
            more, less = (self.argument(theta + way * step, run, data)[0] for way in (1.0, -1.0))
            by_offset = (more - less) / (2.0 * RAISED)
            slopes = pieces.slopes(x) @ linear
            at_once = slopes[:, np.newaxis] * np.column_stack([by_weights, by_offset])
            crept = with_creep(at_once, taus, compliances, run.sample_time)
            given = pieces.pieces(x) @ linear
            moved = creep_moves(given, taus, compliances, run.sample_time)
            if left.size:
                moved[:, : taus.size] += self.begun_moves(theta, left, run, data)
            return np.column_stack([crept, moved])

        return counting(data, of)

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return a little of every piece, so that the map increases everywhere."""
        low, high = data.output_range
        floor = np.full(matrix.shape[1], 1e-6 * (high - low))
        floor[self.map_size :] = -np.inf  # what is left of creep
        return floor

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Series:
        """Return the series: logarithm, memory, map and creep."""
        linear = linear[: self.map_size]
        weights = theta[: self.n_operators]
        raised, radii = self.memory(theta, data)
        low, high = self._logs(raised, data)
        bottom, top = float(weights @ (low - radii)), float(weights @ (high - radii))
        compliances = self.creep(theta)[1]
        given = data.inputs[0]
        result = data.outputs[0]
        scale = 1.0 / (top - bottom)
        parts = (
            Logarithm(raised, given, given),
            PI(
                vector(radii),
                vector(weights * scale),
                -bottom * scale,
                (low, high),
                self.starting_rule,
                given,
                result,
            ),
            PolynomialMap(self.map_size).build(
                linear, offset / (1.0 + compliances.sum()), 0.0, 1.0, result
            ),
            *self.creep_parts(theta, result),
        )
        return Series(parts)

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return the series solved for, and bounds that keep it valid."""
        template, lower, upper = super().parameter_bounds(data)
        # weights, compliances and time constants must stay positive
        n, k, values = self.n_operators, self.n_creep, template.pack()
        positive = [0, *range(1, n + 1), *range(values.size - 2 * k, values.size)]
        lower[positive] = np.maximum(lower[positive], 1e-3 * np.abs(values[positive]))
        return template, lower, upper
