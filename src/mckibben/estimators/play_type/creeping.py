"""Visco-elastic creep behind play operators on a logarithm, searched with them.

Two things that rate-independent loops leave out of a pneumatic muscle: its friction grows with pressure,
so the play operators act on log(u + offset); and braid and rubber creep, so the output goes on moving
while the input is held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import Channel, vector
from mckibben.blocks.dynamic.creep import Creep, creep_kernel
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Operators
from mckibben.estimators.core.separable import LEAST_REVERSIBLE, SeparableEstimator, difference
from mckibben.estimators.optimisers.tracker import Tracker

FASTEST, SLOWEST = 3.0, 3.0
"""Of the time constants: samples, and durations of the longest run."""

MOST_CREEP = 0.3
"""Largest compliance of an element, relative to the immediate response."""


@dataclass(kw_only=True, repr=False, eq=False)
class CreepingEstimator(SeparableEstimator):
    """An estimator of play operators on the logarithm of the input, and of creep behind the rest.

    What is searched: relative weights of the operators, logarithm of what is added to the input, what
    lies between if anything, logarithms of the time constants, compliances.

    Parameters
    ----------
    n_operators : int
        Play operators, the one without dead zone included.
    n_creep : int
        Visco-elastic elements.
    """

    n_operators: Operators = 10
    n_creep: Annotated[int, Interval(ge=0, le=5)] = 2

    searches_condensed: ClassVar[bool] = False

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        if self.n_creep > 0:
            data.timed("creep depends on it", ", or use n_creep=0")
        return super().identify(data, tracker)

    def bounds_about(
        self, data: TrainingData, most: float, between: tuple[Sequence[float], Sequence[float]]
    ) -> tuple[Array, Array]:
        """Return bounds of all that is searched.

        Parameters
        ----------
        most : float
            Largest addition to the input, relative to its range.
        between : two sequences of float
            Bounds of what lies between.
        """
        n, k = self.n_operators, self.n_creep
        low, high = data.input_range
        least = np.log(max(0.01 * (high - low), 0.1 - low))
        step = data.sample_time or 1.0
        longest = max(run.u.size for run in data.runs) * step
        slow = np.log(max(SLOWEST * longest, 30 * step))
        lower = [*[0.0] * n, least, *between[0], *[np.log(FASTEST * step)] * k, *[0.0] * k]
        added = max(np.log(most * (high - low)), least + 1)
        upper = [*[1.0] * n, added, *between[1], *[slow] * k, *[MOST_CREEP] * k]
        lower[0] = LEAST_REVERSIBLE
        return np.array(lower), np.array(upper)

    def tail(self, theta: Array) -> tuple[Array, Array]:
        """Return time constants and compliances as they are searched."""
        taus, compliances = np.split(theta[theta.size - 2 * self.n_creep :], 2)
        return np.exp(taus), compliances

    def creep(self, theta: Array) -> tuple[Array, Array]:
        """Return time constants and compliances, the fastest first."""
        taus, compliances = self.tail(theta)
        order = np.argsort(taus, kind="stable")
        return taus[order], compliances[order]

    def creep_parts(self, theta: Array, channel: Channel) -> tuple[Block, ...]:
        """Return the block of the creep, if there is any."""
        taus, compliances = self.creep(theta)
        return (Creep(vector(compliances), vector(taus), channel, channel),) if taus.size else ()

    def raised(self, theta: Array, data: TrainingData) -> tuple[Array, float]:
        """Return theta with a little more added to the input, and how much."""
        n = self.n_operators
        step = difference(theta[n], self.bounds(data)[1][n])
        return theta + step * (np.arange(theta.size) == n), step


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
