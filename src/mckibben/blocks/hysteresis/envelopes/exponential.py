"""Shifted-exponential envelope, for loops that bend one way only.

gamma(u) = offset + sign(rate) (1 - exp(shift - rate u)): concave and saturating for a positive rate,
convex for a negative one, and strictly increasing for both.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar, Self

from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.fields import STRICT
from mckibben.blocks.hysteresis.envelopes.base import Envelope, EnvelopeKernel, envelope_kernel
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError


@envelope_kernel
def exponential_value(u: float, coefficients: Array) -> float:
    """Return the envelope at an input; coefficients are [rate, shift, offset]."""
    rate, shift, offset = coefficients[0], coefficients[1], coefficients[2]
    return offset + math.copysign(1.0, rate) * (1.0 - math.exp(shift - rate * u))


@envelope_kernel
def exponential_inverse(value: float, coefficients: Array) -> float:
    """Return the input at which the envelope has a value."""
    rate, shift, offset = coefficients[0], coefficients[1], coefficients[2]
    return (shift - math.log(1.0 - math.copysign(1.0, rate) * (value - offset))) / rate


@dataclass(frozen=True, config=STRICT)
class Exponential(Envelope):
    """Shifted exponential.

    Parameters
    ----------
    rate : float
        Curvature per unit of the input; not zero.
    shift : float
        Exponent at zero input; the slope there is abs(rate) exp(shift).
    offset : float
        Added to the exponential.
    """

    kind: ClassVar[str] = "exponential"
    number: ClassVar[int] = 1
    value: ClassVar[EnvelopeKernel] = exponential_value
    inverse: ClassVar[EnvelopeKernel] = exponential_inverse
    parameters: ClassVar[tuple[str, ...]] = ("rate", "shift", "offset")
    notation: ClassVar[Notation] = Notation(
        r"\gamma(u) = c + \operatorname{sgn}(a) \left(1 - e^{b - a u}\right)",
        rate="a [1/{u}]",
        shift="b",
        offset="c",
    )

    rate: FiniteFloat
    shift: FiniteFloat
    offset: FiniteFloat = 0.0

    def __post_init__(self) -> None:
        if self.rate == 0:
            raise ModelError(
                "an exponential envelope of rate 0 is flat. Remedy: give a rate that is not zero."
            )

    def shifted(self, offset: float) -> Self:
        """Return this exponential raised by a constant."""
        return replace(self, offset=self.offset + offset)

    @classmethod
    def examples(cls) -> tuple[Self, Self]:
        """Return a pair for rising and falling input over 0 to 5 bar."""
        return cls(0.3, 0.2, 0.0), cls(0.4, 0.2, 0.2)
