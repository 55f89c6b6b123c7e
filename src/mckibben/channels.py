"""Selection of inputs, outputs and further inputs among the channels of recordings."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import COMMAND, REFERENCE, Recording

Names = str | Sequence[str] | None
"""One channel, several, or None to choose by the recordings' names."""

DRIVING = ("pressure", "voltage", "command", "input", "u", "p")
"""Names of inputs, those nearest to the muscle first."""

ALONG, TURNED = ("displacement", "length", "contraction", "position"), ("angle",)
"""Names of translations and of rotations."""

COORDINATES = "[xyz]"
"""Coordinates of a position; each is a separate output."""

MOVED = (*ALONG, *TURNED, "output", COORDINATES)
"""Names of outputs."""

UNITS_DRIVING, UNITS_MOVED = ("bar", "V"), ("mm", "rad")
"""Units of inputs and of outputs, for names that are not recognised."""

PLACES = "[a-z]|left|right|top|bottom|upper|lower|front|back|rear|flexor|extensor"
"""Suffixes other than numbers that distinguish channels of one quantity."""

SCHEDULES = ("pressure_extensor", "force", "torque")
"""Default scheduling channels."""

PULLS = ("force", "torque")
"""Outputs of muscles that are held."""

LOADS = ("N", "N*m")
"""Units of loads on muscles or a joint, which are not scheduling inputs."""

FORCE, PRESSURE, OF_FORCE = "force", "pressure", ("length", "displacement")
"""Channels of force laws: the first of these that is present, with the pressure."""

HELD = 0.01
"""Smallest variation of a length, relative to its largest value, for which a force law is fitted.
"""

STEADY = 0.05
"""Largest variation of a load within a run, relative to that over all runs, for which it counts as
constant in the run.
"""

Sides = tuple[tuple[str, ...], tuple[str, ...]]
"""Inputs and outputs."""


@dataclass(frozen=True)
class Channels:
    """Inputs, outputs and scheduling channels of a comparison.

    Parameters
    ----------
    inputs, outputs : tuple of str
        Of every model.
    scheduling : tuple of str or None
        Loads, for models that can take them; None for what these find by name.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    scheduling: tuple[str, ...] | None = None

    @property
    def single(self) -> bool:
        """Whether this is one muscle without a load input."""
        return len(self.inputs) == len(self.outputs) == 1 and self.scheduling is None

    def scheduled(self, recordings: Sequence[Recording]) -> tuple[str, ...]:
        """Return the scheduling channels for models of recordings."""
        if self.scheduling is not None:
            return self.scheduling
        return () if self.single else schedules(recordings, (*self.inputs, *self.outputs))

    def known(self, recordings: Sequence[Recording]) -> tuple[str, ...]:
        """Return all input channels of the models; force laws also use the pressure."""
        names = (*self.inputs, *self.scheduled(recordings))
        by_length = self.outputs == (FORCE,) and any(name in OF_FORCE for name in names)
        finds = by_length and PRESSURE not in names and all(PRESSURE in one for one in recordings)
        return (*names, PRESSURE) if finds else names

    def ignored(self, recordings: Sequence[Recording]) -> tuple[str, ...]:
        """Return varying loads and lengths that are no input of any model."""
        lengths = OF_FORCE if self.outputs == (FORCE,) else ()
        others = {*self.known(recordings), *self.outputs}
        some = dict.fromkeys([*schedules(recordings), *lengths])
        return tuple(
            name
            for name in some
            if name not in others and varies([one[name] for one in recordings if name in one])
        )

    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return every output with the input of the same number, or of the same position."""

        def own(place: int, output: str) -> str:
            number = re.search(r"\d*$", output)
            alike = [
                name for name in self.inputs if number and number[0] and name.endswith(number[0])
            ]
            return alike[0] if len(alike) == 1 else self.inputs[min(place, len(self.inputs) - 1)]

        return tuple((own(place, output), output) for place, output in enumerate(self.outputs))


def channels_of(
    recordings: Sequence[Recording],
    inputs: Names = None,
    outputs: Names = None,
    load: str | None = None,
) -> Channels:
    """Return the channels of a comparison: as named, otherwise by names and units.

    A force is a load if there are other inputs. Force is modelled over length or displacement, where
    that varies and nothing else is moved; models of it find the pressure themselves. A length that is
    constant in every recording schedules instead, and the pressure drives.

    Raises
    ------
    DataError
        If a recording lacks the load, or a channel is named twice.
    """
    asked = [(names,) if isinstance(names, str) else names for names in (inputs, outputs)]
    over = None if load else _force_over(recordings, *asked)
    if over is not None:
        if _only_schedules(recordings, over) and asked[0] != (over,):
            return Channels((PRESSURE,), (FORCE,), (over,))
        return Channels((over,), (FORCE,))
    every = list(dict.fromkeys(name for recording in recordings for name in recording.channels))
    found = _by_name(every, _units(recordings, every))
    usual = FORCE if lacks_displacement(recordings) else OF_FORCE[-1]
    sides = found[0] or (PRESSURE,), found[1] or (usual,)
    if usual == FORCE:
        sides = sides[0], (FORCE,)
    elif inputs is None and outputs is None and load is None:
        if pull := _pulls_held(recordings, sides):
            return Channels(sides[0], pull, sides[1])
        sides = _over_held(recordings, sides)
    given = _named(recordings, inputs, sides[0])
    wanted = _named(recordings, outputs, sides[1])
    channels = with_loads_scheduled(recordings, Channels(given, wanted, (load,) if load else None))
    further = channels.scheduling or ()
    named = (*channels.inputs, *channels.outputs, *further)
    if twice := [name for name in named if named.count(name) > 1]:
        raise DataError(
            "the channel is named twice among inputs, outputs and load",
            channel=twice[0],
            remedy="an output cannot also be an input: name each channel once",
        )
    for name in further:
        for recording in recordings:
            if name not in recording:
                raise DataError(
                    "there is no such channel to give the load",
                    file=recording.source,
                    channel=name,
                    remedy="name it with `columns[CHANNEL]=COLUMN`, or leave `load` out",
                )
    return channels


def recognised(recordings: Sequence[Recording], channels: Sequence[str]) -> Sides:
    """Return inputs and outputs among the channels common to all recordings; of several, all.

    Where none is recognised, the first drives the second.
    """
    if not channels:
        return (), ()
    inputs, outputs = _by_name(channels, _units(recordings, channels))
    inputs = inputs or tuple(channels[:1])
    rest = [name for name in channels if name not in inputs] or list(channels)
    return _over_held(recordings, (inputs, outputs or tuple(rest[:1])))


def with_loads_scheduled(recordings: Sequence[Recording], channels: Channels) -> Channels:
    """Return channels with forces as scheduling loads, if there are other inputs."""
    loads = loads_among(recordings, channels.inputs)
    if channels.scheduling is not None or not loads:
        return channels
    driven = tuple(name for name in channels.inputs if name not in loads)
    return replace(channels, inputs=driven, scheduling=loads)


def with_dead_loads_scheduled(recordings: Sequence[Recording], channels: Channels) -> Channels:
    """Return channels of one muscle with the loads that are constant in every recording."""
    if not (channels.single and recordings):
        return channels
    held = [
        name
        for name in schedules(recordings, (*channels.inputs, *channels.outputs))
        if all(name in one for one in recordings) and held_at_levels(recordings, name)
    ]
    return replace(channels, scheduling=tuple(held)) if held else channels


def held_at_levels(recordings: Sequence[Recording], name: str) -> bool:
    """Return whether a channel differs between recordings but is nearly constant in each."""
    span = float(np.ptp(np.concatenate([one[name] for one in recordings])))
    return span > 0 and all(float(np.ptp(one[name])) <= STEADY * span for one in recordings)


def any_moves(recordings: Sequence[Recording], channels: Sequence[str]) -> bool:
    """Return whether any channel varies within a recording by more than rounding."""
    return any(
        float(np.ptp(run[name])) > 1e-6 * (1.0 + float(np.abs(run[name]).max()))
        for run in recordings
        for name in channels
        if name in run and len(run)
    )


def varies(lengths: Sequence[Array]) -> bool:
    """Return whether lengths are held at several values over all recordings, ignoring approaches."""
    samples = np.concatenate([*lengths, np.zeros(0)])
    if not samples.size:
        return False
    return bool(np.ptp(np.percentile(samples, (1.0, 99.0))) > HELD * np.abs(samples).max())


def lacks_displacement(recordings: Sequence[Recording]) -> bool:
    """Return whether the only model possible is force by length and pressure."""
    others = (*ALONG, *TURNED)
    return all(
        {OF_FORCE[0], PRESSURE, FORCE} <= {*one.channels}
        and not any(name.startswith(others) for name in one.channels if name != OF_FORCE[0])
        for one in recordings
    ) and any_moves(recordings, (FORCE,))


def moved_by(recordings: Sequence[Recording], given: str, channels: Sequence[str]) -> str:
    """Return the abscissa of an output's loop: its input, or the driving channel if that is constant."""
    if any_moves(recordings, (given,)):
        return given
    driving = _called(channels, DRIVING)
    return driving[0] if driving and any_moves(recordings, driving[:1]) else given


def _force_over(
    recordings: Sequence[Recording], inputs: Sequence[str] | None, outputs: Sequence[str] | None
) -> str | None:
    """Return the length or displacement of a force law with pressure, or None.

    Where it is constant in every recording and the force is not, it is no output.
    """
    meant = lacks_displacement(recordings) if outputs is None else tuple(outputs) == (FORCE,)
    free = all(FORCE in one for one in recordings) and not held_at_levels(recordings, FORCE)
    for name in OF_FORCE:
        if not meant and not (outputs is None and free and _only_schedules(recordings, name)):
            continue
        asked = inputs is None or set(inputs) in ({name}, {name, PRESSURE})
        asked = asked or (set(inputs or ()) == {PRESSURE} and _only_schedules(recordings, name))
        there = all({name, PRESSURE, FORCE} <= {*one.channels} for one in recordings)
        if asked and there and varies([one[name] for one in recordings]):
            return name
    return None


def _only_schedules(recordings: Sequence[Recording], name: str) -> bool:
    """Return whether a channel is constant in every recording, where the pressure is not."""
    there = all(name in one and PRESSURE in one for one in recordings)
    return (
        there
        and held_at_levels(recordings, name)
        and not held_at_levels(recordings, PRESSURE)
        and any_moves(recordings, (PRESSURE,))
    )


def _pulls_held(recordings: Sequence[Recording], sides: Sides) -> tuple[str, ...]:
    """Return the force or torque that the inputs drive, where the output is held at levels; or none."""
    inputs, outputs = sides
    free = [
        name
        for name in PULLS
        if all(name in one for one in recordings)
        and any_moves(recordings, (name,))
        and not held_at_levels(recordings, name)
    ]
    there = all(name in one for one in recordings for name in (*inputs, *outputs))
    held = there and all(held_at_levels(recordings, name) for name in outputs)
    driven = held and any_moves(recordings, inputs)
    return tuple(free[:1]) if driven else ()


def _over_held(recordings: Sequence[Recording], sides: Sides) -> Sides:
    """Return force instead of the output, if that is held in all recordings and the force is not."""
    outputs = sides[1]
    held = len(outputs) == 1 and not any_moves(recordings, outputs)
    forced = all(FORCE in one for one in recordings) and any_moves(recordings, (FORCE,))
    return (outputs, (FORCE,)) if held and forced and outputs != (FORCE,) else sides


def _units(recordings: Sequence[Recording], channels: Sequence[str]) -> dict[str, str]:
    return {
        name: next((one.units.get(name, "") for one in recordings if name in one), "")
        for name in channels
    }


def _by_name(channels: Sequence[str], units: Mapping[str, str]) -> Sides:
    """Return inputs and outputs by name, else by unit; empty if neither is recognised.

    Outputs are the first quantity, or where those are fewer than inputs, the most of a kind. Kinds are
    not mixed: errors in mm and in rad have no mean.
    """
    inputs = _called(channels, DRIVING) or _in_units(channels, units, UNITS_DRIVING)
    rest = [name for name in channels if name not in inputs]
    outputs = _called(rest, MOVED) or _in_units(rest, units, UNITS_MOVED)
    if len(outputs) < len(inputs):
        along = _called(rest, (*ALONG, COORDINATES)) or _in_units(rest, units, ("mm",))
        turned = _called(rest, TURNED) or _in_units(rest, units, ("rad",))
        outputs = max(outputs, along, turned, key=len)
    return inputs, outputs or ((FORCE,) if FORCE in rest else ())


def _called(channels: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """Return the channels with the first of several names that occurs: one, or numbered ones.

    Several are distinguished by numbers, of which the first may be missing, or by places.
    """
    for word in words:
        plain = [name for name in channels if re.fullmatch(word, name)]
        numbered = [name for name in channels if re.fullmatch(rf"{word}_?\d+", name)]
        placed = [name for name in channels if re.fullmatch(rf"{word}_({PLACES})", name)]
        if word == COORDINATES or (
            numbered and all(re.search(r"[a-z_][2-9]$", n) for n in numbered)
        ):
            numbered = [name for name in channels if name in (*plain, *numbered)]
        begun = [name for name in channels if len(word) > 1 and name.startswith(f"{word}_")]
        several = numbered or (placed if len(placed) > 1 and not plain else [])
        if begun and not (several or plain):  # command_pressure_1, command_pressure_2
            stem = re.escape(re.sub(r"_\d+$", "", begun[0]))
            several = [name for name in begun if re.fullmatch(rf"{stem}_\d+", name)]
        if found := several or (plain or begun)[:1]:
            return tuple(found)
    return ()


def _in_units(
    channels: Sequence[str], units: Mapping[str, str], wanted: Sequence[str]
) -> tuple[str, ...]:
    measured = [name for name in channels if not name.startswith((REFERENCE, COMMAND))]
    for unit in wanted:
        found = tuple(name for name in measured if units.get(name) == unit)
        if found:
            return found
    return ()


def _named(
    recordings: Sequence[Recording], given: Names, by_name: tuple[str, ...]
) -> tuple[str, ...]:
    if given is None:
        return by_name
    if isinstance(given, str):  # of several muscles, all that are called so
        if any(given in recording for recording in recordings):
            return (given,)
        return tuple(name for name in by_name if name.startswith(f"{given}_")) or (given,)
    return tuple(given)


def schedules(recordings: Sequence[Recording], others: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the default scheduling channels of any recording, with exceptions.

    Of forces and torques there may be several, with numbers.
    """
    found = dict.fromkeys(
        name
        for quantity in SCHEDULES
        for recording in recordings
        for name in (*one(recording, quantity), *numbered(recording, quantity))
    )
    return tuple(name for name in found if name not in others)


def loads_among(recordings: Sequence[Recording], inputs: Sequence[str]) -> tuple[str, ...]:
    """Return forces that are loads: given, and not commanded."""
    found = tuple(
        name
        for name in inputs
        if any(name in one and one.units[name] in LOADS for one in recordings)
    )
    return found if len(found) < len(inputs) else ()


def one(recording: Recording, *names: str) -> tuple[str, ...]:
    """Return the first of some channels that a recording has, if any."""
    return tuple(name for name in names if name in recording)[:1]


def numbered(recording: Recording, quantity: str) -> tuple[str, ...]:
    """Return the channels ``quantity_1``, ``quantity_2`` ... of a recording, in order."""
    found = {
        int(match.group(1)): name
        for name in recording.channels
        if (match := re.fullmatch(rf"{quantity}_(\d+)", name))
    }
    return tuple(found[number] for number in sorted(found))
