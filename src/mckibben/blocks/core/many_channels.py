"""Blocks of several channels, with fields ``driven``, ``scheduled`` and ``given``."""

from __future__ import annotations

from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import Channel
from mckibben.errors import ModelError


class ManyChannels(Block):
    """A block driven by some channels, scheduled by others, that gives yet others."""

    driven: tuple[Channel, ...]
    scheduled: tuple[Channel, ...]
    given: tuple[Channel, ...]

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Channels driven, then those that schedule."""
        return (*self.driven, *self.scheduled)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Names of those that schedule."""
        return tuple(channel.name for channel in self.scheduled)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Channels given."""
        return self.given

    def check_channels(self) -> None:
        """Refuse names that repeat, or no channels at all."""
        for channels in (self.inputs, self.outputs):
            names = [channel.name for channel in channels]
            if not names or len(set(names)) < len(names):
                raise ModelError(
                    f"channels of {self.kind!r} are {names}. Remedy: give each a name of its own."
                )
