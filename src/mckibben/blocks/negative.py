"""Change of sign, for outputs that fall while the input rises, such as a muscle's length."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic.dataclasses import dataclass

from mckibben.blocks.base import Kernel, Primitive
from mckibben.blocks.fields import DISPLACEMENT, STRICT, ChannelField
from mckibben.blocks.kernels import kernel
from mckibben.blocks.refusals import parameter_vector
from mckibben.blocks.single import Memoryless

Array = NDArray[np.float64]


@kernel
def negative_kernel(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Change the sign; there are no coefficients."""
    for t in range(inputs.shape[0]):
        outputs[t, 0] = -inputs[t, 0]


@dataclass(frozen=True, config=STRICT)
class Negative(Memoryless, Primitive):
    """y = -u.

    Parameters
    ----------
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "negative"
    kernel: ClassVar[Kernel] = negative_kernel

    input: ChannelField = DISPLACEMENT
    output: ChannelField = DISPLACEMENT

    @property
    def n_parameters(self) -> int:
        """None."""
        return 0

    def pack(self) -> Array:
        """Return an empty vector."""
        return np.empty(0)

    def unpack(self, parameters: ArrayLike) -> Self:
        """Return this block, which has no parameters."""
        parameter_vector(self, parameters)
        return self

    def coefficients(self, sample_time: float | None) -> Array:
        """Return an empty vector."""
        del sample_time
        return np.empty(0)

    def inverse(self) -> Negative:
        """Return the block from output to input."""
        return Negative(self.output, self.input)

    @classmethod
    def example(cls) -> Self:
        """Return a change of sign."""
        return cls()
