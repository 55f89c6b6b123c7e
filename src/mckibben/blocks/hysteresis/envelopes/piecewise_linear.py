"""Monotone piecewise-linear envelope, for loops of any shape.

Straight between knots, continued straight beyond the first and the last.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Self

import numpy as np
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.fields import STRICT, Vector
from mckibben.blocks.hysteresis.envelopes.base import Envelope, EnvelopeKernel, envelope_kernel
from mckibben.blocks.memoryless.interpolation import check_increasing, interpolate
from mckibben.blocks.notation import Notation


@envelope_kernel
def piecewise_linear_value(u: float, coefficients: Array) -> float:
    """Return the envelope at an input; coefficients are [knots, values]."""
    n = coefficients.size // 2
    return interpolate(u, coefficients[:n], coefficients[n:])


@envelope_kernel
def piecewise_linear_inverse(value: float, coefficients: Array) -> float:
    """Return the input at which the envelope has a value."""
    n = coefficients.size // 2
    return interpolate(value, coefficients[n:], coefficients[:n])


@dataclass(frozen=True, config=STRICT)
class PiecewiseLinear(Envelope):
    """Straight lines between knots.

    Parameters
    ----------
    knots : sequence of float, length K >= 2
        Inputs where lines meet, increasing.
    values : sequence of float, length K
        Envelope there, increasing.
    """

    kind: ClassVar[str] = "piecewise-linear"
    number: ClassVar[int] = 2
    value: ClassVar[EnvelopeKernel] = piecewise_linear_value
    inverse: ClassVar[EnvelopeKernel] = piecewise_linear_inverse
    increasing = ("knots", "values")
    parameters: ClassVar[tuple[str, ...]] = ("values",)
    notation: ClassVar[Notation] = Notation(
        r"\gamma(u) = v_k + (v_{k+1} - v_k) \frac{u - \xi_k}{\xi_{k+1} - \xi_k},\quad "
        r"\xi_k \le u \le \xi_{k+1}",
        knots=r"\xi_k [{u}]",
        values="v_k",
    )

    knots: Vector
    values: Vector

    def __post_init__(self) -> None:
        check_increasing("piecewise-linear envelope", self.knots, self.values)

    def coefficients(self) -> Array:
        """Return [knots, values]."""
        return np.array([*self.knots, *self.values])

    def shifted(self, offset: float) -> Self:
        """Return this envelope raised by a constant."""
        return replace(self, values=tuple(value + offset for value in self.values))

    @classmethod
    def examples(cls) -> tuple[Self, Self]:
        """Return a pair for rising and falling input over 0 to 5 bar."""
        knots = (0.0, 1.0, 2.5, 4.0, 5.0)
        return cls(knots, (0.0, 0.1, 0.5, 0.9, 1.0)), cls(knots, (0.05, 0.3, 0.7, 0.95, 1.05))
