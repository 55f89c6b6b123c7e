"""The channels of models: what drives, what is modelled, what schedules, and what is not used.

They are resolved once, by `channels_of`, and handed down to what fits, compares, characterizes, draws.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import COMMAND, REFERENCE, Recording, standard_unit

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

QUANTITIES = {"mm": "displacement", "N": "force", "bar": "pressure", "V": "voltage", "rad": "angle"}
"""Unit -> the channel of what has no name of a channel."""

UNITS_DRIVING, UNITS_MOVED = ("bar", "V"), ("mm", "rad")
"""Units of inputs and of outputs, for names that are not recognised."""

PLACES = "[a-z]|left|right|top|bottom|upper|lower|front|back|rear|flexor|extensor"
"""Suffixes other than numbers that distinguish channels of one quantity."""

SCHEDULES = ("pressure_extensor", "force", "torque")
"""Channels, also numbered, that schedule models unless others are named."""

PULLS = ("force", "torque")
"""Outputs of muscles that are held."""

LOADS = ("N", "N*m")
"""Units of loads on muscles or a joint, which are not scheduling inputs."""

FORCE, PRESSURE, OF_FORCE = "force", "pressure", ("length", "displacement")
"""Channels of force laws: the first of these that is present, with the pressure."""

HELD = 0.01
"""Smallest variation of a channel, relative to its largest value, that is more than holding it."""

STEADY = 0.05
"""Largest variation of a channel within a run, relative to that over all runs, for which it counts as
constant in the run.
"""

SYMBOLS = {
    "pressure": "p",
    "voltage": "u",
    "displacement": "y",
    "length": "l",
    "contraction": r"\epsilon",
    "angle": r"\varphi",
    "velocity": "v",
    "force": "F",
    "torque": "M",
}
"""Symbols of quantities where no model's equations name them."""

Sides = tuple[tuple[str, ...], tuple[str, ...]]
"""Inputs and outputs."""


@dataclass(frozen=True)
class Channels:
    """Channels of models, resolved; see `channels_of`.

    Parameters
    ----------
    inputs : tuple of str
        What drives every model.
    outputs : tuple of str
        What every model gives.
    scheduling : tuple of str
        Further inputs, which every model has to take.
    offered : tuple of str
        Further inputs for the models that can take them: loads, and the pressure of force laws.
    unused : tuple of str
        Channels that vary, and that no model is given.
    held : tuple of str
        Inputs of any kind that differ between recordings, but are nearly constant in each.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    scheduling: tuple[str, ...] = ()
    offered: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    held: tuple[str, ...] = ()

    @property
    def single(self) -> bool:
        """Whether these are one input and one output, which nothing has to schedule."""
        return len(self.inputs) == len(self.outputs) == 1 and not self.scheduling

    @property
    def further(self) -> tuple[str, ...]:
        """All inputs that do not drive."""
        return (*self.scheduling, *self.offered)

    @property
    def sides(self) -> tuple[str, ...]:
        """Inputs, and outputs."""
        return (*self.inputs, *self.outputs)

    def given(self, recordings: Sequence[Recording]) -> tuple[str, ...]:
        """Return the inputs of any model that all recordings have."""
        return tuple(n for n in (*self.inputs, *self.further) if _shared(recordings, n))

    @property
    def pair(self) -> tuple[str, str]:
        """The one input and the one output.

        Raises
        ------
        DataError
            If there are several.
        """
        if len(self.inputs) > 1 or len(self.outputs) > 1:
            raise DataError(
                f"there are several: {', '.join((*self.inputs, *self.outputs))}",
                remedy="name one with `input=NAME` and one with `output=NAME`; balance models all",
            )
        return self.inputs[0], self.outputs[0]

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Every output with the input of the same number, or of the same position."""

        def own(place: int, output: str) -> str:
            number = _number(output)
            alike = [name for name in self.inputs if number and _number(name) == number]
            return alike[0] if len(alike) == 1 else self.inputs[min(place, len(self.inputs) - 1)]

        return tuple((own(place, output), output) for place, output in enumerate(self.outputs))


def channels_of(
    recordings: Sequence[Recording],
    inputs: Names = None,
    outputs: Names = None,
    scheduling: Names = None,
) -> Channels:
    """Return the channels of models of recordings: as named, otherwise by names, units and motion.

    1. The pressures drive; without any, the voltages, commands, ``input``, ``u`` or ``p``; else what is
       in bar or V. Several are told apart by numbers (``pressure``, ``pressure_2``) or places
       (``pressure_left``).
    2. The output is what moves: displacement, length, contraction, position, angle, ``output``,
       coordinates ``x``, ``y``, ``z``; else what is in mm or rad; else the force.
    3. What every recording holds, at one value or at a level of its own, is no output where a force or
       torque varies freely and the inputs do: that is the output. So it is beside pressure and length
       alone, where both vary.
    4. A force is driven by the length, or displacement, if that varies within recordings; models of it
       take the pressure too. One that is held schedules, if recordings differ in it, and the pressure
       drives.
    5. Forces among several inputs are loads, and schedule.
    6. An extensor's pressure, forces and torques schedule models of several muscles. Of one muscle,
       the models that can take them do.

    Parameters
    ----------
    recordings : sequence of Recording
    inputs, outputs, scheduling : str, sequence of str, optional
        Channels; a name that none has, such as ``pressure``, is all that are called so, such as
        ``pressure_1``. With ``scheduling``, which may be empty, no others schedule or are offered.

    Raises
    ------
    DataError
        If a channel is named twice, or no recording has one that is named to schedule.
    """
    asked = _listed(scheduling)
    finds = scheduling is None
    given = _named(recordings, inputs, by_name(recordings, asked)[0] or (PRESSURE,))
    loads = _loads_among(recordings, given)
    given = tuple(name for name in given if name not in loads)
    moved = by_name(recordings, (*given, *loads, *asked))[1] or (OF_FORCE[-1],)
    pull = _pulled(recordings, given, moved) if finds and not loads else ()
    wanted = _named(recordings, outputs, pull or moved)
    held = over = tuple[str, ...]()
    if finds and len(wanted) == 1 and wanted[0] in PULLS:
        held = _held_beside(recordings, given, wanted[0])
        given = tuple(name for name in given if name not in held)
        over = () if held else _driving_force(recordings, wanted[0])
        if over and (inputs is None or {*over} <= {*given} <= {*over, PRESSURE}):
            given = over
    scheduled = (*asked, *loads, *held)
    found = (*((PRESSURE,) if over and given == over else ()), *_schedules(recordings))
    found = tuple(name for name in found if finds and name not in (*given, *wanted, *scheduled))
    if len(given) > 1 or len(wanted) > 1:
        scheduled, found = (*scheduled, *found), ()
    _check(recordings, (*given, *wanted, *scheduled), asked)
    used = {*given, *wanted, *scheduled, *found}
    unused = [name for name in _names(recordings) if name not in used]
    return Channels(
        given,
        wanted,
        scheduled,
        found,
        tuple(name for name in unused if _differs(recordings, name)),
        tuple(n for n in (*given, *scheduled, *found) if held_at_levels(recordings, n)),
    )


def by_name(recordings: Sequence[Recording], excepted: Sequence[str] = ()) -> Sides:
    """Return inputs and outputs by name, else by unit; empty if neither is recognised.

    Outputs are the first quantity, or where those are fewer than inputs, the most of a kind. Kinds are
    not mixed: errors in mm and in rad have no mean.
    """
    names = [name for name in _names(recordings) if name not in excepted]
    units = {name: next(one.units[name] for one in recordings if name in one) for name in names}
    inputs = _called(names, DRIVING) or _in_units(names, units, UNITS_DRIVING)
    rest = [name for name in names if name not in inputs]
    outputs = _called(rest, MOVED) or _in_units(rest, units, UNITS_MOVED)
    if len(outputs) < len(inputs):
        along = _called(rest, (*ALONG, COORDINATES)) or _in_units(rest, units, ("mm",))
        turned = _called(rest, TURNED) or _in_units(rest, units, ("rad",))
        outputs = max(outputs, along, turned, key=len)
    return inputs, outputs or tuple(name for name in PULLS if name in rest)[:1]


def quantity(name: str) -> str:
    """Return the name of a channel without its number.

    >>> quantity("pressure_2"), quantity("pressure_extensor")
    ('pressure', 'pressure_extensor')
    """
    return re.sub(r"_?\d+$", "", name)


def channel_symbol(name: str) -> str:
    r"""Return the usual symbol of a channel in LaTeX; empty for channels that have none.

    >>> channel_symbol("pressure"), channel_symbol("displacement_2"), channel_symbol("valve")
    ('p', 'y_{2}', '')
    """
    letter, number = SYMBOLS.get(quantity(name), ""), name.removeprefix(quantity(name)).strip("_")
    return f"{letter}_{{{number}}}" if letter and number else letter


def held_at_levels(recordings: Sequence[Recording], name: str) -> bool:
    """Return whether a channel differs between recordings but is nearly constant in each."""
    if not _shared(recordings, name):
        return False
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


def varies(samples: Sequence[Array]) -> bool:
    """Return whether a channel takes several values over all recordings, ignoring approaches."""
    every = np.concatenate([*samples, np.zeros(0)])
    if not every.size:
        return False
    return bool(np.ptp(np.percentile(every, (1.0, 99.0))) > HELD * np.abs(every).max())


def loop_of(
    recordings: Sequence[Recording],
    input: Names = None,  # noqa: A002
    output: Names = None,
) -> tuple[str, str]:
    """Return the channels of a loop: those of a model of one input, and the input that moves.

    Raises
    ------
    DataError
        If there are several inputs or outputs.
    """
    given, wanted = channels_of(recordings, input, output).pair
    return moved_by(recordings, given) if input is None else given, wanted


def moved_by(recordings: Sequence[Recording], given: str) -> str:
    """Return the abscissa of an output's loop: its input, or what drives if that is constant."""
    if any_moves(recordings, (given,)):
        return given
    driving = by_name(recordings)[0]
    return driving[0] if driving and any_moves(recordings, driving[:1]) else given


def _free(recordings: Sequence[Recording], name: str) -> bool:
    """Return whether a channel varies within recordings, instead of being held at levels."""
    return (
        _shared(recordings, name)
        and not held_at_levels(recordings, name)
        and varies([one[name] for one in recordings])
        and any_moves(recordings, (name,))
    )


def _pulled(
    recordings: Sequence[Recording], given: Sequence[str], moved: Sequence[str]
) -> tuple[str, ...]:
    """Return the force or torque that is the output instead of what is moved; or none."""
    pull = [name for name in PULLS if name not in given and _free(recordings, name)][:1]
    there = all(_shared(recordings, name) for name in (*given, *moved))
    held = not any(_free(recordings, name) for name in moved)
    driven = any(_differs(recordings, name) for name in given)
    otherwise = there and (driven if held else not driven)
    return tuple(pull) if otherwise or _lacks_displacement(recordings) else ()


def _lacks_displacement(recordings: Sequence[Recording]) -> bool:
    """Return whether the only model possible is force by length and pressure."""
    others = (*ALONG, *TURNED)
    return all(
        {OF_FORCE[0], PRESSURE, FORCE} <= {*one.channels}
        and not any(name.startswith(others) for name in one.channels if name != OF_FORCE[0])
        for one in recordings
    ) and any_moves(recordings, (FORCE,))


def _held_beside(
    recordings: Sequence[Recording], given: Sequence[str], pull: str
) -> tuple[str, ...]:
    """Return what is held at levels while inputs drive a force or torque."""
    along = [name for name in OF_FORCE if pull == FORCE and _shared(recordings, name)][:1]
    names = tuple(along) or by_name(recordings, (*given, pull))[1]
    driven = any(_free(recordings, name) for name in given if name not in names)
    return names if driven and all(held_at_levels(recordings, n) for n in names) else ()


def _driving_force(recordings: Sequence[Recording], pull: str) -> tuple[str, ...]:
    """Return the length or displacement of a law of force with pressure, if it varies."""
    there = pull == FORCE and _shared(recordings, PRESSURE) and _shared(recordings, FORCE)
    return tuple(
        name
        for name in OF_FORCE
        if there and _shared(recordings, name) and varies([one[name] for one in recordings])
    )[:1]


def _check(
    recordings: Sequence[Recording], names: Sequence[str], scheduling: Sequence[str]
) -> None:
    """Raise an error for a channel that is named twice, or named to schedule that is nowhere."""
    if twice := [name for name in names if names.count(name) > 1]:
        raise DataError(
            "the channel is named twice among inputs, outputs and load",
            channel=twice[0],
            remedy="an output cannot also be an input: name each channel once",
        )
    if absent := [name for name in scheduling if name not in _names(recordings)]:
        raise DataError(
            "there is no such channel to give the load",
            file=recordings[0].source if recordings else None,
            channel=absent[0],
            remedy="name it with `columns[CHANNEL]=COLUMN`, or leave `load` out",
        )


def _names(recordings: Sequence[Recording]) -> list[str]:
    """Return the channels that any recording has, in order."""
    return list(dict.fromkeys(name for one in recordings for name in one.channels))


def _shared(recordings: Sequence[Recording], name: str) -> bool:
    return bool(recordings) and all(name in one for one in recordings)


def _differs(recordings: Sequence[Recording], name: str) -> bool:
    """Return whether a channel varies within or between recordings by more than rounding."""
    samples = np.concatenate([*(one[name] for one in recordings if name in one), np.zeros(0)])
    return bool(samples.size and np.ptp(samples) > 1e-6 * (1.0 + np.abs(samples).max()))


def _called(channels: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """Return the channels with the first of several names that occurs: one, or numbered ones.

    Several are distinguished by numbers, of which the first may be missing, in their order; or by
    places.
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
        if found := sorted(several, key=_number) or (plain or begun)[:1]:
            return tuple(found)
    return ()


def _number(name: str) -> int:
    """Return the number at the end of a name, 0 without one."""
    match = re.search(r"\d+$", name)
    return int(match[0]) if match else 0


def _in_units(
    channels: Sequence[str], units: Mapping[str, str], wanted: Sequence[str]
) -> tuple[str, ...]:
    measured = [name for name in channels if not name.startswith((REFERENCE, COMMAND))]
    for unit in wanted:
        found = tuple(name for name in measured if units[name] == unit)
        if found:
            return found
    return ()


def _named(
    recordings: Sequence[Recording], given: Names, by_default: tuple[str, ...]
) -> tuple[str, ...]:
    if given is None:
        return by_default
    names = _listed(given)
    if len(names) == 1 and not any(names[0] in one for one in recordings):
        # of several muscles, all that are called so
        return tuple(name for name in by_default if name.startswith(f"{names[0]}_")) or names
    return names


def _listed(names: Names) -> tuple[str, ...]:
    """Return names as a tuple; what is no list is one name, if a wrong one."""
    if names is None:
        return ()
    single = isinstance(names, str) or not isinstance(names, Iterable)
    return (cast(str, names),) if single else tuple(names)


def _schedules(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the default scheduling channels of any recording."""
    names = _names(recordings)
    found = (
        name
        for word in SCHEDULES
        for name in sorted(names, key=_number)
        if re.fullmatch(rf"{word}(_\d+)?", name)
    )
    return tuple(found)


def _loads_among(recordings: Sequence[Recording], inputs: Sequence[str]) -> tuple[str, ...]:
    """Return forces that are loads: given, and not commanded."""
    found = tuple(
        name
        for name in inputs
        if any(name in one and one.units[name] in LOADS for one in recordings)
    )
    return found if len(found) < len(inputs) else ()


def by_unit(channels: Mapping[str, Array], units: Mapping[str, str]) -> dict[str, str]:
    """Return what channels of other names measure: by their units, and the number or place in the name.

    So ``p1`` in bar is ``pressure_1``. Where two would be the same channel, neither is. What stays above
    half of its highest value in mm is a length, as no muscle shortens by more. Commands and references
    measure nothing.
    """
    found: dict[str, str] = {}
    for name, samples in channels.items():
        unit, place = units[name], re.search(r"(\d+|extensor)$", name)
        is_set = name.startswith((COMMAND, REFERENCE))
        if unit in QUANTITIES and standard_unit(name) is None and not is_set:
            is_length = unit == "mm" and samples.min() > 0.5 * samples.max()
            kind = "length" if is_length else QUANTITIES[unit]
            found[name] = f"{kind}_{place[1]}" if place else kind
    counts = Counter([*found.values(), *channels])
    return {name: channel for name, channel in found.items() if counts[channel] == 1}


def renamed(one: Recording, names: Mapping[str, str]) -> Recording:
    """Return a recording with other names of channels."""
    channels = {names.get(name, name): samples for name, samples in one.channels.items()}
    return replace(one, channels=channels, units={names.get(n, n): u for n, u in one.units.items()})
