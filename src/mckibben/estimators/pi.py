"""Identification of the classical Prandtl-Ishlinskii model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Len
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.memory import named_state
from mckibben.blocks.pi import PI
from mckibben.blocks.play import play_matrix
from mckibben.errors import DataError, ModelError
from mckibben.estimators.base import Operators
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.search import Tracker
from mckibben.estimators.separable import SeparableEstimator
from mckibben.estimators.thresholds import spread

Array = NDArray[np.float64]


@dataclass(kw_only=True, repr=False, eq=False)
class PIEstimator(SeparableEstimator):
    """Classical Prandtl-Ishlinskii model by (non-negative) least squares.

    Everything is linear once thresholds are set, so the fit is a single exact solution. With
    ``method="slopes"`` the weights follow the rule of "Analysis and modeling of a pneumatic artificial
    muscle system", Eqs. (14), (15): the slope of every segment of a rising branch is the sum of the
    weights of the operators that move in it.

    Parameters
    ----------
    n_operators : int
        Play operators, the one without dead zone included.
    spacing : {"even", "dense"}
        How thresholds spread over half the input range.
    thresholds : sequence of float, optional
        Thresholds themselves, instead.
    """

    effort: ClassVar[float] = 0.01

    method: Literal["ls", "pso-ls", "pso", "slopes"] = "ls"  # type: ignore[assignment]
    n_operators: Operators = 10
    spacing: Literal["even", "dense"] = "even"
    thresholds: Annotated[Sequence[float], Len(1)] | None = None

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it."""
        if self.method == "slopes":
            return self._by_slopes(data), data
        return super().identify(data, tracker)

    def radii(self, data: TrainingData) -> Array:
        """Return the thresholds to use, shape (number of operators,)."""
        if self.thresholds is not None:
            return np.asarray(self.thresholds, dtype=np.float64)
        low, high = data.input_range
        return spread(self.n_operators, high - low, self.spacing)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return nothing: every parameter is linear."""
        del data
        return np.empty(0), np.empty(0)

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return nothing to guess."""
        del data
        return []

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the play operators over the run's history, shape (n, N)."""
        del theta
        return play_operators(run.history, self.radii(data), self.starting_rule)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> PI:
        """Return the PI model."""
        del theta
        return PI(
            vector(self.radii(data)),
            vector(linear),
            offset,
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return a PI model, and weights up to twice the mean slope of the data."""
        radii = self.radii(data)
        template = self.build(np.empty(0), np.zeros(radii.size), 0.0, data)
        low, high = data.output_range
        span = high - low
        slope = span / (data.input_range[1] - data.input_range[0])
        lower = np.array([*([0.0] * radii.size), low - span])
        return template, lower, np.array([*([slope] * radii.size), high])

    def _by_slopes(self, data: TrainingData) -> PI:
        """Cut the longest rising branch where its operators start to move, and difference slopes."""
        radii = self.radii(data)
        run, start, stop = _longest_rise(data)
        u, y = run.u[start:stop], run.y[start:stop]
        order = np.argsort(u, kind="stable")
        edges = np.append(u.min() + 2 * radii, u.max())
        if edges[-1] <= edges[-2]:
            raise ModelError(
                f"the longest rising branch covers {np.ptp(u):.3g} {data.input_unit}, too short for a "
                f"threshold of {radii[-1]:.3g}. Remedy: use fewer operators or smaller thresholds."
            )
        heights = np.interp(edges, u[order], y[order])
        slopes = np.diff(heights) / np.diff(edges)
        weights = np.diff(slopes, prepend=0.0)
        model = self.build(np.empty(0), weights, 0.0, data)
        outputs = np.concatenate([model.simulate(r.u)[r.counts] for r in data.runs])
        return self.build(np.empty(0), weights, float(np.mean(data.target - outputs)), data)


def play_operators(u: Array, radii: Array, rule: str) -> Array:
    """Return play operators side by side over an input, shape (n, N)."""
    operators = np.empty((u.size, radii.size))
    play_matrix(np.ascontiguousarray(u), radii, named_state(rule, radii, u[0], u[0]), operators)
    return operators


def _longest_rise(data: TrainingData) -> tuple[Run, int, int]:
    """Return the run and the samples of the branch that rises furthest, all of it counting.

    A rise after a fall goes before one at the start of a run, where operators may all have risen
    already and there are no slopes to tell them apart by.
    """
    from mckibben.signals import branches

    best: tuple[tuple[bool, float], Run, int, int] | None = None
    for run in data.runs:
        for start, stop, direction in branches(run.u):
            height = (start > 0, float(np.ptp(run.u[start:stop])))
            if (
                direction > 0
                and run.counts[start:stop].all()
                and (best is None or height > best[0])
            ):
                best = (height, run, start, stop)
    if best is None:
        raise DataError(
            "the input never rises, so there is no branch to take slopes from",
            channel=data.input,
            remedy="use method=ls, or a recording with a rising branch",
        )
    return best[1:]
