"""Kinds of plants, and roles of their channels, by name: driven, followed, or held."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any, Literal, Protocol

from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.blocks.fields import COMMANDS, Channel
from mckibben.control.connecting import Offer, find
from mckibben.control.twin import Twin, plain
from mckibben.errors import DataError
from mckibben.recording import REST_LENGTH, Recording, conversion, standard_unit

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


def asked(plant: Plant, reference: Recording, compensator: Block | None = None) -> Recording:
    """Return a reference in the channels of a plant, converted by the rest length if necessary.

    Recorded channels that are outputs of the compensator are left out.
    """
    if compensator is not None:
        outputs = [channel.name for channel in compensator.outputs]
        commanded = {*outputs, *map(plain, outputs)}
        others = [name for name in reference.channels if name not in commanded]
        # a reference of pressures alone is unchanged: following it raises an error
        if 0 < len(others) < len(reference.channels):
            reference = reference.select(others)
    if (length := rest_length_of(plant)) is not None:
        reference = reference.with_meta(rest_length=length)
    return reference.with_derived([*plant.outputs, *plant.inputs])


def channels_of(plant: Plant, names: Iterable[str]) -> tuple[Channel, ...]:
    """Return channels of a plant with their units: those of a twin's model, or the package's."""
    units = plant.units if isinstance(plant, Twin) else {}
    return tuple(Channel(name, units.get(name, standard_unit(name) or "")) for name in names)


def offered(plant: Plant, reference: Recording) -> Offer:
    """Return the signals that a loop on a plant offers to a controller, and its commands.

    Raises
    ------
    DataError
        If the plant measures no channel of the reference, or in another unit.
    """
    followed = followed_by(plant, reference)
    driven, _ = roles(plant, reference)
    given = [Channel(name, unit) for name, unit in reference.units.items()]
    for channel in channels_of(plant, (*plant.inputs, *plant.outputs)):
        if channel.name in reference:  # in its unit, or refused
            find(channel, given, None, plant.name, "the reference")
    return Offer(
        plant.name,
        channels_of(plant, followed),
        tuple(channel for channel in given if channel.name not in (*followed, *driven)),
        channels_of(plant, plant.outputs),
        channels_of(plant, driven),
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
        pairs = [(name, given) for name in plant.outputs for given in reference.channels]
        state = f", or state {REST_LENGTH}" if any(conversion(*pair, 1.0) for pair in pairs) else ""
        raise DataError(
            f"it has no displacement, angle or force that {plant.name!r} measures",
            file=reference.source,
            remedy=f"give channels among {', '.join(plant.outputs)}{state}",
        )
    return followed


def roles(plant: Plant, reference: Recording) -> tuple[list[str], list[str]]:
    """Return the inputs driven by a controller, and those set by a reference."""
    held = [name for name in plant.inputs if name in reference]
    return actuated(plant, held), held


def resting(plant: Plant, held: Mapping[str, float]) -> dict[str, float]:
    """Return the settings of a plant that rests at the held inputs, ignoring noise beyond its range.

    Raises
    ------
    DataError
        Where it is farther beyond.
    """
    found = {}
    for name, value in held.items():
        found[f"start.{name}"] = value
        if isinstance(plant, Twin):  # takes any recorded value
            continue
        limits = plant.limits(name)
        near, beyond = min(max(value, limits.low), limits.high), NOISE * (limits.high - limits.low)
        if abs(value - near) > beyond:
            raise DataError(
                f"the reference begins at {value:g}, and {plant.name!r} takes {limits.low:g} to "
                f"{limits.high:g}",
                channel=name,
                remedy="begin it within that range, or leave the column out",
            )
        found[f"start.{name}"] = near
    return found


def actuated(plant: Plant, held: Collection[str]) -> list[str]:
    """Return the inputs of a plant that drive its muscles, and are not held.

    They are pressures or voltages; those of a twin are its `driving` inputs.
    """
    free = [name for name in plant.inputs if name not in held]
    if isinstance(plant, Twin):
        driven = [name for name in free if name in plant.driving]
    else:
        driven = [name for name in free if name.startswith(COMMANDS)]
    return [name for name in driven if name.rpartition("_")[2].isdigit()] or driven
