"""Identification of a Prandtl-Ishlinskii memory followed by an increasing map and visco-elastic creep.

Two things that rate-independent loops leave out of a pneumatic muscle: its friction grows with pressure,
so the play operators act on log(u + offset); and braid and rubber creep, so the output goes on moving
while the input is held. Everything is identified jointly by variable projection: weights of the
operators, offset, compliances and time constants are searched, the map is solved for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Interval
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.creep import Creep, creep_kernel
from mckibben.blocks.fields import Channel, vector
from mckibben.blocks.logarithm import Logarithm
from mckibben.blocks.pi import PI
from mckibben.errors import DataError
from mckibben.estimators.base import Operators
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.output_maps import PolynomialMap
from mckibben.estimators.pi import play_operators
from mckibben.estimators.search import Tracker
from mckibben.estimators.separable import (
    LEAST_REVERSIBLE,
    SeparableEstimator,
    counting,
    difference,
)
from mckibben.estimators.thresholds import spread

Array = NDArray[np.float64]

FASTEST, SLOWEST = 3.0, 3.0
"""Of the time constants: samples, and durations of the longest run."""

MOST_CREEP = 0.3
"""Largest compliance of an element, relative to the immediate response."""


@dataclass(kw_only=True, repr=False, eq=False)
class CreepPIEstimator(SeparableEstimator):
    """Prandtl-Ishlinskii memory on the logarithm of the input, an increasing map, and creep.

    Parameters
    ----------
    n_operators : int
        Play operators, the one without dead zone included.
    map_size : int
        Degree of the increasing polynomial behind them.
    n_creep : int
        Visco-elastic elements.
    threshold_share : float
        The largest threshold, relative to half the range of the logarithm.
    """

    effort: ClassVar[float] = 1.0

    n_operators: Operators = 10
    map_size: Annotated[int, Interval(ge=1, le=12)] = 6
    n_creep: Annotated[int, Interval(ge=0, le=5)] = 2
    threshold_share: Annotated[float, Interval(gt=0, le=1)] = 1.0
    n_starts: Annotated[int, Ge(1)] = 8
    n_refined: Annotated[int, Ge(1)] = 3

    searches_condensed: ClassVar[bool] = False
    search_evaluations: ClassVar[int] = 30  # the valleys are flat

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it."""
        if data.sample_time is None and self.n_creep > 0:
            raise DataError(
                "the recordings have no time, and creep depends on it",
                remedy="read them with a time column or --rate, or use n_creep=0",
            )
        return super().identify(data, tracker)

    # theta is [relative weights, log offset, log time constants, compliances]

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the searched parameters."""
        n, k = self.n_operators, self.n_creep
        low, high = data.input_range
        least = np.log(max(0.01 * (high - low), 0.1 - low))
        step = data.sample_time or 1.0
        longest = max(run.u.size for run in data.runs) * step
        lower = [*[0.0] * n, least, *[np.log(FASTEST * step)] * k, *[0.0] * k]
        most = np.log(20 * (high - low))
        slow = np.log(max(SLOWEST * longest, 30 * step))
        upper = [*[1.0] * n, max(most, least + 1), *[slow] * k, *[MOST_CREEP] * k]
        lower[0] = LEAST_REVERSIBLE
        return np.array(lower), np.array(upper)

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

    def creep(self, theta: Array) -> tuple[Array, Array]:
        """Return time constants and compliances, the fastest first."""
        n, k = self.n_operators, self.n_creep
        taus, compliances = np.exp(theta[n + 1 : n + 1 + k]), theta[n + 1 + k :]
        order = np.argsort(taus, kind="stable")
        return taus[order], compliances[order]

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the map over the run's history, with their creep."""
        x, _ = self.argument(theta, run, data)
        return with_creep(
            PolynomialMap(self.map_size).pieces(x), *self.creep(theta), run.sample_time
        )

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
        """Return how the output moves with the non-linear parameters, the linear ones held."""
        n, k = self.n_operators, self.n_creep
        pieces = PolynomialMap(self.map_size)
        step = difference(theta[n], self.bounds(data)[1][n])
        raised = theta + step * (np.arange(theta.size) == n)

        def of(run: Run) -> Array:
            x, by_weights = self.argument(theta, run, data)
            by_offset = (self.argument(raised, run, data)[0] - x) / step
            slopes = pieces.slopes(x) @ linear
            at_once = slopes[:, np.newaxis] * np.column_stack([by_weights, by_offset])
            taus, compliances = np.exp(theta[n + 1 : n + 1 + k]), theta[n + 1 + k :]
            crept = with_creep(at_once, taus, compliances, run.sample_time)
            given = pieces.pieces(x) @ linear
            return np.column_stack([crept, creep_moves(given, taus, compliances, run.sample_time)])

        return counting(data, of)

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return a little of every piece, so that the map increases everywhere."""
        low, high = data.output_range
        return np.full(matrix.shape[1], 1e-6 * (high - low))

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Series:
        """Return the series: logarithm, memory, map and creep."""
        weights = theta[: self.n_operators]
        raised, radii = self.memory(theta, data)
        low, high = self._logs(raised, data)
        bottom, top = float(weights @ (low - radii)), float(weights @ (high - radii))
        taus, compliances = self.creep(theta)
        given = Channel(data.input, data.input_unit)
        result = Channel(data.output, data.output_unit)
        scale = 1.0 / (top - bottom)
        parts: list[Block] = [
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
        ]
        if self.n_creep:
            parts.append(Creep(vector(compliances), vector(taus), result, result))
        return Series(tuple(parts))

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return the series solved for at the first guess, and bounds about it that keep it valid."""
        theta = self.guesses(data)[0]
        template = self.build(theta, *self._solve(theta, data), data)
        values = template.pack()
        span = np.maximum(np.abs(values), 0.1 * np.abs(values).max())
        lower, upper = values - 0.3 * span, values + 0.3 * span
        # weights, compliances and time constants must stay positive
        n, k = self.n_operators, self.n_creep
        positive = [0, *range(1, n + 1), *range(values.size - 2 * k, values.size)]
        lower[positive] = np.maximum(lower[positive], 1e-3 * np.abs(values[positive]))
        return template, lower, upper


def with_creep(
    columns: Array, taus: Sequence[float] | Array, compliances: Array, step: float | None
) -> Array:
    """Return columns, shape (n, k), each with visco-elastic creep."""
    if len(taus) == 0:
        return columns
    assert step is not None
    coefficients = np.array([*np.exp(-step / np.asarray(taus)), *compliances])
    crept = np.empty_like(columns)
    for k in range(columns.shape[1]):
        state = np.full(len(taus), columns[0, k])
        given = np.ascontiguousarray(columns[:, k : k + 1])
        out = np.empty_like(given)
        creep_kernel(coefficients, state, given, out)
        crept[:, k] = out[:, 0]
    return crept


def creep_moves(given: Array, taus: Array, compliances: Array, step: float | None) -> Array:
    """Return how something with creep moves with log time constants, then compliances, (n, 2 k)."""
    from scipy.signal import lfilter

    if len(taus) == 0:
        return np.empty((given.size, 0))
    assert step is not None
    elements, by_time = [], []
    for tau, compliance in zip(taus, compliances, strict=True):
        crept = with_creep(given[:, np.newaxis], [tau], np.ones(1), step)[:, 0]
        elements.append(crept - given)
        late = compliance * step / tau * (elements[-1] - given)
        by_time.append(np.asarray(lfilter([1.0], [1.0, -np.exp(-step / tau)], late)))
    return np.column_stack([*by_time, *elements])
