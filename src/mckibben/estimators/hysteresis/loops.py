"""Identification of a reversible, increasing polynomial with loops on top: Bouc-Wen and Maxwell-slip.

y = offset + sum_k a_k B_k(x) + sum_j w_j (s_j x - z_j) + sum_j v_j z_j, all of a, w and v at least
0, where x runs from 0 to 1 over the input's range, the B_k are integrals of Bernstein polynomials,
the z_j are what the loops are made of, and s_j bounds the slope of z_j by x. Whatever the data,
such a sum rises with its input, so it has an inverse; and loops may lag (w) or lead (v).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.differential import BoucWen, GeneralizedBoucWen
from mckibben.blocks.hysteresis.maxwell_slip import MaxwellSlip, slip_matrix
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Operators
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.hysteresis.output_maps import PolynomialMap
from mckibben.estimators.hysteresis.pi import Spacing, spread
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.presets import preset

LEAST_SLOPE = 1e-4
"""Least share of the output's range that each piece of the polynomial gives."""

SLOWEST, FASTEST = 0.3, 300.0
"""Rates of Bouc-Wen models, relative to one over the range of the input."""

MOST_ASYMMETRIC = 0.19
"""Largest size of each of their five shape numbers: together they stay below 1."""

MOST_UNEQUAL = np.log(4.0)
"""Largest logarithm of the ratio of stiffnesses, or limits, of springs in both directions."""


@dataclass(kw_only=True, repr=False, eq=False)
class LoopEstimator(SeparableEstimator):
    """An estimator of a reversible polynomial with loops on top.

    Parameters
    ----------
    degree : int
        Of the reversible polynomial.
    """

    purpose = "memory"
    inverse_kind = "solved"

    degree: Annotated[int, Interval(ge=1, le=9)] = 5

    @abstractmethod
    def loops(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        """Return z over the run's history, shape (n, m), and the bounds of its slopes, shape (m,)."""

    @abstractmethod
    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> Block:
        """Return the block of an ascending polynomial in x, shape (degree + 1,), and weights of z."""

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the polynomial, then the loops that lag, then those that lead."""
        low, high = data.input_range
        x = (run.history - low) / (high - low)
        z, slopes = self.loops(theta, run, data)
        pieces = PolynomialMap(self.degree).pieces(x)
        if not self.nonnegative:
            return np.column_stack([pieces, z])
        return np.column_stack([pieces, slopes * x[:, np.newaxis] - z, z])

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return a little of every piece of the polynomial, and nothing of the loops."""
        floor = np.zeros(matrix.shape[1])
        low, high = data.output_range
        floor[: self.degree] = LEAST_SLOPE * (high - low)
        return floor

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        polynomial = PolynomialMap(self.degree).powers(linear[: self.degree])
        polynomial[0] += offset
        if not self.nonnegative:
            return self.assemble(theta, polynomial, linear[self.degree :], data)
        lagging, leading = np.split(linear[self.degree :], 2)
        _, slopes = self.loops(theta, data.runs[0].cut(0, 2), data)
        polynomial[1] += float(slopes @ lagging)
        return self.assemble(theta, polynomial, leading - lagging, data)


@dataclass(kw_only=True, repr=False, eq=False)
class BoucWenEstimator(LoopEstimator):
    """Bouc-Wen model by variable projection: rate and shape are searched, the rest is solved for.

    Parameters
    ----------
    exponent : {1, 2}, optional
        n. Default: the better of both on the training data.
    asymmetric : bool
        Whether loops have the five shape numbers of the generalised model, instead of sigma.
    """

    title = "Bouc–Wen model"
    can = "A loop that saturates, with five numbers or so, and a reversible polynomial."
    cannot = "Minor loops need not close; loops are symmetric but for the polynomial."
    quick = True
    makes = ("bouc-wen",)
    effort: ClassVar[float] = 0.6

    exponent: Literal[1, 2] | None = None
    asymmetric: bool = False

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        if self.exponent is not None:
            return super().identify(data, tracker)
        return self.best_of("exponent", (1, 2), data, tracker)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log rate by input range, shape]."""
        slow, fast = np.log([SLOWEST, FASTEST])
        if self.asymmetric:
            most = np.full(5, MOST_ASYMMETRIC)
            return np.array([slow, *-most]), np.array([fast, *most])
        return np.array([slow, 0.5]), np.array([fast, 6.0])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return symmetric loops that saturate over a tenth, a third and all of the range."""
        shapes = [np.zeros(5)] if self.asymmetric else [np.array([0.6]), np.array([1.5])]
        return [np.array([np.log(rate), *shape]) for rate in (3, 10, 30) for shape in shapes]

    def unit(self, theta: Array, data: TrainingData) -> BoucWen | GeneralizedBoucWen:
        """Return the model of z alone; an asymmetric shape turns over at mid-range."""
        low, high = data.input_range
        span, rate = high - low, float(np.exp(theta[0])) / (high - low)
        ending: Any = (data.input_range, self.starting_rule, *self.channels(data).values())
        n = self.exponent or 1
        if self.asymmetric:
            half, shape = 0.5 * span, vector(theta[1:])
            return GeneralizedBoucWen((0.0,), 1.0, rate, shape, n, low + half, half, *ending)
        return BoucWen((0.0,), 1.0, rate, float(theta[1]), n, low, span, *ending)

    def loops(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        unit = self.unit(theta, data)
        if isinstance(unit, BoucWen):
            steepest = float(np.exp(theta[0]) * max(1.0, 2 * theta[1]))
        else:
            steepest = 2 * unit.scale * unit.steepest
        z = unit.simulate(run.history, initial=self.starting_rule)
        return z[:, np.newaxis], np.array([steepest])

    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> Block:
        if self.asymmetric:  # whose polynomial is of -1 to 1 over the range, not of 0 to 1
            turned = np.polynomial.Polynomial(polynomial)(np.polynomial.Polynomial([0.5, 0.5])).coef
            polynomial = np.pad(turned, (0, polynomial.size - turned.size))
        unit = self.unit(theta, data)
        return replace(unit, polynomial=vector(polynomial), weight=float(weights[0]))


GBW = preset(
    BoucWenEstimator,
    "Generalised Bouc-Wen model: rate and shape are searched, the rest is solved for.",
    title="Generalised Bouc–Wen model (GBW)",
    can="Asymmetric saturating loops, by five shape numbers.",
    cannot="Minor loops need not close; many starts are needed to identify it.",
    quick=False,
    makes=("generalized-bouc-wen",),
    effort=1.3,
    asymmetric=True,
)


@dataclass(kw_only=True, repr=False, eq=False)
class MaxwellSlipEstimator(LoopEstimator):
    """Maxwell-slip model: by least squares, but for the ratios of its directions where it has any.

    Parameters
    ----------
    n_operators : int
        Springs.
    spacing : {"even", "dense"}
        How the deflections at which they slip spread over half the input range.
    asymmetric : bool
        Whether rising and falling differ in stiffness and in slip, by ratios that are searched.
    """

    effort: ClassVar[float] = 0.02

    n_operators: Operators = 8
    spacing: Spacing = "even"
    asymmetric: bool = False

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the logarithms of both ratios, if there are any."""
        most = np.full(2 * self.asymmetric, MOST_UNEQUAL)
        return -most, most

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return the symmetric model, and slightly asymmetric ones."""
        if not self.asymmetric:
            return []
        return [np.array([a, b]) for a in (0.0, 0.3, -0.3) for b in (0.0, 0.3, -0.3)]

    def loops(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        n, u = self.n_operators, run.history
        springs = self.assemble(theta, np.zeros(1), np.zeros(n), data)
        start = springs.initial_state(u[:1], self.starting_rule)[:n]
        deflections = np.empty((u.size, n))
        limits = np.array(springs.breakaways)
        slip_matrix(u, limits, springs.stiffness_ratio, springs.limit_ratio, start, deflections)
        return deflections, np.full(n, springs.scale * max(1.0, springs.stiffness_ratio))

    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> MaxwellSlip:
        low, high = data.input_range
        kappa, ratio = np.exp(theta) if theta.size else (1.0, 1.0)
        return MaxwellSlip(
            vector(spread(self.n_operators + 1, high - low, self.spacing)[1:]),
            vector(weights),
            vector(polynomial),
            float(kappa),
            float(ratio),
            low,
            high - low,
            data.input_range,
            self.starting_rule,
            **self.channels(data),
        )


MAXWELL_SLIP = preset(
    MaxwellSlipEstimator,
    "Maxwell-slip model by least squares.",
    title="Maxwell-slip model",
    can="Springs that slip beside a reversible curve; symmetric loops.",
    cannot="Asymmetry only by the curve.",
    quick=True,
    asymmetric=False,
)

MMS = preset(
    MaxwellSlipEstimator,
    "Modified Maxwell-slip model: the two ratios of its directions are searched.",
    title="Modified Maxwell-slip model (MMS)",
    can="Springs that slip, of different stiffness and limit up and down.",
    cannot="One asymmetry for all springs.",
    asymmetric=True,
    effort=0.5,
)
