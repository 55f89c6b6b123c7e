"""Identification of a Prandtl-Ishlinskii model with increasing map and viscoelastic creep.

Two things that rate-independent loops leave out of a pneumatic muscle: its friction grows with pressure,
so the play operators act on log(u + offset); and braid and rubber creep, so the output goes on moving
while the input is held. Everything is identified jointly by variable projection. The offset is searched
from the lowest pressure recorded on, so that absolute and gauge pressure give the same model.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.compose import Series
from mckibben.blocks.dynamics.creep import Creep, creep_matrix
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.memoryless import Logarithm
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid, Operators
from mckibben.estimators.core.separable import LEAST_REVERSIBLE, SeparableEstimator
from mckibben.estimators.hysteresis.output_maps import LEAST_PIECE, PolynomialMap
from mckibben.estimators.hysteresis.pi import play_operators, spread

RAISED = 1e-5
"""Step of the logarithm of the input offset, for its derivative."""

LEAST_ADDED, MOST_ADDED = 0.02, 20.0
"""Smallest and largest input of the logarithm at the lowest pressure, relative to the input range."""

FASTEST, SLOWEST = 3.0, 3.0
"""Bounds of the time constants: in samples, and in durations of the longest run."""

MOST_CREEP = 0.3
"""Largest compliance of an element, relative to the immediate response."""


class CreepPIEstimator(SeparableEstimator):
    """Prandtl-Ishlinskii memory on the logarithm of the input, an increasing map, and creep.

    What is searched: relative weights of the operators, the logarithm of what is added to the input,
    logarithms of the time constants, compliances; the map is solved for.

    Parameters
    ----------
    n_operators : int
        Play operators, the one without dead zone included.
    n_creep : int
        Visco-elastic elements.
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
    param_grid: ClassVar[Grid] = {"n_operators": (4, 6, 8), "n_creep": (1, 2, 3)}
    makes = ("logarithm pi polynomial creep",)
    effort = 1.0
    needs_time = True
    searches_condensed = False
    search_evaluations = 30  # the valleys are flat
    fixed_fields = ("pi.offset",)  # of the operators' sum, which starts at 0

    n_operators: Operators = 10
    n_creep: Annotated[int, Interval(ge=0, le=5)] = 2
    map_size: Annotated[int, Interval(ge=1, le=12)] = 6
    threshold_share: Annotated[float, Interval(gt=0, le=1)] = 1.0
    n_starts = 8
    n_refined = 3

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [weights, log addition, log time constants, compliances]."""
        n, k = self.n_operators, self.n_creep
        span = data.input_span
        least = np.log(LEAST_ADDED * span)
        step = data.timed()
        longest = max(run.u.size for run in data.runs) * step
        slow = np.log(max(SLOWEST * longest, 30 * step))
        lower = [*[0.0] * n, least, *[np.log(FASTEST * step)] * k, *[0.0] * k]
        added = max(np.log(MOST_ADDED * span), least + 1)
        upper = [*[1.0] * n, added, *[slow] * k, *[MOST_CREEP] * k]
        lower[0] = LEAST_REVERSIBLE
        return np.array(lower), np.array(upper)

    def tail(self, theta: Array) -> tuple[Array, Array]:
        """Return time constants and compliances in the order of the search."""
        taus, compliances = np.split(theta[theta.size - 2 * self.n_creep :], 2)
        return np.exp(taus), compliances

    def creep(self, theta: Array) -> tuple[Array, Array]:
        """Return time constants and compliances, fastest first."""
        taus, compliances = self.tail(theta)
        order = np.argsort(taus, kind="stable")
        return taus[order], compliances[order]

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return decreasing weights, on the logarithm and nearly on the input, with some creep."""
        lower, upper = self.bounds(data)
        n, k = self.n_operators, self.n_creep
        levels = np.linspace(lower[n + 1 : n + 1 + k], upper[n + 1 : n + 1 + k], 5)[1:4]
        spreads = [np.array([levels[min(1 + j, 2), j] for j in range(k)]), levels[0]]
        guesses = []
        for fading in (0.5, 1.5):
            weights = np.maximum(np.exp(-fading * np.arange(n)), LEAST_REVERSIBLE)
            for offset in (lower[n] + 0.5, upper[n] - 1):
                for taus in spreads:
                    guesses.append(np.concatenate([weights, [offset], taus, np.full(k, 0.07)]))
        return guesses

    def memory(self, theta: Array, data: TrainingData) -> tuple[float, Array, Array, Array]:
        """Return the logarithm's offset, its thresholds and range, and the operators' sums there."""
        offset = float(np.exp(theta[self.n_operators])) - data.input_range[0]
        ends = Logarithm(offset).simulate(np.array(data.input_range))
        radii = self.threshold_share * spread(self.n_operators, (ends[0], ends[1]))
        sums = [float(theta[: self.n_operators] @ (end - radii)) for end in ends]
        return offset, radii, ends, np.array(sums)

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the map over the run, with their creep."""
        x, _ = self.argument(theta, run, data)
        return with_creep(
            PolynomialMap(self.map_size).pieces(x), *self.creep(theta), run.sample_time
        )

    def argument(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        """Return the argument of the map, 0 to 1, and its derivatives by the relative weights."""
        offset, radii, (low, high), (bottom, top) = self.memory(theta, data)
        logarithm = Logarithm(offset).simulate(run.u)
        operators = play_operators(logarithm, radii, self.starting_rule)
        x = (operators @ theta[: self.n_operators] - bottom) / (top - bottom)
        above = operators - (low - radii)
        return x, (above - x[:, np.newaxis] * (high - low)) / (top - bottom)

    def output_jacobian(self, theta: Array, linear: Array, data: TrainingData) -> Array:
        pieces = PolynomialMap(self.map_size)
        step = RAISED * (np.arange(theta.size) == self.n_operators)
        taus, compliances = self.tail(theta)

        def of(run: Run) -> Array:
            x, by_weights = self.argument(theta, run, data)
            more, less = (self.argument(theta + way * step, run, data)[0] for way in (1.0, -1.0))
            by_offset = (more - less) / (2.0 * RAISED)
            slopes = pieces.slopes(x) @ linear
            at_once = slopes[:, np.newaxis] * np.column_stack([by_weights, by_offset])
            crept = with_creep(at_once, taus, compliances, run.sample_time)
            static = pieces.pieces(x) @ linear
            moves = creep_moves(static, taus, compliances, run.sample_time)
            return np.column_stack([crept, moves])

        return data.scored(of)

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        """Return a small lower bound of every piece, so that the map increases."""
        return np.full(matrix.shape[1], LEAST_PIECE * data.output_span)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Series:
        """Return the series: logarithm, memory, map and creep."""
        input_, output = data.inputs[0], data.outputs[0]
        added, radii, (low, high), (bottom, top) = self.memory(theta, data)
        weights, start = theta[: self.n_operators] / (top - bottom), float(-bottom / (top - bottom))
        rule, reach = self.starting_rule, (float(low), float(high))
        memory = PI(
            vector(radii), vector(weights), start, reach, initial=rule, input=input_, output=output
        )
        taus, compliances = self.creep(theta)
        settled = offset / (1.0 + compliances.sum())
        increasing = PolynomialMap(self.map_size).build(linear, settled, 0.0, 1.0, output)
        parts = (Logarithm(added, input_, input_), memory, increasing)
        if not taus.size:
            return Series(parts)
        creep = Creep(vector(compliances), vector(taus), "first_sample", output, output)
        return Series((*parts, creep))


def with_creep(
    columns: Array, taus: Sequence[float] | Array, compliances: Array, step: float | None
) -> Array:
    """Return columns, shape (n, k), each with viscoelastic creep."""
    if len(taus) == 0:
        return columns
    assert step is not None
    coefficients = np.array([*np.exp(-step / np.asarray(taus)), *compliances])
    columns = np.ascontiguousarray(columns)
    crept = np.empty_like(columns)
    creep_matrix(coefficients, columns, np.empty((len(taus), columns.shape[1])), crept)
    return crept


def creep_moves(inputs: Array, taus: Array, compliances: Array, step: float | None) -> Array:
    """Return derivatives of a creeping signal by log time constants, then compliances, (n, 2 k)."""
    from scipy.signal import lfilter

    if len(taus) == 0:
        return np.empty((inputs.size, 0))
    assert step is not None
    elements, by_time = [], []
    for tau, compliance in zip(taus, compliances, strict=True):
        crept = with_creep(inputs[:, np.newaxis], [tau], np.ones(1), step)[:, 0]
        elements.append(crept - inputs)
        late = compliance * step / tau * (elements[-1] - inputs)
        by_time.append(np.asarray(lfilter([1.0], [1.0, -np.exp(-step / tau)], late)))
    return np.column_stack([*by_time, *elements])
