"""Logarithm of the input, and its inverse: hysteresis behind it grows with the input.

y = log(u + offset). Friction in a muscle grows in proportion to pressure, so play operators of constant
threshold belong on the logarithm of pressure: a large offset makes the thresholds constant in the
pressure itself, offset 0 makes them proportional to it. Below `FLOOR` the logarithm goes on as its
tangent, so that every input has an output.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

from annotated_types import Ge
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Kernel
from mckibben.blocks.fields import PRESSURE, STRICT, ChannelField, Initial
from mckibben.blocks.kernels import step
from mckibben.blocks.notation import Notation

FLOOR = 0.05
"""Of u + offset, where the logarithm turns into its tangent."""


@step
def logarithm_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [offset]."""
    x = inputs[0] + coefficients[0]
    outputs[0] = math.log(x) if x > FLOOR else math.log(FLOOR) + (x - FLOOR) / FLOOR


@step
def exponential_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Undo the logarithm; coefficients are [offset]."""
    y = inputs[0]
    bend = math.log(FLOOR)
    x = math.exp(y) if y > bend else FLOOR + (y - bend) * FLOOR
    outputs[0] = x - coefficients[0]


@dataclass(frozen=True, config=STRICT)
class Logarithm(Block):
    """Logarithm of a raised input.

    Parameters
    ----------
    offset : float
        Added to the input, in its unit; not negative.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "logarithm"
    kernel: ClassVar[Kernel] = logarithm_step
    parameters: ClassVar[tuple[str, ...]] = ("offset",)
    initial: ClassVar[Initial] = "first_sample"
    notation: ClassVar[Notation] = Notation(
        r"y = \ln(u + c)",
        offset="c [{u}]",
    )

    offset: Annotated[FiniteFloat, Ge(0)] = 0.0
    input: ChannelField = PRESSURE
    output: ChannelField = PRESSURE

    def inverse(self) -> Block:
        """Return the exponential that undoes it."""
        return Exponential(self.offset, self.output, self.input)

    @classmethod
    def example(cls) -> Self:
        """Return the logarithm of pressure plus half a bar."""
        return cls(0.5)


@dataclass(frozen=True, config=STRICT)
class Exponential(Block):
    """What undoes a `Logarithm`.

    Parameters
    ----------
    offset : float
        Taken off the exponential; not negative.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "exponential"
    kernel: ClassVar[Kernel] = exponential_step
    parameters: ClassVar[tuple[str, ...]] = ("offset",)
    initial: ClassVar[Initial] = "first_sample"
    notation: ClassVar[Notation] = Notation(
        "y = e^{u} - c",
        offset="c [{y}]",
    )

    offset: Annotated[FiniteFloat, Ge(0)] = 0.0
    input: ChannelField = PRESSURE
    output: ChannelField = PRESSURE

    def inverse(self) -> Block:
        """Return the logarithm that undoes it."""
        return Logarithm(self.offset, self.output, self.input)

    @classmethod
    def example(cls) -> Self:
        """Return what undoes the example logarithm."""
        return cls(0.5)
