"""The channels of models: what drives, what is modelled, what schedules, and what is not used.

`channels_of` resolves them once, for a study, a fit or a figure, as a `Channels`, which everything that
fits, compares, characterizes or draws is then given. Files call `by_unit` to name unnamed columns.
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

INPUTS = ("pressure", "voltage", "command", "input", "u", "p")
"""Names of inputs, those nearest to the muscle first."""

TRANSLATIONS, ROTATIONS = ("displacement", "length", "contraction", "position"), ("angle",)
"""Names of translations and of rotations."""

COORDINATES = "[xyz]"
"""Coordinates of a position; each is a separate output."""

OUTPUTS = (*TRANSLATIONS, *ROTATIONS, "output", COORDINATES)
"""Names of outputs."""

QUANTITIES = {"mm": "displacement", "N": "force", "bar": "pressure", "V": "voltage", "rad": "angle"}
"""Unit -> the channel of what has no name of a channel."""

INPUT_UNITS, OUTPUT_UNITS = ("bar", "V"), ("mm", "rad")
"""Units of inputs and of outputs, for names that are not recognised."""

POSITIONS = "[a-z]|left|right|top|bottom|upper|lower|front|back|rear|flexor|extensor"
"""Suffixes other than numbers that distinguish channels of one quantity."""

SCHEDULING = ("pressure_extensor", "force", "torque")
"""Channels, also numbered, that schedule models unless others are named."""

LOAD_QUANTITIES = ("force", "torque")
"""Outputs of muscles that are held."""

LOAD_UNITS = ("N", "N*m")
"""Units of loads on muscles or a joint, which are not scheduling inputs."""

FORCE, PRESSURE, LENGTHS = "force", "pressure", ("length", "displacement")
"""Channels of force laws: the first of these that is present, with the pressure."""

LEAST_VARIATION = 0.01
"""Smallest variation of a channel, relative to its largest value, that is more than holding it."""

LARGEST_DRIFT = 0.05
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

    def inputs_in(self, recordings: Sequence[Recording]) -> tuple[str, ...]:
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

        def input_of(i: int, output: str) -> str:
            number = _number(output)
            same_number = [name for name in self.inputs if number and _number(name) == number]
            return (
                same_number[0]
                if len(same_number) == 1
                else self.inputs[min(i, len(self.inputs) - 1)]
            )

        return tuple((input_of(i, output), output) for i, output in enumerate(self.outputs))


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
    named = _listed(scheduling)
    is_default = scheduling is None
    driving = _named(recordings, inputs, by_name(recordings, named)[0] or (PRESSURE,))
    loads = _loads_among(recordings, driving)
    driving = tuple(name for name in driving if name not in loads)
    motion = by_name(recordings, (*driving, *loads, *named))[1] or (LENGTHS[-1],)
    pulling = _pull(recordings, driving, motion) if is_default and not loads else ()
    modelled = _named(recordings, outputs, pulling or motion)
    held = by_length = tuple[str, ...]()
    if is_default and len(modelled) == 1 and modelled[0] in LOAD_QUANTITIES:
        held = _held_lengths(recordings, driving, modelled[0])
        driving = tuple(name for name in driving if name not in held)
        by_length = () if held else _driving_force(recordings, modelled[0])
        if by_length and (inputs is None or {*by_length} <= {*driving} <= {*by_length, PRESSURE}):
            driving = by_length
    scheduled = (*named, *loads, *held)
    offered = (
        *((PRESSURE,) if by_length and driving == by_length else ()),
        *_default_scheduling(recordings),
    )
    offered = tuple(
        name for name in offered if is_default and name not in (*driving, *modelled, *scheduled)
    )
    if len(driving) > 1 or len(modelled) > 1:
        scheduled, offered = (*scheduled, *offered), ()
    _check(recordings, (*driving, *modelled, *scheduled), named)
    roles = {*driving, *modelled, *scheduled, *offered}
    unused = [name for name in _names(recordings) if name not in roles]
    return Channels(
        driving,
        modelled,
        scheduled,
        offered,
        tuple(name for name in unused if _differs(recordings, name)),
        tuple(n for n in (*driving, *scheduled, *offered) if held_at_levels(recordings, n)),
    )


def by_name(recordings: Sequence[Recording], excepted: Sequence[str] = ()) -> Sides:
    """Return inputs and outputs by name, else by unit; empty if neither is recognised.

    Outputs are the first quantity, or where those are fewer than inputs, the most of a kind. Kinds are
    not mixed: errors in mm and in rad have no mean.
    """
    names = [name for name in _names(recordings) if name not in excepted]
    units = {name: next(run.units[name] for run in recordings if name in run) for name in names}
    inputs = _called(names, INPUTS) or _in_units(names, units, INPUT_UNITS)
    remaining = [name for name in names if name not in inputs]
    outputs = _called(remaining, OUTPUTS) or _in_units(remaining, units, OUTPUT_UNITS)
    if len(outputs) < len(inputs):
        translations = _called(remaining, (*TRANSLATIONS, COORDINATES)) or _in_units(
            remaining, units, ("mm",)
        )
        rotations = _called(remaining, ROTATIONS) or _in_units(remaining, units, ("rad",))
        outputs = max(outputs, translations, rotations, key=len)
    return inputs, outputs or tuple(name for name in LOAD_QUANTITIES if name in remaining)[:1]


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
    span = float(np.ptp(np.concatenate([run[name] for run in recordings])))
    return span > 0 and all(float(np.ptp(run[name])) <= LARGEST_DRIFT * span for run in recordings)


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
    x = np.concatenate([*samples, np.zeros(0)])
    if not x.size:
        return False
    return bool(np.ptp(np.percentile(x, (1.0, 99.0))) > LEAST_VARIATION * np.abs(x).max())


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
    driving, modelled = channels_of(recordings, input, output).pair
    return moved_by(recordings, driving) if input is None else driving, modelled


def moved_by(recordings: Sequence[Recording], channel: str) -> str:
    """Return the abscissa of an output's loop: its input, or what drives if that is constant."""
    if any_moves(recordings, (channel,)):
        return channel
    driving = by_name(recordings)[0]
    return driving[0] if driving and any_moves(recordings, driving[:1]) else channel


def _varies_freely(recordings: Sequence[Recording], name: str) -> bool:
    """Return whether a channel varies within recordings, instead of being held at levels."""
    return (
        _shared(recordings, name)
        and not held_at_levels(recordings, name)
        and varies([run[name] for run in recordings])
        and any_moves(recordings, (name,))
    )


def _pull(
    recordings: Sequence[Recording], inputs: Sequence[str], motion: Sequence[str]
) -> tuple[str, ...]:
    """Return the force or torque that is the output instead of what is moved; or none."""
    pulling = [
        name for name in LOAD_QUANTITIES if name not in inputs and _varies_freely(recordings, name)
    ][:1]
    complete = all(_shared(recordings, name) for name in (*inputs, *motion))
    is_held = not any(_varies_freely(recordings, name) for name in motion)
    driven = any(_differs(recordings, name) for name in inputs)
    otherwise = complete and (driven if is_held else not driven)
    return tuple(pulling) if otherwise or _lacks_displacement(recordings) else ()


def _lacks_displacement(recordings: Sequence[Recording]) -> bool:
    """Return whether the only model possible is force by length and pressure."""
    positions = (*TRANSLATIONS, *ROTATIONS)
    return all(
        {LENGTHS[0], PRESSURE, FORCE} <= {*run.channels}
        and not any(name.startswith(positions) for name in run.channels if name != LENGTHS[0])
        for run in recordings
    ) and any_moves(recordings, (FORCE,))


def _held_lengths(
    recordings: Sequence[Recording], inputs: Sequence[str], pull: str
) -> tuple[str, ...]:
    """Return what is held at levels while inputs drive a force or torque."""
    lengths = [name for name in LENGTHS if pull == FORCE and _shared(recordings, name)][:1]
    names = tuple(lengths) or by_name(recordings, (*inputs, pull))[1]
    is_driven = any(_varies_freely(recordings, name) for name in inputs if name not in names)
    return names if is_driven and all(held_at_levels(recordings, n) for n in names) else ()


def _driving_force(recordings: Sequence[Recording], pull: str) -> tuple[str, ...]:
    """Return the length or displacement of a law of force with pressure, if it varies."""
    is_law = pull == FORCE and _shared(recordings, PRESSURE) and _shared(recordings, FORCE)
    return tuple(
        name
        for name in LENGTHS
        if is_law and _shared(recordings, name) and varies([run[name] for run in recordings])
    )[:1]


def _check(
    recordings: Sequence[Recording], names: Sequence[str], scheduling: Sequence[str]
) -> None:
    """Raise an error for a channel that is named twice, or named to schedule that is nowhere."""
    if repeated := [name for name in names if names.count(name) > 1]:
        raise DataError(
            "the channel is named twice among inputs, outputs and load",
            channel=repeated[0],
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
    return list(dict.fromkeys(name for run in recordings for name in run.channels))


def _shared(recordings: Sequence[Recording], name: str) -> bool:
    return bool(recordings) and all(name in run for run in recordings)


def _differs(recordings: Sequence[Recording], name: str) -> bool:
    """Return whether a channel varies within or between recordings by more than rounding."""
    samples = np.concatenate([*(run[name] for run in recordings if name in run), np.zeros(0)])
    return bool(samples.size and np.ptp(samples) > 1e-6 * (1.0 + np.abs(samples).max()))


def _called(channels: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """Return the channels with the first of several names that occurs: one, or numbered ones.

    Several are distinguished by numbers, of which the first may be missing, in their order; or by
    places.
    """
    for word in words:
        plain = [name for name in channels if re.fullmatch(word, name)]
        numbered = [name for name in channels if re.fullmatch(rf"{word}_?\d+", name)]
        positioned = [name for name in channels if re.fullmatch(rf"{word}_({POSITIONS})", name)]
        if word == COORDINATES or (
            numbered and all(re.search(r"[a-z_][2-9]$", n) for n in numbered)
        ):
            numbered = [name for name in channels if name in (*plain, *numbered)]
        prefixed = [name for name in channels if len(word) > 1 and name.startswith(f"{word}_")]
        several = numbered or (positioned if len(positioned) > 1 and not plain else [])
        if prefixed and not (several or plain):  # command_pressure_1, command_pressure_2
            stem = re.escape(re.sub(r"_\d+$", "", prefixed[0]))
            several = [name for name in prefixed if re.fullmatch(rf"{stem}_\d+", name)]
        if result := sorted(several, key=_number) or (plain or prefixed)[:1]:
            return tuple(result)
    return ()


def _number(name: str) -> int:
    """Return the number at the end of a name, 0 without one."""
    match = re.search(r"\d+$", name)
    return int(match[0]) if match else 0


def _in_units(
    channels: Sequence[str], units: Mapping[str, str], preferred: Sequence[str]
) -> tuple[str, ...]:
    signals = [name for name in channels if not name.startswith((REFERENCE, COMMAND))]
    for unit in preferred:
        result = tuple(name for name in signals if units[name] == unit)
        if result:
            return result
    return ()


def _named(
    recordings: Sequence[Recording], wanted_names: Names, by_default: tuple[str, ...]
) -> tuple[str, ...]:
    if wanted_names is None:
        return by_default
    names = _listed(wanted_names)
    if len(names) == 1 and not any(names[0] in run for run in recordings):
        # of several muscles, all that are called so
        return tuple(name for name in by_default if name.startswith(f"{names[0]}_")) or names
    return names


def _listed(names: Names) -> tuple[str, ...]:
    """Return names as a tuple; what is no list is one name, if a wrong one."""
    if names is None:
        return ()
    single = isinstance(names, str) or not isinstance(names, Iterable)
    return (cast(str, names),) if single else tuple(names)


def _default_scheduling(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the default scheduling channels of any recording."""
    names = _names(recordings)
    result = (
        name
        for word in SCHEDULING
        for name in sorted(names, key=_number)
        if re.fullmatch(rf"{word}(_\d+)?", name)
    )
    return tuple(result)


def _loads_among(recordings: Sequence[Recording], inputs: Sequence[str]) -> tuple[str, ...]:
    """Return forces that are loads: given, and not commanded."""
    result = tuple(
        name
        for name in inputs
        if any(name in run and run.units[name] in LOAD_UNITS for run in recordings)
    )
    return result if len(result) < len(inputs) else ()


def by_unit(channels: Mapping[str, Array], units: Mapping[str, str]) -> dict[str, str]:
    """Return what channels of other names measure: by their units, and the number or place in the name.

    So ``p1`` in bar is ``pressure_1``. Where two would be the same channel, neither is. What stays above
    half of its highest value in mm is a length, as no muscle shortens by more. Commands and references
    measure nothing.
    """
    result: dict[str, str] = {}
    for name, samples in channels.items():
        unit, suffix = units[name], re.search(r"(\d+|extensor)$", name)
        is_set = name.startswith((COMMAND, REFERENCE))
        if unit in QUANTITIES and standard_unit(name) is None and not is_set:
            is_length = unit == "mm" and samples.min() > 0.5 * samples.max()
            kind = "length" if is_length else QUANTITIES[unit]
            result[name] = f"{kind}_{suffix[1]}" if suffix else kind
    counts = Counter([*result.values(), *channels])
    return {name: channel for name, channel in result.items() if counts[channel] == 1}


def renamed(one: Recording, names: Mapping[str, str]) -> Recording:
    """Return a recording with other names of channels."""
    channels = {names.get(name, name): samples for name, samples in one.channels.items()}
    return replace(one, channels=channels, units={names.get(n, n): u for n, u in one.units.items()})
