"""Tondu and Lopez's static force law with Kerscher's corrections for end caps and low pressure.

f = mu(e) A p (a (1 - kappa(p) e)^2 - b) + constant,  e = 1 - l / rest length,
a = 3 / tan(angle)^2, b = 1 / sin(angle)^2, A the cross-section at rest,
mu(e) = mu_1 exp(-40 e) + mu_0,  kappa(p) = kappa_1 exp(-p) + kappa_0.

Sources: Tondu and Lopez 2000; Kerscher, Albert, Zentner and Witte, "Dynamic modelling of fluidic
muscles using quasi-static approach", 2006, whose two exponentials these are. mu = kappa = 1 is the
ideal cylinder.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt, Interval
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel
from mckibben.blocks.fields import FORCE, LENGTH, PRESSURE, STRICT, ChannelField
from mckibben.blocks.force.braid_equilibrium import NEWTONS_PER_BAR
from mckibben.blocks.force.law import ForceLaw
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError

MU_DECAY = 40.0
"""Per contraction."""


@step
def tondu_lopez_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [rest length, A, a, b, mu_1, mu_0, kappa_1, kappa_0, constant]."""
    c = coefficients
    e, p = 1.0 - inputs[0] / c[0], inputs[1]
    mu = c[4] * math.exp(-MU_DECAY * e) + c[5]
    short = 1.0 - (c[6] * math.exp(-p) + c[7]) * e
    outputs[0] = mu * c[1] * p * (c[2] * short * short - c[3]) + c[8]


@kernel
def tondu_lopez_terms(length: float, c: Array) -> tuple[float, float]:
    """Return force per pressure, and force without any, where kappa_1 = 0."""
    e = 1.0 - length / c[0]
    mu = c[4] * math.exp(-MU_DECAY * e) + c[5]
    short = 1.0 - c[7] * e
    return mu * c[1] * (c[2] * short * short - c[3]), c[8]


@dataclass(frozen=True, config=STRICT)
class TonduLopez(ForceLaw):
    """Force of a braided cylinder with corrections.

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
    input, pressure, output : Channel
        Length, pressure and force.
    """

    kind: ClassVar[str] = "tondu-lopez"
    kernel: ClassVar[Kernel] = tondu_lopez_step
    terms_kernel = tondu_lopez_terms
    parameters: ClassVar[tuple[str, ...]] = ("braid_angle", "mu", "kappa", "constant")
    notation: ClassVar[Notation] = Notation(
        r"f = \mu(\epsilon)\, A\, p \left(a (1 - \kappa(p) \epsilon)^2 - b\right) + "
        r"c,\quad \epsilon = 1 - \frac{l}{l_0},\quad A = \frac{\pi d^2}{4}",
        r"a = \frac{3}{\tan^2 \alpha},\quad b = \frac{1}{\sin^2 \alpha},\quad "
        r"\mu(\epsilon) = \mu_1 e^{-40 \epsilon} + \mu_2,\quad \kappa(p) = \kappa_1 "
        r"e^{-p} + \kappa_2",
        braid_angle=r"\alpha [rad]",
        mu=r"\mu_i",
        kappa=r"\kappa_i",
        constant="c [N]",
        rest_length="l_0 [mm]",
        diameter="d [mm]",
        input="l",
        pressure="p",
        output="f",
    )

    rest_length: Annotated[FiniteFloat, Gt(0)]
    diameter: Annotated[FiniteFloat, Gt(0)]
    braid_angle: Annotated[FiniteFloat, Interval(ge=0.1, le=0.95)]
    mu: tuple[FiniteFloat, FiniteFloat] = (0.0, 1.0)
    kappa: tuple[FiniteFloat, FiniteFloat] = (0.0, 1.0)
    constant: FiniteFloat = 0.0
    input: ChannelField = LENGTH
    pressure: ChannelField = PRESSURE
    output: ChannelField = FORCE

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [rest length, A, a, b, mu_1, mu_0, kappa_1, kappa_0, constant]."""
        del sample_time
        a, b = 3 / math.tan(self.braid_angle) ** 2, 1 / math.sin(self.braid_angle) ** 2
        area = 0.25 * math.pi * self.diameter**2 * NEWTONS_PER_BAR
        return np.array([self.rest_length, area, a, b, *self.mu, *self.kappa, self.constant])

    def check_linear(self) -> None:
        """Refuse where kappa makes the law non-linear in pressure."""
        if self.kappa[0] != 0:
            raise ModelError(
                f"{self.kind!r} with kappa_1 = {self.kappa[0]:g} is not linear in pressure. Remedy: use "
                "a polynomial force law for feedforward."
            )

    @classmethod
    def example(cls) -> Self:
        """Return a law for lengths of a few millimetres."""
        return cls(5.0, 3.0, 0.45, (0.05, 0.9), (0.2, 1.1), -2.0)
