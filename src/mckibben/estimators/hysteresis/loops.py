"""Identification of Bouc-Wen and Maxwell-slip loops on a reversible polynomial, and of Duhem's model.

For the first two, y = offset + sum_k a_k B_k(x) + sum_j w_j (s_j x - z_j) + sum_j v_j z_j, all of a, w
and v at least 0, where x runs from 0 to 1 over the input's range, the B_k are integrals of Bernstein
polynomials, the z_j are what the loops are made of, and s_j bounds the slope of z_j by x. Whatever the
data, such a sum rises with its input, so it has an inverse; and loops may lag (w) or lead (v).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.differential import BoucWen, Duhem, GeneralizedBoucWen
from mckibben.blocks.hysteresis.maxwell_slip import MaxwellSlip, slip_matrix
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Operators
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.hysteresis.output_maps import PolynomialMap, centred
from mckibben.estimators.hysteresis.pi import spread
from mckibben.numerics.tracker import Tracker

LEAST_SLOPE = 1e-4
"""Smallest share of the output's range for each piece of the polynomial."""

SLOWEST, FASTEST = 0.3, 300.0
"""Rates of Bouc-Wen models, relative to one over the range of the input."""

MOST_ASYMMETRIC = 0.19
"""Bound of each of the five shape parameters, whose magnitudes must sum to less than 1."""

Degree = Annotated[int, Interval(ge=1, le=9)]

MOST_UNEQUAL = np.log(4.0)
"""Largest logarithm of the ratio of stiffnesses, or limits, between directions."""


@dataclass(frozen=True)
class Loops:
    """Linear parameters of a reversible polynomial with loops.

    Parameters
    ----------
    degree : int
        Of the polynomial.
    both_ways : bool
        Whether loops may lag and lead, each with weights of at least 0; else weights have any sign.
    """

    degree: int
    both_ways: bool

    def columns(self, run: Run, data: TrainingData, z: Array, slopes: Array) -> Array:
        """Return the pieces of the polynomial over a run, then lagging loops, then leading ones.

        The latter are of z, shape (n, m), whose slopes by x have bounds, shape (m,).
        """
        x = (run.u - data.input_range[0]) / data.input_span
        pieces = PolynomialMap(self.degree).pieces(x)
        if not self.both_ways:
            return np.column_stack([pieces, z])
        return np.column_stack([pieces, slopes * x[:, np.newaxis] - z, z])

    def lower_bounds(self, size: int, data: TrainingData) -> Array:
        """Return a small lower bound of every piece of the polynomial, and 0 for the loops."""
        floor = np.zeros(size)
        floor[: self.degree] = LEAST_SLOPE * data.output_span
        return floor

    def weights(self, linear: Array, offset: float, slopes: Array) -> tuple[Array, Array]:
        """Return the polynomial of x in ascending powers, shape (degree + 1,), and weights of z."""
        polynomial = PolynomialMap(self.degree).powers(linear[: self.degree])
        polynomial[0] += offset
        if not self.both_ways:
            return polynomial, linear[self.degree :]
        lagging, leading = np.split(linear[self.degree :], 2)
        polynomial[1] += float(slopes @ lagging)
        return polynomial, leading - lagging


class BoucWenEstimator(SeparableEstimator):
    """Bouc-Wen model by variable projection: rate and shape searched, the rest solved for.

    Parameters
    ----------
    degree : int
        Of the reversible polynomial.
    exponent : {1, 2}, optional
        n. Default: the better of both on the training data.
    asymmetric : bool
        Whether loops have the five shape numbers of the generalized model, instead of sigma.
    """

    title = "Bouc–Wen model"
    purpose = "memory"
    inverse_kind = "solved"
    can = "A loop that saturates, with about five parameters, and a reversible polynomial."
    cannot = "Minor loops need not close; loops are symmetric but for the polynomial."
    quick = True
    makes = ("bouc-wen",)
    effort = 0.6

    degree: Degree = 5
    exponent: Literal[1, 2] | None = None
    asymmetric: bool = False

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
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
        """Return the model of z alone; an asymmetric shape reverses at mid-range."""
        low, span, n = data.input_range[0], data.input_span, self.exponent or 1
        rate, fields = float(np.exp(theta[0])) / span, self.common_fields(data)
        if self.asymmetric:
            half, shape = 0.5 * span, vector(theta[1:])
            return GeneralizedBoucWen((0.0,), 1.0, rate, shape, n, low + half, half, **fields)
        return BoucWen((0.0,), 1.0, rate, float(theta[1]), n, low, span, **fields)

    @property
    def linear(self) -> Loops:
        """The linear parameters."""
        return Loops(self.degree, self.nonnegative)

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        return self.linear.lower_bounds(matrix.shape[1], data)

    def steepest(self, theta: Array, unit: BoucWen | GeneralizedBoucWen) -> Array:
        """Return the bound of the slope of z by the relative input, shape (1,)."""
        if isinstance(unit, BoucWen):
            return np.array([np.exp(theta[0]) * max(1.0, 2 * theta[1])])
        return np.array([2 * unit.scale * unit.steepest])

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        unit = self.unit(theta, data)
        z = unit.simulate(run.u, initial=self.starting_rule)[:, np.newaxis]
        return self.linear.columns(run, data, z, self.steepest(theta, unit))

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        unit = self.unit(theta, data)
        slopes = self.steepest(theta, unit)
        polynomial, weights = self.linear.weights(linear, offset, slopes)
        if self.asymmetric:  # whose polynomial is of -1 to 1 over the range, not of 0 to 1
            polynomial = centred(polynomial)
        return replace(unit, polynomial=vector(polynomial), weight=float(weights[0]))


class GBWEstimator(BoucWenEstimator):
    """Generalized Bouc-Wen model: rate and shape are searched, the rest is solved for."""

    title = "Generalized Bouc–Wen model (GBW)"
    can = "Asymmetric saturating loops, with five shape parameters."
    cannot = "Minor loops need not close; many starts are needed to identify it."
    quick = False
    makes = ("generalized-bouc-wen",)
    effort = 1.3
    asymmetric = True


class MaxwellSlipEstimator(SeparableEstimator):
    """Maxwell-slip model by least squares; ratios of its directions, if any, are searched.

    Parameters
    ----------
    degree : int
        Of the reversible polynomial.
    n_operators : int
        Springs.
    asymmetric : bool
        Whether rising and falling differ in stiffness and in slip, by ratios that are searched.
    """

    title = "Maxwell-slip model"
    purpose = "memory"
    inverse_kind = "solved"
    can = "Slipping springs in parallel with a reversible curve; symmetric loops."
    cannot = "Asymmetry only by the curve."
    quick = True
    effort = 0.02

    degree: Degree = 5
    n_operators: Operators = 8
    asymmetric: bool = False

    @property
    def fixed_fields(self) -> tuple[str, ...]:
        """Both ratios, if directions are equal."""
        ratios = ("maxwell-slip.stiffness_ratio", "maxwell-slip.limit_ratio")
        return () if self.asymmetric else ratios

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the logarithms of both ratios, if there are any."""
        most = np.full(2 * self.asymmetric, MOST_UNEQUAL)
        return -most, most

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return the symmetric model, and slightly asymmetric ones."""
        if not self.asymmetric:
            return []
        return [np.array([a, b]) for a in (0.0, 0.3, -0.3) for b in (0.0, 0.3, -0.3)]

    @property
    def linear(self) -> Loops:
        """The linear parameters."""
        return Loops(self.degree, self.nonnegative)

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        return self.linear.lower_bounds(matrix.shape[1], data)

    def springs(self, theta: Array, data: TrainingData) -> MaxwellSlip:
        """Return the springs, without weights or polynomial."""
        n, (low, _) = self.n_operators, data.input_range
        kappa, ratio = np.exp(theta).tolist() if theta.size else (1.0, 1.0)
        limits, none = vector(spread(n + 1, data.input_range)[1:]), (0.0,) * n
        fields = self.common_fields(data)
        return MaxwellSlip(limits, none, (0.0,), kappa, ratio, low, data.input_span, **fields)

    def steepest(self, springs: MaxwellSlip) -> Array:
        """Return the bounds of the slopes of deflections by the relative input, (n_operators,)."""
        return np.full(self.n_operators, springs.scale * max(1.0, springs.stiffness_ratio))

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        springs, n, u = self.springs(theta, data), self.n_operators, run.u
        start = springs.initial_state(u[:1], self.starting_rule)[:n]
        deflections = np.empty((u.size, n))
        limits = np.array(springs.breakaways)
        slip_matrix(u, limits, springs.stiffness_ratio, springs.limit_ratio, start, deflections)
        return self.linear.columns(run, data, deflections, self.steepest(springs))

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        springs = self.springs(theta, data)
        polynomial, weights = self.linear.weights(linear, offset, self.steepest(springs))
        return replace(springs, weights=vector(weights), polynomial=vector(polynomial))


class MMSEstimator(MaxwellSlipEstimator):
    """Modified Maxwell-slip model: the two ratios of its directions are searched."""

    title = "Modified Maxwell-slip model (MMS)"
    can = "Springs that slip, with different stiffness and limit for rising and falling input."
    cannot = "One asymmetry for all springs."
    quick = False
    effort = 0.5
    asymmetric = True


class DuhemEstimator(SeparableEstimator):
    """Duhem model by variable projection: its output is linear in both polynomials.

    Parameters
    ----------
    degree : int
        Of the curve that the output tends to.
    slope_degree : int
        Of the slope right after a reversal.
    """

    title = "Duhem model"
    purpose = "memory"
    can = "Loops that tend to a curve, with polynomial slopes; in closed form."
    cannot = (
        "Minor loops are not congruent and need not close; the inverse exists only where the "
        "slopes stay positive."
    )
    makes = ("duhem",)
    effort = 1.1

    nonnegative = False
    degree: Annotated[int, Interval(ge=1, le=9)] = 4
    slope_degree: Annotated[int, Interval(ge=0, le=9)] = 3

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log alpha], alpha by half the input range."""
        return np.array([np.log(0.1)]), np.array([np.log(100.0)])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return a few rates."""
        return [np.array([np.log(alpha)]) for alpha in (0.5, 1.5, 4.0, 12.0)]

    def unit(self, theta: Array, data: TrainingData) -> Duhem:
        """Return the model with zero polynomials."""
        half, alpha = 0.5 * data.input_span, float(np.exp(theta[0]))
        target, slope = (0.0,) * (self.degree + 1), (0.0,) * (self.slope_degree + 1)
        fields = self.common_fields(data)
        return Duhem(target, slope, alpha, data.input_range[0] + half, half, **fields)

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the output per coefficient, without the constant, over the run."""
        unit = self.unit(theta, data)
        n = unit.n_parameters - 1
        alone = np.column_stack([np.eye(n)[1:], np.full(n - 1, unit.alpha)])
        return np.column_stack([unit.unpack(row).simulate(run.u) for row in alone])

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        target = (offset, *linear[: self.degree].tolist())
        return replace(self.unit(theta, data), target=target, slope=vector(linear[self.degree :]))
