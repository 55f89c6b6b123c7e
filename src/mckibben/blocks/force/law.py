"""What static force laws share: force by length, at a pressure that is measured."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block, Primitive
from mckibben.blocks.fields import Channel, Initial
from mckibben.blocks.named import NamedParameters
from mckibben.errors import ModelError

Array = NDArray[np.float64]


class ForceLaw(NamedParameters, Primitive):
    """A static force law: driven by length [mm], scheduled by pressure [bar], giving force [N]."""

    initial: ClassVar[Initial] = "first_sample"

    input: Channel
    pressure: Channel
    output: Channel

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Length, then pressure."""
        return (self.input, self.pressure)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Force."""
        return (self.output,)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Pressure."""
        return (self.pressure.name,)

    @property
    def n_states(self) -> int:
        """None."""
        return 0

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return an empty state."""
        del first, initial
        return np.empty(0)

    @abstractmethod
    def terms(self, length: Array) -> tuple[Array, Array]:
        """Return force per pressure [N/bar], and force without any [N], each of the shape given."""

    def inverse(self) -> Block:
        """Refuse: what undoes a force law gives pressure, not length."""
        raise ModelError(
            f"{self.kind!r} has no inverse by length, since more than one may give a force. Remedy: "
            "for the pressure that gives a force at a length, use ForceFeedforward(law)."
        )
