"""Identification of the generalised Prandtl-Ishlinskii model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.envelopes import Envelope, Exponential, PiecewiseLinear, Tanh
from mckibben.blocks.hysteresis.gpi import GPI, smallest_gap
from mckibben.blocks.hysteresis.play_operators import play_matrix, started
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.hysteresis.pi import Spacing, spread


class Shape(NamedTuple):
    """How a pair of envelopes is parametrised for the search, up to height and scale."""

    lower: list[float]
    upper: list[float]
    """Bounds of the shape parameters of both envelopes."""

    guesses: list[list[float]]
    """Sensible shape parameters."""

    envelopes: Callable[[Array], list[Envelope]]
    """Gives the rising and the falling envelope of shape parameters."""


def tanh_shape(low: float, high: float, n_knots: int) -> Shape:
    """Return the shape of tangents: the logarithm of the slope and the centre of each."""
    span, centre = high - low, 0.5 * (low + high)

    def envelopes(shape: Array) -> list[Envelope]:
        slopes, centres = np.exp(shape[[0, 2]]).tolist(), shape[[1, 3]].tolist()
        return [Tanh(a, -a * c) for a, c in zip(slopes, centres, strict=True)]

    return Shape(
        [np.log(0.2 / span), low - span] * 2,
        [np.log(16 / span), high + span] * 2,
        [
            [np.log(steepness / span), centre, np.log(steepness / span), centre - 0.02 * span]
            for steepness in (1.0, 2.0, 4.0)
        ],
        envelopes,
    )


def exponential_shape(low: float, high: float, n_knots: int) -> Shape:
    """Return the shape of exponentials: both rates, and the logarithm of their relative steepness.

    The rising one has unit mean slope over the range.
    """
    span = high - low

    def envelopes(shape: Array) -> list[Envelope]:
        found: list[Envelope] = []
        for rate, steepness in ((shape[0], 0.0), (shape[1], shape[2])):
            bent = float(np.copysign(max(abs(rate), 1e-3 / span), rate))
            rise = abs(np.exp(-bent * low) - np.exp(-bent * high))
            found.append(Exponential(bent, float(steepness - np.log(rise))))
        return found

    return Shape(
        [-4 / span, -4 / span, -1.5],
        [4 / span, 4 / span, 1.5],
        [[rate / span, rate / span, 0.0] for rate in (-1.5, -0.5, 0.5, 1.5)],
        envelopes,
    )


def piecewise_linear_shape(low: float, high: float, n_knots: int) -> Shape:
    """Return the shape of lines between equally spaced knots: the logarithms of all their rises.

    The rising envelope's rises are scaled to add up to one.
    """
    n = n_knots - 1
    middle, places = -np.log(n), (np.arange(n) + 0.5) / n

    def envelopes(shape: Array) -> list[Envelope]:
        knots, rises = vector(np.linspace(low, high, n_knots)), np.exp(shape).reshape(2, -1)
        heights = [np.cumsum(rise / rises[0].sum()) for rise in rises]
        return [PiecewiseLinear(knots, (0.0, *vector(height))) for height in heights]

    return Shape(
        [middle - 4.0] * 2 * n,
        [middle + 2.0] * 2 * n,
        [
            np.tile(np.log(rise / rise.sum()), 2).tolist()
            for rise in (np.ones(n), 0.2 + np.sin(np.pi * places))
        ],
        envelopes,
    )


SHAPES: dict[str, Callable[[float, float, int], Shape]] = {
    "tanh": tanh_shape,
    "piecewise-linear": piecewise_linear_shape,
    "exponential": exponential_shape,
}


@dataclass(kw_only=True, repr=False, eq=False)
class GPIEstimator(SeparableEstimator):
    """Generalised Prandtl-Ishlinskii model by variable projection from many starts.

    The weights, and the common height of the envelopes, are solved for; the shapes of the envelopes
    and the gap between them are searched. Both envelopes increase and the falling one never runs below
    the rising one, whatever the search tries, so that the model always has its exact inverse.

    The paper's start of the operators, f_r(p(0), 0), is ``initial="virgin"``. Its Algorithm 1 starts the
    search from weights and envelopes of 0, where every operator stays at 0 and no derivative tells a
    way out; the search here starts from increasing envelopes.

    Parameters
    ----------
    n_operators : int
        N: operators with a dead zone, beside the one without.
    envelope : {"tanh", "piecewise-linear", "exponential"}
        Shape of both envelopes.
    n_knots : int
        Knots of a piecewise-linear envelope.
    threshold_rule : {"envelope", "paper"}
        Thresholds spread over half the envelopes' range; or r_i = (i/N) p_max as in "Modeling and
        Compensation of Stiffness-Dependent Hysteresis Coupling Behavior ...", Eq. (7), where those
        beyond half the envelopes' range never move.
    spacing : {"even", "dense"}
        How thresholds spread under the first rule.
    """

    title = "Generalised Prandtl–Ishlinskii model (GPI)"
    purpose = "memory"
    can = "Asymmetric, saturating loops between two envelopes, minor loops by few weights."
    cannot = (
        "Where envelopes differ the output holds after a reversal, whether or not the muscle "
        "does; no rate, no creep."
    )
    inverse_kind = "exact"
    quick = True
    param_grid: ClassVar[Grid] = {"n_operators": (5, 10, 15)}
    makes = ("gpi",)
    effort: ClassVar[float] = 0.7

    n_operators: Annotated[int, Interval(ge=0, le=1000)] = 10
    envelope: Literal["tanh", "piecewise-linear", "exponential"] = "tanh"
    n_knots: Annotated[int, Interval(ge=3, le=100)] = 6
    threshold_rule: Literal["envelope", "paper"] = "envelope"
    spacing: Spacing = "even"

    def shape(self, data: TrainingData) -> Shape:
        """Return how the envelopes are parametrised for the search."""
        return SHAPES[self.envelope](*data.input_range, self.n_knots)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the envelopes' shapes, the gap between them, and a virgin one's height."""
        shape = self.shape(data)
        highest = [] if self.solves_offset else [2.0 * self.highest(data)]
        lowest = [-height for height in highest]
        return np.array([*shape.lower, 0.0, *lowest]), np.array([*shape.upper, 1.0, *highest])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return near-equal envelopes of a few curvatures."""
        heights: list[list[float]] = [[]]
        if not self.solves_offset:
            heights = [[share * self.highest(data)] for share in (-0.5, 0.0, 0.5)]
        return [
            np.array([*shape, gap, *height])
            for height in heights
            for shape in self.shape(data).guesses
            for gap in (0.0, 0.1)
        ]

    @property
    def solves_offset(self) -> bool:
        """Whether the envelopes' common height is solved for: it is where the start moves with it.

        Virgin operators are nearest to 0, wherever the envelopes are, so their height is searched.
        """
        return self.starting_rule != "virgin"

    def highest(self, data: TrainingData) -> float:
        """Return how far the middle of the envelopes may be from 0, in heights of theirs."""
        low, high = data.output_range
        return 1.0 + 2.0 * max(abs(low), abs(high)) / max(high - low, 1e-12)

    def envelopes(self, theta: Array, data: TrainingData) -> tuple[Envelope, Envelope]:
        """Return both envelopes, in order over the whole input range."""

        def made() -> tuple[Envelope, Envelope]:
            n = theta.size - 1 if self.solves_offset else theta.size - 2
            rising, falling = self.shape(data).envelopes(theta[:n])
            gap, _ = smallest_gap(rising, falling, data.input_range)
            height = 0.0 if self.solves_offset else float(theta[-1])
            above = height + float(theta[n]) - gap + 1e-9
            return rising.shifted(height), falling.shifted(above)

        return data.latest("envelopes", theta, made)

    def radii(self, rising: Envelope, falling: Envelope, data: TrainingData) -> Array:
        """Return the thresholds, shape (N + 1,)."""
        low, high = data.input_range
        if self.threshold_rule == "paper" and self.n_operators > 0:
            return np.arange(self.n_operators + 1) / self.n_operators * high
        return spread(self.n_operators + 1, float(falling(high) - rising(low)), self.spacing)

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the generalised play operators over the run's history, shape (n, N + 1)."""
        rising, falling = self.envelopes(theta, data)
        u, radii = np.ascontiguousarray(run.history), self.radii(rising, falling, data)
        up, down = rising(u), falling(u)
        operators = np.empty((u.size, radii.size))
        play_matrix(
            u, up, down, radii, started(radii, up[0], down[0], self.starting_rule), operators
        )
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
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )
