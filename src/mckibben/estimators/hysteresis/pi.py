"""Identification of Prandtl-Ishlinskii models: classical, and extended unparallel (EUPI)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Len

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.eupi import EUPI, eupi_matrix
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.hysteresis.play_operators import play_matrix, started
from mckibben.blocks.runs import Run
from mckibben.errors import ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid, Operators
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.hysteresis.output_maps import PolynomialMap
from mckibben.numerics.tracker import Tracker


def spread(n: int, ends: tuple[float, float]) -> Array:
    """Return ``n`` thresholds from 0 to below half of a range.

    An operator of threshold r only moves when the input moves by more than 2 r after a reversal, so
    thresholds beyond half the range never move.

    Parameters
    ----------
    n : int
        Number of thresholds, at least 1.
    ends : (float, float)
        Of the range of what the operators act on.

    >>> spread(4, (1.0, 9.0)).tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    share = np.arange(n) / n
    return 0.5 * (ends[1] - ends[0]) * share


def play_operators(u: Array, radii: Array, rule: str) -> Array:
    """Return play operators over an input, shape (n, N)."""
    operators = np.empty((u.size, radii.size))
    u = np.ascontiguousarray(u)
    play_matrix(u, u, u, radii, started(radii, u[0], u[0], rule), operators)
    return operators


SHORTEST = 0.02
"""Shortest segment with a significant slope, relative to the longest branch."""


class PIEstimator(SeparableEstimator):
    """Classical Prandtl-Ishlinskii model by (non-negative) least squares.

    Everything is linear once thresholds are set, so the fit is a single exact solution. With
    ``method="slopes"`` the weights follow the rule of "Analysis and modeling of a pneumatic artificial
    muscle system", Eqs. (14), (15): the slope of every segment of a loop is the sum of the weights of
    the operators that move in it. The paper does not say on which branch; here it is over the longest
    rise and the longest fall on which operators begin to move in turn.

    Parameters
    ----------
    method : {"ls", "slopes"}
        Least squares, or the rule.
    n_operators : int
        Play operators, the one without dead zone included.
    thresholds : sequence of float, optional
        Thresholds themselves, instead.
    """

    title = "Prandtl–Ishlinskii model (PI)"
    purpose = "memory"
    can = "Symmetric loops with nonlocal memory, by least squares; the smallest code."
    cannot = "No asymmetry, no saturation, no rate, no creep."
    inverse_kind = "exact"
    quick = True
    param_grid: ClassVar[Grid] = {"n_operators": (5, 10, 20)}
    makes = ("pi",)
    effort = 0.01

    method: Literal["ls", "slopes"] = "ls"
    n_operators: Operators = 10
    thresholds: Annotated[Sequence[float], Len(1)] | None = None

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        if self.method == "slopes":
            return self._by_slopes(data)
        return super().identify(data, tracker)

    def radii(self, data: TrainingData) -> Array:
        """Return the thresholds to use, shape (number of operators,)."""
        if self.thresholds is not None:
            return np.asarray(self.thresholds, dtype=np.float64)
        return spread(self.n_operators, data.input_range)

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the play operators over the run, shape (n, N)."""
        return play_operators(run.u, self.radii(data), self.starting_rule)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> PI:
        radii = vector(self.radii(data))
        return PI(radii, vector(linear), offset, **self.common_fields(data))

    def _by_slopes(self, data: TrainingData) -> PI:
        """Cut the widest loop where its operators start to move, and difference slopes.

        A segment lasts from one operator's beginning to the next one's: the printed Delta r on a rise
        from rest, twice that after a reversal, where a play closes over 2 r. Printed weights are
        positive, and a loop that flattens would want others: its slopes are pooled until none is
        below the one before, which is their least-squares fit (isotonic regression).
        """
        from scipy.optimize import isotonic_regression

        radii = self.radii(data)
        lengths, rises = _segments(data, radii, self.starting_rule)
        slopes = rises / lengths
        if self.nonnegative:
            slopes = np.maximum(isotonic_regression(slopes, weights=lengths).x, 0.0)
        weights = np.diff(slopes, prepend=0.0)
        model = self.build(np.empty(0), weights, 0.0, data)
        outputs = data.simulated([model])[0]
        return self.build(np.empty(0), weights, float(np.mean(data.target - outputs)), data)


def _segments(data: TrainingData, radii: Array, rule: str) -> tuple[Array, Array]:
    """Return the changes of input and output in each segment of the widest loop, each of shape (N,).

    Of the longest rise and the longest fall together, among those on which operators begin to move one
    after the other, each from where it stood.
    """
    from mckibben.signals import branches

    longest = {1: 0.0, -1: 0.0}
    cut = {1: np.zeros((2, radii.size)), -1: np.zeros((2, radii.size))}
    for run in data.runs:
        states = play_operators(run.u, radii, rule)
        for start, stop, way in branches(run.u):
            if way == 0 or not run.counts[start:stop].all():
                continue
            travel = way * (run.u[start:stop] - run.u[start])
            begins = way * (states[start] - run.u[start]) + radii
            if travel.max() > longest[way] and np.all(np.diff(begins) > 0):
                longest[way] = float(travel.max())
                order = np.argsort(travel, kind="stable")
                edges = np.minimum([*begins, longest[way]], longest[way])
                rise = np.interp(edges, travel[order], way * run.y[start:stop][order])
                cut[way] = np.diff([edges, rise])
    lengths, rises = cut[1] + cut[-1]
    if not np.all(lengths > SHORTEST * max(longest.values())):
        raise ModelError(
            f"on no branch do operators with thresholds up to {radii[-1]:.3g} "
            f"{data.inputs[0].unit} begin to move in turn: the longest goes "
            f"{max(longest.values()):.3g}, and after a reversal it takes twice a threshold",
            remedy="use fewer operators, smaller thresholds, or `settings[method]=ls`",
        )
    return lengths, rises


CUBIC = PolynomialMap(3)


class EUPIEstimator(SeparableEstimator):
    """Extended unparallel Prandtl-Ishlinskii model by variable projection.

    The slope and the threshold ratio of the falling edge are searched; the weights and an increasing
    cubic without memory are solved for.

    Parameters
    ----------
    n_operators : int
        Unparallel play operators.
    """

    title = "Extended unparallel Prandtl–Ishlinskii model (EUPI)"
    purpose = "memory"
    can = "Asymmetric loops by edges of different slope and threshold."
    cannot = "One asymmetry for all operators; the inverse needs non-negative weights."
    inverse_kind = "solved"
    makes = ("eupi",)
    effort = 0.3

    n_operators: Operators = 10
    n_starts = 16

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the falling edge's slope and threshold ratio."""
        return np.array([0.3, 0.0]), np.array([3.0, 3.0])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return parallel edges, and slightly different ones."""
        return [np.array(edges) for edges in ([1.0, 1.0], [1.2, 0.8], [0.8, 1.2])]

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the cubic, then the operators, over the run."""
        x = np.ascontiguousarray(run.u - data.input_range[0])
        radii = spread(self.n_operators, data.input_range)
        operators = np.empty((x.size, radii.size))
        state = started(radii, x[0], x[0], self.starting_rule)
        eupi_matrix(x, theta[0], theta[1], radii, state, operators)
        return np.column_stack([CUBIC.pieces(x / data.input_span), operators])

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        """Return a small lower bound of every piece of the cubic, so that it increases."""
        return np.where(np.arange(matrix.shape[1]) < CUBIC.size, 1e-3 * data.output_span, 0.0)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> EUPI:
        radii, (slope, ratio) = vector(spread(self.n_operators, data.input_range)), theta.tolist()
        a, b, c = (CUBIC.powers(linear[:3])[1:] / data.input_span ** np.arange(1, 4)).tolist()
        fields = self.common_fields(data)
        return EUPI(radii, vector(linear[3:]), slope, ratio, (a, b, c), offset, **fields)
