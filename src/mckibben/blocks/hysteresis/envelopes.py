"""Envelopes of generalized play operators: strictly increasing functions.

Each has two kernels, ``value`` and ``inverse``, and the frozen class that names their parameters.

Source of the hyperbolic tangent: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling
Behavior for Parallel Pneumatic Artificial Muscle-Driven Soft Manipulator", Eq. (4).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Protocol, Self, cast

import numpy as np
from numpy.typing import ArrayLike
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.fields import STRICT, Knots, Positive, Vector
from mckibben.blocks.kernels import inlined, kernel
from mckibben.blocks.memoryless import interpolate
from mckibben.blocks.parameters import Parametrised
from mckibben.blocks.saving import part_from_dict
from mckibben.errors import ModelError


class EnvelopeKernel(Protocol):
    """A compiled scalar function; ``batch(coefficients, arguments, values)`` evaluates many."""

    batch: Callable[[Array, Array, Array], None]

    def __call__(self, argument: float, coefficients: Array) -> float:
        """Return the value."""


def envelope_kernel(function: Callable[[float, Array], float]) -> EnvelopeKernel:
    """Compile a function of one number, and the loop over many."""
    one: Any = inlined(function)  # so that what calls it is compiled alike, whatever was before

    def batch(coefficients: Array, arguments: Array, values: Array) -> None:
        for t in range(arguments.size):
            values[t] = one(arguments[t], coefficients)

    one.batch = kernel(batch)
    return cast("EnvelopeKernel", one)


class Envelope(Parametrised):
    """A strictly increasing function of the input, with its inverse."""

    value: ClassVar[EnvelopeKernel]
    inverse: ClassVar[EnvelopeKernel]

    typical: ClassVar[tuple[tuple[Any, ...], tuple[Any, ...]]]
    """Arguments of `examples`."""

    def coefficients(self) -> Array:
        return self.pack()

    def shifted(self, offset: float) -> Self:
        """Return this envelope shifted up by a constant; by default by its field ``offset``."""
        return replace(self, offset=self.offset + offset)  # type: ignore[type-var,attr-defined]

    @classmethod
    def examples(cls) -> tuple[Self, Self]:
        """Return a pair for rising and falling input over 0 to 5 bar, the second never lower."""
        rising, falling = cls.typical
        return cls(*rising), cls(*falling)

    def __call__(self, inputs: ArrayLike) -> Array:
        """Return the inputs at which the envelope has these values, any shape; NaN out of range."""
        return self._evaluate(type(self).value, inputs)

    def solve(self, values: ArrayLike) -> Array:
        """Return the inputs at which the envelope has these values, any shape; NaN beyond its range."""
        return self._evaluate(type(self).inverse, values)

    def _evaluate(self, function: EnvelopeKernel, arguments: ArrayLike) -> Array:
        given = np.array(arguments, dtype=np.float64, order="C")
        values = np.empty_like(given)
        function.batch(self.coefficients(), given.reshape(-1), values.reshape(-1))
        return values


def nested_envelope(content: Any) -> Any:
    """Convert the dict of an envelope inside a block to that envelope."""
    return part_from_dict(content, "envelopes") if isinstance(content, dict) else content


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
    """Hyperbolic tangent, for loops that saturate at both ends: tanh(slope u + shift) + offset.

    Parameters
    ----------
    slope : float
        Steepness per unit of the input; positive.
    shift : float
        Argument at zero input.
    offset : float
        Added to the tangent.
    """

    kind = "tanh"
    value = tanh_value
    inverse = tanh_inverse
    parameters = ("slope", "shift", "offset")
    typical = (0.5, -1.3, 0.0), (0.45, -0.9, 0.1)
    formulas = (r"\gamma(u) = \tanh(a u + b) + c",)

    slope: Annotated[Positive, "a [1/{u}]"]
    shift: Annotated[FiniteFloat, "b"]
    offset: Annotated[FiniteFloat, "c"] = 0.0


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
    """Shifted exponential, for loops that saturate at one end.

    gamma(u) = offset + sign(rate) (1 - exp(shift - rate u)): concave and saturating for a positive
    rate, convex for a negative one, and strictly increasing for both.

    Parameters
    ----------
    rate : float
        Curvature per unit of the input; not zero.
    shift : float
        Exponent at zero input; the slope there is abs(rate) exp(shift).
    offset : float
        Added to the exponential.
    """

    kind = "exponential"
    value = exponential_value
    inverse = exponential_inverse
    parameters = ("rate", "shift", "offset")
    typical = (0.3, 0.2, 0.0), (0.4, 0.2, 0.2)
    formulas = (r"\gamma(u) = c + \operatorname{sgn}(a) \left(1 - e^{b - a u}\right)",)

    rate: Annotated[FiniteFloat, "a [1/{u}]"]
    shift: Annotated[FiniteFloat, "b"]
    offset: Annotated[FiniteFloat, "c"] = 0.0

    def __post_init__(self) -> None:
        if self.rate == 0:
            raise ModelError(
                "an exponential envelope of rate 0 is flat", remedy="give a rate that is not zero"
            )


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
    """Piecewise-linear envelope with extrapolation, for loops of any shape.

    Parameters
    ----------
    knots : sequence of float, length K >= 2
        Inputs where lines meet, increasing.
    values : sequence of float, length K
        Envelope there, increasing.
    """

    kind = "piecewise-linear"
    value = piecewise_linear_value
    inverse = piecewise_linear_inverse
    increasing = same_length = ("knots", "values")
    parameters = ("values",)
    typical = (
        ((0.0, 1.0, 2.5, 4.0, 5.0), (0.0, 0.1, 0.5, 0.9, 1.0)),
        ((0.0, 1.0, 2.5, 4.0, 5.0), (0.05, 0.3, 0.7, 0.95, 1.05)),
    )
    formulas = (
        r"\gamma(u) = v_k + (v_{k+1} - v_k) \frac{u - \xi_k}{\xi_{k+1} - \xi_k},\quad "
        r"\xi_k \le u \le \xi_{k+1}",
    )

    knots: Annotated[Knots, r"\xi_k [{u}]"]
    values: Annotated[Vector, "v_k"]

    def coefficients(self) -> Array:
        """Return [knots, values]."""
        return np.array([*self.knots, *self.values])

    def shifted(self, offset: float) -> Self:
        return replace(self, values=tuple(value + offset for value in self.values))
