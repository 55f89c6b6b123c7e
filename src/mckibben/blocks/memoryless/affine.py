"""Affine block: y = gain u + offset, the match that scales a unit-free model to a muscle.

Source: "Analysis and modeling of a pneumatic artificial muscle system", Eq. (1).
"""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Kernel
from mckibben.blocks.fields import DISPLACEMENT, STRICT, ChannelField
from mckibben.blocks.kernels import step
from mckibben.blocks.linear import LinearSystem
from mckibben.blocks.notation import Notation, summed
from mckibben.errors import ModelError


@step
def affine_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Scale and shift; coefficients are [gain, offset]."""
    outputs[0] = coefficients[0] * inputs[0] + coefficients[1]


@dataclass(frozen=True, config=STRICT)
class Affine(Block):
    """Gain and offset.

    Parameters
    ----------
    gain : float
        Output per input; not zero where an inverse is wanted.
    offset : float
        Output at zero input.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "affine"
    kernel: ClassVar[Kernel] = affine_step
    parameters: ClassVar[tuple[str, ...]] = ("gain", "offset")
    notation: ClassVar[Notation] = Notation(
        "y = K u + y_0",
        gain="K [{y}/{u}]",
        offset="y_0 [{y}]",
    )

    gain: FiniteFloat
    offset: FiniteFloat = 0.0
    input: ChannelField = DISPLACEMENT
    output: ChannelField = DISPLACEMENT

    def inverse(self) -> Affine:
        """Return the affine block that undoes this one.

        Raises
        ------
        ModelError
            If the gain is zero.
        """
        if self.gain == 0:
            raise ModelError(
                "'affine' of gain 0 has no inverse. Remedy: give a gain that is not 0."
            )
        return Affine(1 / self.gain, -self.offset / self.gain, self.output, self.input)

    def worked(self) -> tuple[str, ...]:
        """Return the line with its numbers."""
        return (f"y = {summed([(self.gain, 'u'), (self.offset, '')])}",)

    def linear_system(self, sample_time: float | None = None) -> LinearSystem:
        """Return the gain."""
        del sample_time
        return LinearSystem.gain(self.gain, self.offset)

    @classmethod
    def example(cls) -> Self:
        """Return a gain of 6.8 mm and an offset."""
        return cls(6.8, -1.5)
