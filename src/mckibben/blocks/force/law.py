"""What static force laws share: force by length, at a pressure that is measured."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block, Primitive
from mckibben.blocks.core.fields import Channel, Initial
from mckibben.blocks.core.single_channel import ScheduledChannel
from mckibben.blocks.core.stateless import Stateless
from mckibben.errors import ModelError


class ForceLaw(Stateless, ScheduledChannel, Primitive):
    """A static force law: driven by length [mm], scheduled by pressure [bar], giving force [N]."""

    initial: ClassVar[Initial] = "first_sample"

    scheduled_by: ClassVar[str] = "pressure"

    pressure: Channel

    number: ClassVar[int]
    """What C tells it by, in a feedforward."""

    @abstractmethod
    def terms(self, length: Array) -> tuple[Array, Array]:
        """Return force per pressure [N/bar], and force without any [N], each of the shape given."""

    def inverse(self) -> Block:
        """Refuse: what undoes a force law gives pressure, not length."""
        raise ModelError(
            f"{self.kind!r} has no inverse by length, since more than one may give a force. Remedy: "
            "for the pressure that gives a force at a length, use ForceFeedforward(law)."
        )
