"""What a block in a loop is given, and what it drives: by name and unit, never by position.

Every input is found before the plant moves, under its own name and in its own unit, or made of another
way to measure the same motion by the rest length; or the loop is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.feedback import MEASURED
from mckibben.blocks.fields import Channel
from mckibben.control.twin import plain
from mckibben.errors import DataError
from mckibben.recording import REST_LENGTH, conversion, standard_unit

Channels = tuple[Channel, ...]


def match(
    wanted: Channel, offered: Sequence[Channel], rest_length: float | None
) -> tuple[int, float, float] | None:
    """Return the place of the channel that another is, or is made of, with gain and offset, or None."""
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


class Line(NamedTuple):
    """Where a value is in an array, and the gain and offset that convert it."""

    place: int
    gain: float
    offset: float


Offered = Sequence[tuple[Channel, int]]
"""Channels with their places in an array."""


def lines(
    wanted: Sequence[Channel], offered: Offered, rest_length: float | None, taker: str, giver: str
) -> list[Line]:
    """Return where channels are in an array.

    Parameters
    ----------
    wanted : sequence of Channel
    offered : sequence of (Channel, int)
    rest_length : float or None
        Of the muscle [mm].
    taker, giver : str
        Who needs and who offers the channels, in a refusal.

    Raises
    ------
    DataError
        If one is not offered, or in another unit.
    """
    channels, found = [one for one, _ in offered], []
    for channel in wanted:
        line = match(channel, channels, rest_length)
        if line is None:
            raise _refusal(channel, channels, taker, giver)
        found.append(Line(offered[line[0]][1], *line[1:]))
    return found


class Selection:
    """Values picked out of an array, and converted."""

    def __init__(self, found: Sequence[Line]) -> None:
        places, gains, offsets = zip(*found, strict=True)
        self._places = np.array(places)
        self._gains, self._offsets = np.array(gains), np.array(offsets)
        self._as_they_are = set(gains) == {1.0} and set(offsets) == {0.0}

    def __call__(self, values: Array) -> Array:
        """Return the values, a new array."""
        found: Array = values[self._places]
        return found if self._as_they_are else self._gains * found + self._offsets


def _refusal(channel: Channel, offered: Sequence[Channel], taker: str, giver: str) -> DataError:
    unit = channel.unit or "no unit"
    for other in offered:
        if plain(other.name) == plain(channel.name):
            return DataError(
                f"{taker} has it in {unit}, and {giver} in {other.unit or 'no unit'}",
                channel=channel.name,
                remedy=f"identify the model with it in {other.unit or 'no unit'}",
            )
    listed = ", ".join(dict.fromkeys(other.name for other in offered)) or "nothing"
    remedy = f"give it under that name, in {unit}, or use a block and a plant of the same channels"
    if any(conversion(plain(channel.name), plain(other.name), 1.0) for other in offered):
        remedy = f"state {REST_LENGTH}"
    return DataError(
        f"{taker} needs it, and {giver} gives {listed}", channel=channel.name, remedy=remedy
    )


@dataclass(frozen=True)
class Offer:
    """What a loop gives a controller at every step, and what it takes of it.

    Parameters
    ----------
    plant : str
        Its name.
    followed : tuple of Channel
        Whose references are given, as the plant measures them.
    scheduled : tuple of Channel
        What else a reference has.
    measured : tuple of Channel
        All that the plant measures.
    driven : tuple of Channel
        What the controller commands.
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
        """Return what picks a block's inputs from references, schedule, measurements and others.

        What is driven through the block follows a reference; what ends in `MEASURED` is measured; and
        what schedules it is in the reference or is measured.
        """
        every = (*self.followed, *self.scheduled, *self.measured, *beside)
        placed = [(channel, place) for place, channel in enumerate(every)]
        followed, others = placed[: len(self.followed)], placed[len(self.followed) :]
        measured = others[len(self.scheduled) : len(self.scheduled) + len(self.measured)]
        others += [(Channel(f"{c.name}{MEASURED}", c.unit), place) for c, place in measured]
        driven, rest = block.inputs[: block.n_driven], block.inputs[block.n_driven :]
        length, title, loop = self.rest_length, block.title, f"a loop on {self.plant}"
        reference = f"what is followed in {loop}"
        return Selection(
            lines(driven, followed, length, title, reference)
            + lines(rest, [*followed, *others], length, title, loop)
        )

    def shown(self, wanted: Channels, title: str) -> Selection:
        """Return what picks channels out of all that the plant measures."""
        offered = [(channel, place) for place, channel in enumerate(self.measured)]
        return Selection(lines(wanted, offered, self.rest_length, title, self.plant))

    def commands(self, block: Block) -> Selection:
        """Return what picks the plant's commands from a block's outputs.

        Raises
        ------
        DataError
            If the block does not give one, or gives what does not drive the plant.
        """
        names = {channel.name for channel in self.driven}
        for channel in block.outputs:
            if plain(channel.name) not in names:
                raise DataError(
                    f"{block.title} gives it, and {', '.join(sorted(names)) or 'nothing'} drives "
                    f"{self.plant}",
                    channel=channel.name,
                    remedy="use a compensator and a plant of the same commands",
                )
        offered = [(channel, place) for place, channel in enumerate(block.outputs)]
        return Selection(lines(self.driven, offered, None, self.plant, block.title))
