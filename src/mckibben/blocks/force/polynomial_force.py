"""Static force laws that are linear in pressure and polynomial in length.

f = p sum_i g_i x^i + sum_j h_j x^j,  x = (l - centre) / scale.

By the orders of the two polynomials this is the bilinear-quadratic law (1, 2), Eq. (3) of "A
Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical
Response of Pneumatic Artificial Muscles"; Petrovic's (2, 2); Minh's cubic (3, 3); and Schindele and
Aschemann's (3, 4).
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel
from mckibben.blocks.fields import FORCE, LENGTH, PRESSURE, STRICT, ChannelField, Vector
from mckibben.blocks.force.law import ForceLaw
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.memoryless.reversible import polynomial_at
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError


@kernel
def polynomial_force_terms(length: float, c: Array) -> tuple[float, float]:
    """Return force per pressure, and force without any; ``c`` is [centre, scale, number of g, g, h]."""
    n = int(c[2])
    x = (length - c[0]) / c[1]
    return polynomial_at(x, c, 3, n), polynomial_at(x, c, 3 + n, c.size - 3 - n)


@step
def polynomial_force_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Give the force at a length and a pressure."""
    per_bar, rest = polynomial_force_terms(inputs[0], coefficients)
    outputs[0] = inputs[1] * per_bar + rest


@dataclass(frozen=True, config=STRICT)
class PolynomialForce(ForceLaw):
    """Force linear in pressure, polynomial in length.

    Parameters
    ----------
    per_bar : sequence of float
        g, ascending, [N/bar]; at least one.
    elastic : sequence of float
        h, ascending, [N]; at least one.
    centre, scale : float
        Of the length [mm]; scale positive.
    input, pressure, output : Channel
        Length, pressure and force.
    """

    kind: ClassVar[str] = "polynomial-force"
    kernel: ClassVar[Kernel] = polynomial_force_step
    terms_kernel = polynomial_force_terms
    parameters: ClassVar[tuple[str, ...]] = ("per_bar", "elastic")
    notation: ClassVar[Notation] = Notation(
        r"f = p \sum_i g_i x^i + \sum_j h_j x^j,\quad x = \frac{l - m}{s}",
        per_bar="g_i from 0 [N/bar]",
        elastic="h_j from 0 [N]",
        centre="m [mm]",
        scale="s [mm]",
        input="l",
        pressure="p",
        output="f",
    )

    per_bar: Vector
    elastic: Vector
    centre: FiniteFloat = 0.0
    scale: Annotated[FiniteFloat, Gt(0)] = 1.0
    input: ChannelField = LENGTH
    pressure: ChannelField = PRESSURE
    output: ChannelField = FORCE

    def __post_init__(self) -> None:
        if not self.per_bar or not self.elastic:
            raise ModelError(
                f"{self.kind!r} has an empty polynomial. Remedy: give one coefficient or more to each."
            )

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [centre, scale, number of g, g, h]."""
        del sample_time
        return np.array([self.centre, self.scale, len(self.per_bar), *self.per_bar, *self.elastic])

    @classmethod
    def example(cls) -> Self:
        """Return a bilinear-quadratic law around 3 mm."""
        return cls((50.0, 20.0), (-10.0, 5.0, 8.0), 3.0, 2.0)
