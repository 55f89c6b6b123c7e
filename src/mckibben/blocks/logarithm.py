"""Logarithm of the input, and its inverse: hysteresis behind it grows with the input.

y = log(u + offset). Friction in a muscle grows in proportion to pressure, so play operators of constant
threshold belong on the logarithm of pressure: a large offset makes the thresholds constant in the
pressure itself, offset 0 makes them proportional to it. Below `FLOOR` the logarithm goes on as its
tangent, so that every input has an output.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.blocks.base import Block, Kernel, Primitive
from mckibben.blocks.fields import PRESSURE, STRICT, ChannelField, Initial
from mckibben.blocks.kernels import kernel
from mckibben.blocks.named import NamedParameters
from mckibben.blocks.single import Memoryless

Array = NDArray[np.float64]

FLOOR = 0.05
"""Of u + offset, where the logarithm turns into its tangent."""


@kernel
def logarithm_kernel(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [offset]."""
    for t in range(inputs.shape[0]):
        x = inputs[t, 0] + coefficients[0]
        outputs[t, 0] = math.log(x) if x > FLOOR else math.log(FLOOR) + (x - FLOOR) / FLOOR


@kernel
def exponential_kernel(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Undo the logarithm; coefficients are [offset]."""
    for t in range(inputs.shape[0]):
        y = inputs[t, 0]
        bend = math.log(FLOOR)
        x = math.exp(y) if y > bend else FLOOR + (y - bend) * FLOOR
        outputs[t, 0] = x - coefficients[0]


@dataclass(frozen=True, config=STRICT)
class Logarithm(Memoryless, NamedParameters, Primitive):
    """Logarithm of a raised input.

    Parameters
    ----------
    offset : float
        Added to the input, in its unit; not negative.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "logarithm"
    kernel: ClassVar[Kernel] = logarithm_kernel
    parameters: ClassVar[tuple[str, ...]] = ("offset",)
    initial: ClassVar[Initial] = "first_sample"

    offset: Annotated[FiniteFloat, Ge(0)] = 0.0
    input: ChannelField = PRESSURE
    output: ChannelField = PRESSURE

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [offset]."""
        del sample_time
        return np.array([self.offset])

    def inverse(self) -> Block:
        """Return the exponential that undoes it."""
        return Exponential(self.offset, self.output, self.input)

    @classmethod
    def example(cls) -> Self:
        """Return the logarithm of pressure plus half a bar."""
        return cls(0.5)


@dataclass(frozen=True, config=STRICT)
class Exponential(Memoryless, NamedParameters, Primitive):
    """What undoes a `Logarithm`.

    Parameters
    ----------
    offset : float
        Taken off the exponential; not negative.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "exponential"
    kernel: ClassVar[Kernel] = exponential_kernel
    parameters: ClassVar[tuple[str, ...]] = ("offset",)
    initial: ClassVar[Initial] = "first_sample"

    offset: Annotated[FiniteFloat, Ge(0)] = 0.0
    input: ChannelField = PRESSURE
    output: ChannelField = PRESSURE

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [offset]."""
        del sample_time
        return np.array([self.offset])

    def inverse(self) -> Block:
        """Return the logarithm that undoes it."""
        return Logarithm(self.offset, self.output, self.input)

    @classmethod
    def example(cls) -> Self:
        """Return what undoes the example logarithm."""
        return cls(0.5)
