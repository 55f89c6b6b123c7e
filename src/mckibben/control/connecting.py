"""Connections of blocks in a loop, matched by name and unit, never by position.

Every input is found before the plant moves, under its own name and in its own unit, or made of another
way to measure the same motion by the rest length; or the loop is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.control.twin import plain
from mckibben.errors import DataError
from mckibben.recording import MEASURED, REST_LENGTH, conversion, standard_unit

Channels = tuple[Channel, ...]


Line = tuple[int, float, float]
"""Index of a value in an array, and the gain and offset of its unit conversion."""


def match(wanted: Channel, offered: Sequence[Channel], rest_length: float | None) -> Line | None:
    """Return the index of the matching channel, with gain and offset, or None."""
    names = [plain(channel.name) for channel in offered]
    own = plain(wanted.name)
    if own in names:  # be it in another unit, which is refused
        place = names.index(own)
        return (place, 1.0, 0.0) if offered[place].unit == wanted.unit else None
    for place, name in enumerate(names):
        line = conversion(own, name, rest_length)
        units = wanted.unit == standard_unit(own), offered[place].unit == standard_unit(name)
        if line is not None and all(units):
            return (place, *line)
    return None


def find(
    wanted: Channel, offered: Sequence[Channel], rest_length: float | None, taker: str, giver: str
) -> Line:
    """Return the result of `match`, or raise an error that names both sides."""
    line = match(wanted, offered, rest_length)
    if line is not None:
        return line
    units = {plain(other.name): other.unit or "no unit" for other in offered}
    own, unit = plain(wanted.name), wanted.unit or "no unit"
    problem = f"{taker} needs it, but {giver} has {', '.join(units) or 'nothing'}"
    remedy = f"give it under that name, in {unit}, or use a block and a plant of the same channels"
    if own in units:
        problem = f"{taker} has it in {unit}, and {giver} in {units[own]}"
        remedy = f"identify the model with it in {units[own]}"
    elif any(conversion(own, name, 1.0) for name in units):
        remedy = f"state {REST_LENGTH}"
    raise DataError(problem, channel=wanted.name, remedy=remedy)


class Selection:
    """Values selected from an array, and converted."""

    def __init__(self, lines: Sequence[Line]) -> None:
        places, gains, offsets = zip(*lines, strict=True)
        self._places = np.array(places)
        self._gains, self._offsets = np.array(gains), np.array(offsets)
        self._as_they_are = set(gains) == {1.0} and set(offsets) == {0.0}

    def __call__(self, values: Array) -> Array:
        """Return the values, a new array."""
        found: Array = values[self._places]
        return found if self._as_they_are else self._gains * found + self._offsets


@dataclass(frozen=True)
class Offer:
    """Signals that a loop offers to a controller, and commands that it accepts.

    Parameters
    ----------
    plant : str
    followed, scheduled : tuple of Channel
        What of a reference the plant measures, and all else in it.
    measured, driven : tuple of Channel
        All that the plant measures, and what is commanded.
    rest_length : float or None
        Of the muscle [mm].
    """

    plant: str
    followed: Channels
    scheduled: Channels
    measured: Channels
    driven: Channels
    rest_length: float | None = None

    def inputs(self, block: Block, beside: Channels = ()) -> Selection:
        """Return the selection of a block's inputs from references, schedule, measurements and others.

        What is driven through the block follows a reference; what ends in `MEASURED` is measured; and
        what schedules it is in the reference or is measured.
        """
        every = (*self.followed, *self.scheduled, *self.measured, *beside)
        start = len(self.followed) + len(self.scheduled)
        length, title, loop = self.rest_length, block.title, f"a loop on {self.plant}"
        lines = []
        for k, channel in enumerate(block.inputs):
            if k < block.n_driven:
                line = find(channel, self.followed, length, title, f"what is followed in {loop}")
            elif channel.name.endswith(MEASURED):
                own = Channel(channel.name.removesuffix(MEASURED), channel.unit)
                line = find(own, self.measured, length, title, self.plant)
                line = start + line[0], *line[1:]
            else:
                line = find(channel, every, length, title, loop)
            lines.append(line)
        return Selection(lines)

    def selected(
        self, wanted: Channels, offered: Sequence[Channel], taker: str, giver: str
    ) -> Selection:
        """Return the selection of channels out of others; raise an error as `find` does."""
        return Selection([find(c, offered, self.rest_length, taker, giver) for c in wanted])

    def commands(self, block: Block) -> Selection:
        """Return the selection of the plant's commands from a block's outputs."""
        for channel in block.outputs:
            find(channel, self.driven, None, block.title, f"what drives {self.plant}")
        return self.selected(self.driven, block.outputs, self.plant, block.title)
