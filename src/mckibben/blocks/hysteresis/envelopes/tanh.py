"""Hyperbolic-tangent envelope, for loops that saturate at both ends.

gamma(u) = tanh(slope u + shift) + offset.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Eq. (4).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar, Self

from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.fields import STRICT
from mckibben.blocks.hysteresis.envelopes.base import Envelope, EnvelopeKernel, envelope_kernel
from mckibben.blocks.notation import Notation


@envelope_kernel
def tanh_value(u: float, coefficients: Array) -> float:
    """Return the envelope at an input; coefficients are [slope, shift, offset]."""
    return math.tanh(coefficients[0] * u + coefficients[1]) + coefficients[2]


@envelope_kernel
def tanh_inverse(value: float, coefficients: Array) -> float:
    """Return the input at which the envelope has a value."""
    return (math.atanh(value - coefficients[2]) - coefficients[1]) / coefficients[0]


@dataclass(frozen=True, config=STRICT)
class Tanh(Envelope):
    """Hyperbolic tangent.

    Parameters
    ----------
    slope : float
        Steepness per unit of the input; positive.
    shift : float
        Argument at zero input.
    offset : float
        Added to the tangent.
    """

    kind: ClassVar[str] = "tanh"
    number: ClassVar[int] = 0
    value: ClassVar[EnvelopeKernel] = tanh_value
    inverse: ClassVar[EnvelopeKernel] = tanh_inverse
    parameters: ClassVar[tuple[str, ...]] = ("slope", "shift", "offset")
    notation: ClassVar[Notation] = Notation(
        r"\gamma(u) = \tanh(a u + b) + c",
        slope="a [1/{u}]",
        shift="b",
        offset="c",
    )

    slope: Annotated[FiniteFloat, Gt(0)]
    shift: FiniteFloat
    offset: FiniteFloat = 0.0

    def shifted(self, offset: float) -> Self:
        """Return this tangent raised by a constant."""
        return replace(self, offset=self.offset + offset)

    @classmethod
    def examples(cls) -> tuple[Self, Self]:
        """Return a pair for rising and falling input over 0 to 5 bar."""
        return cls(0.5, -1.3, 0.0), cls(0.45, -0.9, 0.1)
