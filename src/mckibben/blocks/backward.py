"""What all blocks that undo another one share: its parameters, and its channels the other way round."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel

Array = NDArray[np.float64]


class Backward(Block):
    """A block that undoes its field ``forward``; what schedules that one schedules this one too."""

    forward: Any

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """The forward block's outputs, then what schedules it."""
        channels: tuple[Channel, ...] = self.forward.inputs
        return (*self.forward.outputs, *channels[len(self.outputs) :])

    @property
    def scheduling(self) -> tuple[str, ...]:
        """What schedules the forward block."""
        names: tuple[str, ...] = self.forward.scheduling
        return names

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """The forward block's driven inputs."""
        channels: tuple[Channel, ...] = self.forward.inputs
        return channels[: len(channels) - len(self.forward.scheduling)]

    @property
    def n_parameters(self) -> int:
        """Those of the forward block."""
        return int(self.forward.n_parameters)

    def pack(self) -> Array:
        """Return the forward block's parameters."""
        parameters: Array = self.forward.pack()
        return parameters

    def unpack(self, parameters: ArrayLike) -> Self:
        """Return the inverse of a forward block with other parameters."""
        return type(self)(self.forward.unpack(parameters))  # type: ignore[call-arg]

    def inverse(self) -> Block:
        """Return the forward block."""
        forward: Block = self.forward
        return forward
