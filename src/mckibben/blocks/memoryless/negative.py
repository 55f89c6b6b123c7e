"""Change of sign, for outputs that fall while the input rises, such as a muscle's length."""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Kernel
from mckibben.blocks.fields import DISPLACEMENT, STRICT, ChannelField
from mckibben.blocks.kernels import step
from mckibben.blocks.linear import LinearSystem
from mckibben.blocks.notation import Notation


@step
def negative_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Change the sign; there are no coefficients."""
    outputs[0] = -inputs[0]


@dataclass(frozen=True, config=STRICT)
class Negative(Block):
    """y = -u.

    Parameters
    ----------
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "negative"
    kernel: ClassVar[Kernel] = negative_step
    notation: ClassVar[Notation] = Notation(
        "y = -u",
    )

    input: ChannelField = DISPLACEMENT
    output: ChannelField = DISPLACEMENT

    def inverse(self) -> Negative:
        """Return the block from output to input."""
        return Negative(self.output, self.input)

    def linear_system(self, sample_time: float | None = None) -> LinearSystem:
        """Return a gain of -1."""
        del sample_time
        return LinearSystem.gain(-1.0)

    @classmethod
    def example(cls) -> Self:
        """Return a change of sign."""
        return cls()
