"""Plants, roles of their channels, and connections of blocks in a loop: by name and unit, not position.

Every input is found before the plant moves, under its own name and in its own unit, or made of another
way to measure the same motion by the rest length; or the loop is refused.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.blocks.fields import COMMANDS, Channel
from mckibben.control.twin import Twin, plain
from mckibben.errors import DataError
from mckibben.recording import MEASURED, REST_LENGTH, Recording, conversion, standard_unit

Channels = tuple[Channel, ...]


Line = tuple[int, float, float]
"""Index of a value in an array, and the gain and offset of its unit conversion."""


def match(channel: Channel, offered: Sequence[Channel], rest_length: float | None) -> Line | None:
    """Return the index of the matching channel, with gain and offset, or None."""
    names = [plain(channel.name) for channel in offered]
    wanted = plain(channel.name)
    if wanted in names:  # be it in another unit, which is refused
        index = names.index(wanted)
        return (index, 1.0, 0.0) if offered[index].unit == channel.unit else None
    for index, name in enumerate(names):
        line = conversion(wanted, name, rest_length)
        units = channel.unit == standard_unit(wanted), offered[index].unit == standard_unit(name)
        if line is not None and all(units):
            return (index, *line)
    return None


def find(
    channel: Channel, offered: Sequence[Channel], rest_length: float | None, taker: str, giver: str
) -> Line:
    """Return the result of `match`, or raise an error that names both sides."""
    line = match(channel, offered, rest_length)
    if line is not None:
        return line
    units = {plain(other.name): other.unit or "no unit" for other in offered}
    wanted, unit = plain(channel.name), channel.unit or "no unit"
    problem = f"{taker} needs it, but {giver} has {', '.join(units) or 'nothing'}"
    remedy = f"give it under that name, in {unit}, or use a block and a plant of the same channels"
    if wanted in units:
        problem = f"{taker} has it in {unit}, and {giver} in {units[wanted]}"
        remedy = f"identify the model with it in {units[wanted]}"
    elif any(conversion(wanted, name, 1.0) for name in units):
        remedy = f"state {REST_LENGTH}"
    raise DataError(problem, channel=channel.name, remedy=remedy)


class Selection:
    """Values selected from an array, and converted."""

    def __init__(self, lines: Sequence[Line]) -> None:
        places, gains, offsets = zip(*lines, strict=True)
        self._places = np.array(places)
        self._gains, self._offsets = np.array(gains), np.array(offsets)
        self._as_they_are = set(gains) == {1.0} and set(offsets) == {0.0}

    def __call__(self, values: Array) -> Array:
        """Return the values, a new array."""
        selected: Array = values[self._places]
        return selected if self._as_they_are else self._gains * selected + self._offsets


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
    held : tuple of str
        Inputs of the plant that the reference sets.
    rest_length : float or None
        Of the muscle [mm].
    """

    plant: str
    followed: Channels
    scheduled: Channels
    measured: Channels
    driven: Channels
    held: tuple[str, ...] = ()
    rest_length: float | None = None

    def inputs(self, block: Block, beside: Channels = ()) -> Selection:
        """Return the selection of a block's inputs from references, schedule, measurements and others.

        What is driven through the block follows a reference; what ends in `MEASURED` is measured; and
        what schedules it is in the reference or is measured.
        """
        signals = (*self.followed, *self.scheduled, *self.measured, *beside)
        start = len(self.followed) + len(self.scheduled)
        length, title, loop = self.rest_length, block.title, f"a loop on {self.plant}"
        lines = []
        for k, channel in enumerate(block.inputs):
            if k < block.n_driven:
                line = find(channel, self.followed, length, title, f"what is followed in {loop}")
            elif channel.name.endswith(MEASURED):
                measured = Channel(channel.name.removesuffix(MEASURED), channel.unit)
                line = find(measured, self.measured, length, title, self.plant)
                line = start + line[0], *line[1:]
            else:
                line = find(channel, signals, length, title, loop)
            lines.append(line)
        return Selection(lines)

    def selected(
        self, channels: Channels, offered: Sequence[Channel], taker: str, giver: str
    ) -> Selection:
        """Return the selection of channels out of others; raise an error as `find` does."""
        return Selection([find(c, offered, self.rest_length, taker, giver) for c in channels])

    def commands(self, block: Block) -> Selection:
        """Return the selection of the plant's commands from a block's outputs."""
        for channel in block.outputs:
            find(channel, self.driven, None, block.title, f"what drives {self.plant}")
        return self.selected(self.driven, block.outputs, self.plant, block.title)


MOVED = ("displacement", "angle")
"""Names of motions of muscles and joints."""

NOISE = 0.01
"""Share of a rig's range by which a constant input may exceed it, for sensor noise."""

Kind = Literal["rig", "same model", "another model"]
"""A virtual rig; the model that a compensator inverts; or another model."""


class Plant(Protocol):
    """Interface of a plant: the step interface of rigs."""

    @property
    def name(self) -> str:
        """Short name."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Channels that drive it."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Channels that it measures."""

    def reset(self, seed: int = 0) -> Array:
        """Reset to rest, and return the first measurement."""

    def step(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Hold commands for one sample time and return the next measurement."""

    def limits(self, name: str) -> Any:
        """Return the hardware limits of an input channel: ``low`` and ``high``."""

    def changed(self, settings: Mapping[str, Any]) -> Any:
        """Return the same plant with other settings."""


def kind_of(plant: Plant, compensator: Block) -> Kind:
    """Return what kind of plant a compensator is tested on.

    Errors on the same model come from limits, rates and rounding alone, whatever the muscle does.
    """
    if not isinstance(plant, Twin):
        return "rig"
    model = compensator.forward_model
    same = model is not None and inside(model).to_dict() == plant.forward.to_dict()
    return "same model" if same else "another model"


def flatters_feedback(plant: Plant, law: str) -> bool:
    """Return whether feedback performs better on a plant than on a muscle: it responds at once."""
    return isinstance(plant, Twin) and law != "feedforward" and not plant.forward.rate_dependent


def rest_length_of(plant: Plant) -> float | None:
    """Return the length of a plant's muscle at displacement 0 [mm]; None if unknown."""
    length: float | None = getattr(plant, "rest_length", None)
    return length


def reference_for(
    plant: Plant, reference: Recording, compensator: Block | None = None
) -> Recording:
    """Return a reference in the channels of a plant, converted by the rest length if necessary.

    Recorded channels that are outputs of the compensator are left out.
    """
    if compensator is not None:
        outputs = [channel.name for channel in compensator.outputs]
        commanded = {*outputs, *map(plain, outputs)}
        recorded = [name for name in reference.channels if name not in commanded]
        # a reference of pressures alone is unchanged: following it raises an error
        if 0 < len(recorded) < len(reference.channels):
            reference = reference.select(recorded)
    if (length := rest_length_of(plant)) is not None:
        reference = reference.with_meta(rest_length=length)
    return reference.with_derived([*plant.outputs, *plant.inputs])


def channels_of(plant: Plant, names: Iterable[str]) -> tuple[Channel, ...]:
    """Return channels of a plant with their units: those of a twin's model, or the package's."""
    units = plant.units if isinstance(plant, Twin) else {}
    return tuple(Channel(name, units.get(name, standard_unit(name) or "")) for name in names)


def offer_of(plant: Plant, reference: Recording) -> Offer:
    """Return the signals that a loop on a plant offers to a controller, and its commands.

    Raises
    ------
    DataError
        If the plant measures no channel of the reference, or in another unit.
    """
    followed = followed_by(plant, reference)
    held = tuple(name for name in plant.inputs if name in reference)
    driven = driven_inputs(plant, held)
    reference_channels = [Channel(name, unit) for name, unit in reference.units.items()]
    for channel in channels_of(plant, (*plant.inputs, *plant.outputs)):
        if channel.name in reference:  # in its unit, or refused
            find(channel, reference_channels, None, plant.name, "the reference")
    return Offer(
        plant.name,
        channels_of(plant, followed),
        tuple(
            channel for channel in reference_channels if channel.name not in (*followed, *driven)
        ),
        channels_of(plant, plant.outputs),
        channels_of(plant, driven),
        held,
        reference.rest_length,
    )


def followed_by(plant: Plant, reference: Recording) -> list[str]:
    """Return the motions, or the force, of a reference that a plant measures; for a twin, all outputs.

    Raises
    ------
    DataError
        If there is none.
    """
    measured_too = [name for name in plant.outputs if name in reference]
    followed = [name for name in measured_too if name.startswith(MOVED)]
    followed = followed or [name for name in measured_too if name == "force"]
    if isinstance(plant, Twin):
        followed = followed or measured_too
    if not followed:
        pairs = [(name, channel) for name in plant.outputs for channel in reference.channels]
        state = f", or state {REST_LENGTH}" if any(conversion(*pair, 1.0) for pair in pairs) else ""
        raise DataError(
            f"it has no displacement, angle or force that {plant.name!r} measures",
            file=reference.source,
            remedy=f"give channels among {', '.join(plant.outputs)}{state}",
        )
    return followed


def rest_settings(plant: Plant, held: Mapping[str, float]) -> dict[str, float]:
    """Return the settings of a plant that rests at the held inputs, ignoring noise beyond its range.

    Raises
    ------
    DataError
        Where it is farther beyond.
    """
    settings = {}
    for name, value in held.items():
        settings[f"start.{name}"] = value
        if isinstance(plant, Twin):  # takes any recorded value
            continue
        limits = plant.limits(name)
        nearest, tolerance = (
            min(max(value, limits.low), limits.high),
            NOISE * (limits.high - limits.low),
        )
        if abs(value - nearest) > tolerance:
            raise DataError(
                f"the reference begins at {value:g}, and {plant.name!r} takes {limits.low:g} to "
                f"{limits.high:g}",
                channel=name,
                remedy="begin it within that range, or leave the column out",
            )
        settings[f"start.{name}"] = nearest
    return settings


def driven_inputs(plant: Plant, held: Collection[str]) -> list[str]:
    """Return the inputs of a plant that drive its muscles, and are not held.

    They are pressures or voltages; those of a twin are its `driving` inputs.
    """
    free = [name for name in plant.inputs if name not in held]
    if isinstance(plant, Twin):
        driven = [name for name in free if name in plant.driving]
    else:
        driven = [name for name in free if name.startswith(COMMANDS)]
    return [name for name in driven if name.rpartition("_")[2].isdigit()] or driven
