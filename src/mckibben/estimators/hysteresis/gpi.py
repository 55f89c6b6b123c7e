"""Identification of the generalised Prandtl-Ishlinskii model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.envelopes import Envelope, Exponential, PiecewiseLinear, Tanh
from mckibben.blocks.hysteresis.gpi import GPI, gpi_matrix, smallest_gap
from mckibben.blocks.hysteresis.play_operators import started
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.hysteresis.pi import Spacing, spread

Range = tuple[float, float]


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

    @property
    def shape(self) -> EnvelopeShape:
        """How the envelopes are parametrised for the search."""
        return SHAPES[self.envelope](self.n_knots)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the envelopes' shapes, the gap between them, and a virgin one's height."""
        lower, upper = self.shape.bounds(data.input_range)
        highest = [] if self.solves_offset else [2.0 * self.highest(data)]
        return (
            np.concatenate([lower, [0.0], -np.array(highest)]),
            np.concatenate([upper, [1.0], highest]),
        )

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return near-equal envelopes of a few curvatures."""
        shapes = self.shape.guesses(data.input_range)
        heights: list[list[float]] = [[]]
        if not self.solves_offset:
            heights = [[share * self.highest(data)] for share in (-0.5, 0.0, 0.5)]
        return [
            np.concatenate([shape, [gap], height])
            for height in heights
            for shape in shapes
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
            rising, falling = self.shape.envelopes(theta[:n], data.input_range)
            gap, _ = smallest_gap(rising, falling, data.input_range)
            height = 0.0 if self.solves_offset else float(theta[-1])
            return (
                rising.shifted(height),
                falling.shifted(height + float(theta[n]) - gap + 1e-9),
            )

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
        return gpi_operators(
            run.history, rising, falling, self.radii(rising, falling, data), self.starting_rule
        )

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> GPI:
        """Return the GPI model; the offset becomes a common height of the envelopes."""
        rising, falling = self.envelopes(theta, data)
        radii = self.radii(rising, falling, data)
        height = offset / linear.sum() if linear.sum() != 0 else 0.0
        return GPI(
            vector(radii),
            vector(linear),
            rising.shifted(height),
            falling.shifted(height),
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return a GPI model, with bounds wide enough for any loop that fills the data's ranges."""
        guess = self.guesses(data)[0]
        rising, falling = self.envelopes(guess, data)
        radii = self.radii(rising, falling, data)
        template = self.build(guess, np.ones(radii.size), 0.0, data)
        low, high = self.shape.parameter_bounds(data.input_range)
        span = data.output_range[1] - data.output_range[0]
        heaviest = [0.5 * span] * radii.size
        return (
            template,
            np.concatenate([np.zeros(radii.size), low, low]),
            np.concatenate([heaviest, high, high]),
        )


def gpi_operators(u: Array, rising: Envelope, falling: Envelope, radii: Array, rule: str) -> Array:
    """Return generalised play operators side by side over an input, shape (n, N)."""
    u = np.ascontiguousarray(u)
    up, down = rising(u), falling(u)
    operators = np.empty((u.size, radii.size))
    gpi_matrix(u, up, down, radii, started(radii, up[0], down[0], rule), operators)
    return operators


class EnvelopeShape(ABC):
    """How a pair of envelopes is parametrised for the search, up to height and scale."""

    def __init__(self, n_knots: int) -> None:
        self.n_knots = n_knots

    @abstractmethod
    def bounds(self, input_range: Range) -> tuple[Array, Array]:
        """Return bounds of the shape parameters of both envelopes."""

    @abstractmethod
    def guesses(self, input_range: Range) -> list[Array]:
        """Return sensible shape parameters of both envelopes."""

    @abstractmethod
    def envelopes(self, shape: Array, input_range: Range) -> tuple[Envelope, Envelope]:
        """Return both envelopes."""

    @abstractmethod
    def parameter_bounds(self, input_range: Range) -> tuple[Array, Array]:
        """Return bounds of one envelope's own parameters, as its ``pack`` orders them."""


class TanhShape(EnvelopeShape):
    """Steepness (as a logarithm) and centre of each tangent."""

    def bounds(self, input_range: Range) -> tuple[Array, Array]:
        """Return bounds of [log slope, centre] twice."""
        low, high = input_range
        span = high - low
        lower, upper = [np.log(0.2 / span), low - span], [np.log(16 / span), high + span]
        return np.array(lower * 2), np.array(upper * 2)

    def guesses(self, input_range: Range) -> list[Array]:
        """Return centred tangents of a few slopes."""
        low, high = input_range
        span, centre = high - low, 0.5 * (low + high)
        slopes = [np.log(steepness / span) for steepness in (1.0, 2.0, 4.0)]
        return [np.array([slope, centre, slope, centre - 0.02 * span]) for slope in slopes]

    def envelopes(self, shape: Array, input_range: Range) -> tuple[Envelope, Envelope]:
        slopes, centres = np.exp(shape[[0, 2]]).tolist(), shape[[1, 3]].tolist()
        rising, falling = (Tanh(a, -a * c) for a, c in zip(slopes, centres, strict=True))
        return rising, falling

    def parameter_bounds(self, input_range: Range) -> tuple[Array, Array]:
        """Return bounds of [slope, shift, offset]."""
        span = input_range[1] - input_range[0]
        return np.array([0.2 / span, -4.0, -1.0]), np.array([6.0 / span, 1.0, 1.0])


class ExponentialShape(EnvelopeShape):
    """Rate of each exponential, and the steepness of the falling one relative to the rising one."""

    def bounds(self, input_range: Range) -> tuple[Array, Array]:
        """Return bounds of [rate, rate, log of relative steepness]."""
        span = input_range[1] - input_range[0]
        return np.array([-4 / span, -4 / span, -1.5]), np.array([4 / span, 4 / span, 1.5])

    def guesses(self, input_range: Range) -> list[Array]:
        """Return like exponentials of a few curvatures, convex and concave."""
        span = input_range[1] - input_range[0]
        return [np.array([rate / span, rate / span, 0.0]) for rate in (-1.5, -0.5, 0.5, 1.5)]

    def envelopes(self, shape: Array, input_range: Range) -> tuple[Envelope, Envelope]:
        """Return both exponentials, the rising one of unit mean slope over the range."""
        low, high = input_range
        least = 1e-3 / (high - low)
        envelopes = []
        for rate, steepness in ((shape[0], 0.0), (shape[1], shape[2])):
            bent = float(np.copysign(max(abs(rate), least), rate))
            rise = abs(np.exp(-bent * low) - np.exp(-bent * high))
            envelopes.append(Exponential(bent, float(steepness - np.log(rise))))
        return envelopes[0], envelopes[1]

    def parameter_bounds(self, input_range: Range) -> tuple[Array, Array]:
        """Return bounds of [rate, shift, offset], for concave envelopes."""
        span = input_range[1] - input_range[0]
        return np.array([1e-3 / span, -2.0, -2.0]), np.array([4 / span, 2.0, 2.0])


class PiecewiseLinearShape(EnvelopeShape):
    """Logarithms of the rise between knots, the rising envelope's adding up to one."""

    def bounds(self, input_range: Range) -> tuple[Array, Array]:
        """Return bounds of the logarithms of all rises."""
        n = 2 * (self.n_knots - 1)
        middle = -np.log(self.n_knots - 1)
        return np.full(n, middle - 4.0), np.full(n, middle + 2.0)

    def guesses(self, input_range: Range) -> list[Array]:
        """Return straight envelopes, and S-shaped ones."""
        pieces = self.n_knots - 1
        middle = (np.arange(pieces) + 0.5) / pieces
        return [
            np.tile(np.log(rise / rise.sum()), 2)
            for rise in (np.ones(pieces), 0.2 + np.sin(np.pi * middle))
        ]

    def envelopes(self, shape: Array, input_range: Range) -> tuple[Envelope, Envelope]:
        """Return both envelopes on equally spaced knots."""
        knots = np.linspace(*input_range, self.n_knots)
        rising, falling = np.exp(shape).reshape(2, -1)
        scale = rising.sum()
        first, second = (
            PiecewiseLinear(vector(knots), (0.0, *vector(np.cumsum(rise / scale))))
            for rise in (rising, falling)
        )
        return first, second

    def parameter_bounds(self, input_range: Range) -> tuple[Array, Array]:
        """Return disjoint bounds of the values at the knots, so that they increase."""
        steps = np.arange(self.n_knots, dtype=float)
        return steps - 0.45, steps + 0.45


SHAPES: dict[str, type[EnvelopeShape]] = {
    "tanh": TanhShape,
    "piecewise-linear": PiecewiseLinearShape,
    "exponential": ExponentialShape,
}
