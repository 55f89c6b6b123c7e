"""Identification of the generalized Prandtl-Ishlinskii model."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.envelopes import Envelope, PiecewiseLinear, Tanh
from mckibben.blocks.hysteresis.gpi import GPI, smallest_gap
from mckibben.blocks.hysteresis.play_operators import play_matrix, started
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.hysteresis.pi import spread

Shape = tuple[Array, Array, list[Array], Callable[[Array], list[Envelope]]]
"""Bounds of the shape parameters, initial guesses, and the envelopes, rising then falling."""


def tanh_shape(low: float, high: float, n_knots: int) -> Shape:
    """Return tangents, each by the logarithm of its slope and its centre."""
    span, centre = high - low, 0.5 * (low + high)

    def envelopes(shape: Array) -> list[Envelope]:
        pairs = zip(np.exp(shape[[0, 2]]).tolist(), shape[[1, 3]].tolist(), strict=True)
        return [Tanh(slope, -slope * middle) for slope, middle in pairs]

    slopes = np.log(np.array([1.0, 2.0, 4.0]) / span)
    guesses = [np.array([slope, centre, slope, centre - 0.02 * span]) for slope in slopes]
    lower, upper = [np.log(0.2 / span), low - span], [np.log(16 / span), high + span]
    return np.tile(lower, 2), np.tile(upper, 2), guesses, envelopes


def piecewise_linear_shape(low: float, high: float, n_knots: int) -> Shape:
    """Return lines between equally spaced knots by the logarithms of all their rises."""
    n = n_knots - 1

    def envelopes(shape: Array) -> list[Envelope]:
        knots, rises = vector(np.linspace(low, high, n_knots)), np.exp(shape).reshape(2, -1)
        heights = [np.cumsum(rise / rises[0].sum()) for rise in rises]
        return [PiecewiseLinear(knots, (0.0, *vector(height))) for height in heights]

    rises = np.ones(n), 0.2 + np.sin(np.pi * (np.arange(n) + 0.5) / n)
    guesses = [np.tile(np.log(rise / rise.sum()), 2) for rise in rises]
    middle = np.full(2 * n, -np.log(n))
    return middle - 4.0, middle + 2.0, guesses, envelopes


SHAPES = {"tanh": tanh_shape, "piecewise-linear": piecewise_linear_shape}

HEIGHTS = np.array([[-0.5], [0.0], [0.5]])
"""Initial heights of envelopes, relative to the largest expected."""


class GPIEstimator(SeparableEstimator):
    """Generalized Prandtl-Ishlinskii model by variable projection from many starts.

    Weights, and the common height of the envelopes, are solved for; the shapes of the envelopes and the
    gap between them are searched. Both envelopes increase and the falling one is never the lower, so
    that the model always has its exact inverse. The paper's start of the operators, f_r(p(0), 0), is
    ``initial="virgin"``.

    Parameters
    ----------
    n_operators : int
        N: operators with a dead zone.
    envelope : {"tanh", "piecewise-linear"}
        Shape of both envelopes.
    n_knots : int
        Knots of a piecewise-linear envelope.
    threshold_rule : {"envelope", "paper"}
        Thresholds spread over half the envelopes' range; or r_i = (i/N) p_max as in "Modeling and
        Compensation of Stiffness-Dependent Hysteresis Coupling Behavior ...", Eq. (7), where those
        beyond half the envelopes' range never move.
    """

    title = "Generalized Prandtl–Ishlinskii model (GPI)"
    purpose = "memory"
    can = "Asymmetric, saturating loops between two envelopes, minor loops with few weights."
    cannot = (
        "Where envelopes differ the output is constant after a reversal, even if the muscle's "
        "is not; no rate, no creep."
    )
    inverse_kind = "exact"
    quick = True
    param_grid: ClassVar[Grid] = {"n_operators": (5, 10, 15)}
    makes = ("gpi",)
    effort = 0.7

    n_operators: Annotated[int, Interval(ge=0, le=1000)] = 10
    envelope: Literal["tanh", "piecewise-linear"] = "tanh"
    n_knots: Annotated[int, Interval(ge=3, le=100)] = 6
    threshold_rule: Literal["envelope", "paper"] = "envelope"

    @property
    def fits_offset(self) -> bool:
        """Whether the envelopes' common height is fitted.

        Virgin operators are nearest to 0, wherever the envelopes are, so their height is searched.
        """
        return self.starting_rule != "virgin"

    def shape(self, data: TrainingData) -> Shape:
        """Return the parametrisation: shape, gap, and the height if it is searched."""
        lower, upper, guesses, envelopes = SHAPES[self.envelope](*data.input_range, self.n_knots)
        largest = float(np.abs(data.target).max())
        most = 1.0 + 2.0 * largest / max(data.output_span, 1e-12)
        heights = np.empty((1, 0)) if self.fits_offset else most * HEIGHTS
        end = 2.0 * most * np.ones(heights.shape[1])
        trials = product(heights, guesses, (0.0, 0.1))
        starts = [np.hstack([shape, gap, height]) for height, shape, gap in trials]
        return np.hstack([lower, 0.0, -end]), np.hstack([upper, 1.0, end]), starts, envelopes

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        return self.shape(data)[:2]

    def guesses(self, data: TrainingData) -> list[Array]:
        return self.shape(data)[2]

    def envelopes(self, theta: Array, data: TrainingData) -> tuple[Envelope, Envelope]:
        """Return both envelopes, ordered over the whole input range."""

        def made() -> tuple[Envelope, Envelope]:
            gap = theta.size - 2 + self.fits_offset
            rising, falling = self.shape(data)[3](theta[:gap])
            height = 0.0 if self.fits_offset else float(theta[-1])
            least, _ = smallest_gap(rising, falling, data.input_range)
            above = height + float(theta[gap]) - least + 1e-9
            return rising.shifted(height), falling.shifted(above)

        return data.latest("envelopes", theta, made)

    def radii(self, rising: Envelope, falling: Envelope, data: TrainingData) -> Array:
        """Return the thresholds, shape (N + 1,)."""
        low, high = data.input_range
        if self.threshold_rule == "paper" and self.n_operators > 0:
            return np.arange(self.n_operators + 1) / self.n_operators * high
        return spread(self.n_operators + 1, (float(rising(low)), float(falling(high))))

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the generalized play operators over the run, shape (n, N + 1)."""
        rising, falling = self.envelopes(theta, data)
        u, radii = np.ascontiguousarray(run.u), self.radii(rising, falling, data)
        up, down, operators = rising(u), falling(u), np.empty((u.size, radii.size))
        state = started(radii, up[0], down[0], self.starting_rule)
        play_matrix(u, up, down, radii, state, operators)
        return operators

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> GPI:
        """Return the GPI model; the offset becomes a common height of the envelopes."""
        rising, falling = self.envelopes(theta, data)
        height = offset / linear.sum() if linear.sum() != 0 else 0.0
        return GPI(
            vector(self.radii(rising, falling, data)),
            vector(linear),
            rising.shifted(height),
            falling.shifted(height),
            **self.common_fields(data),
        )
