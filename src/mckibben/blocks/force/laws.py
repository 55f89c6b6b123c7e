"""Static force laws: force by length and measured pressure."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Interval
from numpy.polynomial import Polynomial
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.memoryless import polynomial_at
from mckibben.errors import ModelError

NEWTONS_PER_BAR = 0.1
"""Force of one bar on one square millimetre [N]."""


def braid(angle: float, diameter: float) -> tuple[float, float, float]:
    """Return the geometry of a braid at rest, by its angle [rad] and diameter [mm].

    A cylinder of a bar pulls by A (a (1 - e)^2 - b) [N] at a contraction e: A, a, b.
    """
    area = 0.25 * math.pi * diameter**2 * NEWTONS_PER_BAR
    return area, 3.0 / math.tan(angle) ** 2, 1.0 / math.sin(angle) ** 2


@dataclass(frozen=True, kw_only=True, repr=False, config=fields.STRICT)
class ForceByLength:
    """Channels of a force by length, scheduled by pressure.

    Parameters
    ----------
    input, pressure, output : Channel
        Length [mm], pressure [bar] and force [N].
    """

    input: Annotated[fields.ChannelField, "l"] = fields.LENGTH
    pressure: Annotated[fields.ChannelField, "p"] = fields.PRESSURE
    output: Annotated[fields.ChannelField, "f"] = fields.FORCE


class ForceLaw(ForceByLength, Block):
    """A static force law: from length, scheduled by pressure, to force."""

    ports = ("input",), ("pressure",), ("output",)
    no_inverse = "has no inverse by length, since several lengths may have the same force"
    instead = "for the pressure that gives a force at a length, use ForceFeedforward(law)"

    terms_kernel: ClassVar[Callable[[float, Array], tuple[float, float]]]
    """Computes force per pressure [N/bar] and force at zero pressure [N] from a length and
    `coefficients`.
    """

    def terms(self, length: Array) -> tuple[Array, Array]:
        """Return force per pressure [N/bar], and force without any [N], each of the shape given.

        Raises
        ------
        ModelError
            If the law is not linear in pressure.
        """
        self.check_linear()
        numbers, terms = self.coefficients(None), type(self).terms_kernel
        table = np.array([terms(each, numbers) for each in np.ravel(length).tolist()])
        per_bar, rest = table.reshape(-1, 2).T
        return per_bar.reshape(np.shape(length)), rest.reshape(np.shape(length))

    def check_linear(self) -> None:
        """Raise an error for a law that is not linear in pressure; by default it is."""


# -- polynomials in length -------------------------------------------------------------------

CENTRE, SCALE, N_PER_BAR, TERMS = range(4)
"""Places of the coefficients; the polynomials with and without pressure are from the last on."""


@kernel
def polynomial_force_terms(length: float, c: Array) -> tuple[float, float]:
    """Return force per pressure, and force without any; ``c`` is [centre, scale, number of g, g, h]."""
    n = int(c[N_PER_BAR])
    x = (length - c[CENTRE]) / c[SCALE]
    return polynomial_at(x, c, TERMS, n), polynomial_at(x, c, TERMS + n, c.size - TERMS - n)


@step
def polynomial_force_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Compute the force at a length and a pressure."""
    per_bar, rest = polynomial_force_terms(inputs[0], coefficients)
    outputs[0] = inputs[1] * per_bar + rest


@dataclass(frozen=True, config=fields.STRICT)
class PolynomialForce(ForceLaw):
    """Force linear in pressure, polynomial in length.

    By the orders with and without pressure this is the bilinear-quadratic law (1, 2), Eq. (3) of "A
    Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical
    Response of Pneumatic Artificial Muscles"; Petrovic's (2, 2); Minh's cubic (3, 3); and Schindele
    and Aschemann's (3, 4).

    Parameters
    ----------
    per_bar : sequence of float
        g, ascending, [N/bar]; at least one.
    elastic : sequence of float
        h, ascending, [N]; at least one.
    centre, scale : float
        Of the length [mm]; scale positive.
    """

    kind = "polynomial-force"
    kernel = polynomial_force_step
    terms_kernel = polynomial_force_terms
    parameters = ("per_bar", "elastic")
    typical = ((50.0, 20.0), (-10.0, 5.0, 8.0), 3.0, 2.0)
    formulas = (r"f = p \sum_i g_i x^i + \sum_j h_j x^j,\quad x = \frac{l - m}{s}",)

    per_bar: Annotated[fields.PolynomialField, "g_i from 0 [N/bar]"]
    elastic: Annotated[fields.PolynomialField, "h_j from 0 [N]"]
    centre: Annotated[FiniteFloat, "m [mm]"] = 0.0
    scale: Annotated[fields.Positive, "s [mm]"] = 1.0

    def unscaled(self) -> Self:
        """Return the same law as polynomials of the unscaled length, as printed in papers."""
        x = Polynomial([-self.centre / self.scale, 1.0 / self.scale])
        g, h = (tuple(Polynomial(each)(x).coef.tolist()) for each in (self.per_bar, self.elastic))
        return replace(self, per_bar=g, elastic=h, centre=0.0, scale=1.0)

    def coefficients(self, sample_time: float | None) -> Array:
        return np.array([self.centre, self.scale, len(self.per_bar), *self.per_bar, *self.elastic])


# -- an inextensible braid -------------------------------------------------------------------

PER_SQUARE, ZERO_SQUARE, ADDED = range(3)
"""Places of the coefficients: force per bar and square of length, b^2 / 3, and constant."""


@step
def chou_hannaford_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Compute the force at a length and a pressure."""
    pull = inputs[0] * inputs[0] - coefficients[ZERO_SQUARE]
    outputs[0] = inputs[1] * coefficients[PER_SQUARE] * pull + coefficients[ADDED]


@kernel
def chou_hannaford_terms(length: float, c: Array) -> tuple[float, float]:
    """Return force per pressure, and force without any."""
    return c[PER_SQUARE] * (length * length - c[ZERO_SQUARE]), c[ADDED]


@dataclass(frozen=True, config=fields.STRICT)
class ChouHannaford(ForceLaw):
    """Force of an inextensible braid, with a constant for friction or elasticity.

    Source: Chou and Hannaford, "Measurement and modeling of McKibben pneumatic artificial muscles",
    1996.

    Parameters
    ----------
    thread_length : float
        b [mm], positive.
    turns : float
        n, positive.
    constant : float
        Added [N].
    """

    kind = "chou-hannaford"
    kernel = chou_hannaford_step
    terms_kernel = chou_hannaford_terms
    parameters = ("thread_length", "turns", "constant")
    typical = (6.0, 0.5, -1.0)
    formulas = (r"f = p\, \frac{3 l^2 - b^2}{4 \pi n^2} + c",)

    thread_length: Annotated[fields.Positive, "b [mm]"]
    turns: Annotated[fields.Positive, "n"]
    constant: Annotated[FiniteFloat, "c [N]"] = 0.0

    def coefficients(self, sample_time: float | None) -> Array:
        per_bar = 3 * NEWTONS_PER_BAR / (4 * math.pi * self.turns**2)
        return np.array([per_bar, self.thread_length**2 / 3, self.constant])


# -- a braided cylinder with corrections -----------------------------------------------------

MU_DECAY = 40.0
"""Decay of mu per unit of contraction."""


REST, AREA, A, B, MU_1, MU_0, KAPPA_1, KAPPA_0, CONSTANT = range(9)
"""Places of the coefficients; `REST` is the length at rest."""


@step
def tondu_lopez_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Compute the force at a length and a pressure."""
    c = coefficients
    e, p = 1.0 - inputs[0] / c[REST], inputs[1]
    mu = c[MU_1] * math.exp(-MU_DECAY * e) + c[MU_0]
    short = 1.0 - (c[KAPPA_1] * math.exp(-p) + c[KAPPA_0]) * e
    outputs[0] = mu * c[AREA] * p * (c[A] * short * short - c[B]) + c[CONSTANT]


@kernel
def tondu_lopez_terms(length: float, c: Array) -> tuple[float, float]:
    """Return force per pressure, and force without any, where kappa_1 = 0."""
    e = 1.0 - length / c[REST]
    mu = c[MU_1] * math.exp(-MU_DECAY * e) + c[MU_0]
    short = 1.0 - c[KAPPA_0] * e
    return mu * c[AREA] * (c[A] * short * short - c[B]), c[CONSTANT]


@dataclass(frozen=True, config=fields.STRICT)
class TonduLopez(ForceLaw):
    """Force of a braided cylinder, with corrections for end caps and low pressure.

    mu = kappa = 1 is the ideal cylinder. Sources: Tondu and Lopez 2000; Kerscher, Albert, Zentner and
    Witte, "Dynamic modelling of fluidic muscles using quasi-static approach", 2006, whose two
    exponentials these are.

    Parameters
    ----------
    rest_length, diameter : float
        Of the muscle at rest [mm]; positive. Structure, not parameters.
    braid_angle : float
        Between braid and axis at rest [rad], 0.1 to 0.95.
    mu : (float, float)
        mu_1 and mu_0.
    kappa : (float, float)
        kappa_1 and kappa_0.
    constant : float
        Added [N].
    """

    kind = "tondu-lopez"
    kernel = tondu_lopez_step
    terms_kernel = tondu_lopez_terms
    parameters = ("braid_angle", "mu", "kappa", "constant")
    typical = (5.0, 3.0, 0.45, (0.05, 0.9), (0.2, 1.1), -2.0)
    formulas = (
        r"f = \mu(\epsilon)\, A\, p \left(a (1 - \kappa(p) \epsilon)^2 - b\right) + "
        r"c,\quad \epsilon = 1 - \frac{l}{l_0},\quad A = \frac{\pi d^2}{4}",
        r"a = \frac{3}{\tan^2 \alpha},\quad b = \frac{1}{\sin^2 \alpha},\quad "
        r"\mu(\epsilon) = \mu_1 e^{-40 \epsilon} + \mu_2,\quad \kappa(p) = \kappa_1 "
        r"e^{-p} + \kappa_2",
    )

    rest_length: Annotated[fields.Positive, "l_0 [mm]"]
    diameter: Annotated[fields.Positive, "d [mm]"]
    braid_angle: Annotated[FiniteFloat, Interval(ge=0.1, le=0.95), r"\alpha [rad]"]
    mu: Annotated[tuple[FiniteFloat, FiniteFloat], r"\mu_i"] = (0.0, 1.0)
    kappa: Annotated[tuple[FiniteFloat, FiniteFloat], r"\kappa_i"] = (0.0, 1.0)
    constant: Annotated[FiniteFloat, "c [N]"] = 0.0

    def coefficients(self, sample_time: float | None) -> Array:
        cylinder = braid(self.braid_angle, self.diameter)
        return np.array([self.rest_length, *cylinder, *self.mu, *self.kappa, self.constant])

    def check_linear(self) -> None:
        if self.kappa[0] != 0:
            raise ModelError(
                f"{self.kind!r} with kappa_1 = {self.kappa[0]:g} is not linear in pressure",
                remedy="use a polynomial force law for feedforward",
            )
