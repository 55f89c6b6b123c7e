"""Hyperbolic-tangent envelope, for loops that saturate at both ends.

gamma(u) = tanh(slope u + shift) + offset.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Eq. (4).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt
from numpy.typing import ArrayLike, NDArray
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.blocks.envelopes.base import Envelope, EnvelopeKernel
from mckibben.blocks.fields import STRICT
from mckibben.blocks.kernels import kernel

Array = NDArray[np.float64]


@kernel
def _value(coefficients: Array, inputs: Array, values: Array) -> None:
    slope, shift, offset = coefficients[0], coefficients[1], coefficients[2]
    for t in range(inputs.size):
        values[t] = math.tanh(slope * inputs[t] + shift) + offset


@kernel
def _inverse(coefficients: Array, values: Array, inputs: Array) -> None:
    slope, shift, offset = coefficients[0], coefficients[1], coefficients[2]
    for t in range(values.size):
        inputs[t] = (math.atanh(values[t] - offset) - shift) / slope


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
    value: ClassVar[EnvelopeKernel] = _value
    inverse: ClassVar[EnvelopeKernel] = _inverse

    slope: Annotated[FiniteFloat, Gt(0)]
    shift: FiniteFloat
    offset: FiniteFloat = 0.0

    def coefficients(self) -> Array:
        """Return [slope, shift, offset]."""
        return np.array([self.slope, self.shift, self.offset])

    pack = coefficients

    def unpack(self, parameters: ArrayLike) -> Self:
        """Return a tangent with other [slope, shift, offset]."""
        slope, shift, offset = np.asarray(parameters, dtype=np.float64).tolist()
        return type(self)(slope, shift, offset)

    def shifted(self, offset: float) -> Self:
        """Return this tangent raised by a constant."""
        return replace(self, offset=self.offset + offset)

    @classmethod
    def examples(cls) -> tuple[Self, Self]:
        """Return a pair for rising and falling input over 0 to 5 bar."""
        return cls(0.5, -1.3, 0.0), cls(0.45, -0.9, 0.1)
