"""What gives commands instead of motion: compensators, which undo a model."""

from __future__ import annotations

from mckibben.blocks.core.block import Block
from mckibben.blocks.core.composition import Composition
from mckibben.blocks.core.fields import Channel

COMMANDS = ("pressure", "voltage")
"""How channels that drive a muscle are called."""

UNITS = ("bar", "V")
"""Units of channels that drive a muscle, whatever they are called."""


def drives(channel: Channel) -> bool:
    """Tell whether a channel is a command, by its name or unit."""
    return channel.name.startswith(COMMANDS) or channel.unit in UNITS


def undoes(block: Block) -> bool:
    """Tell whether a block is an inverse, or holds one: it reaches only what the block undone wants."""
    if isinstance(block, Composition):
        return any(map(undoes, block.parts))
    return block.undoing


def commands(block: Block) -> bool:
    """Tell whether a block undoes another and gives what drives a muscle.

    Not every inverse does: a forward model solved from a law of forces is one, and gives a displacement.
    """
    return undoes(block) and drives(block.outputs[0])
