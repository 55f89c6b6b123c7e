"""What drives and what is moved, by the names and units of recordings' channels."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording

DRIVING = ("pressure", "voltage", "command", "input", "u", "p")
"""What inputs are called, those nearest to the muscle first."""

ALONG, TURNED = ("displacement", "length", "contraction", "position"), ("angle",)
"""What goes along a way, and what turns."""

COORDINATES = "[xyz]"
"""Of one place; each is an output of its own."""

MOVED = (*ALONG, *TURNED, "output", COORDINATES)
"""What outputs are called."""

UNITS_DRIVING, UNITS_MOVED = ("bar", "V"), ("mm", "rad")
"""Units of either, where names say nothing."""

PLACES = "[a-z]|left|right|top|bottom|upper|lower|front|back|rear|flexor|extensor"
"""What tells channels of one quantity apart, where numbers do not."""

ASKED = ("reference_", "command_")
"""Beginnings of the names of what a loop is told: these are no measurements."""

FORCE = "force"

OF_FORCE, PRESSURE = ("length", "displacement"), "pressure"
"""What force laws are of: the first that there is, beside the pressure."""

MOST = (1.0, 99.0)
"""Percentiles between which a length is, but for the way to where it is held."""

HELD = 0.01
"""Share of its largest value by which a length varies at least where a force can be learned of it."""

Sides = tuple[tuple[str, ...], tuple[str, ...]]


def recognised(recordings: Sequence[Recording], channels: Sequence[str]) -> Sides:
    """Return which of some channels are taken for inputs and for outputs; of several muscles, all.

    Where nothing moves while force does, the force is what is to be modelled, of the displacement held.

    Parameters
    ----------
    recordings : sequence of Recording
    channels : sequence of str
        Those that all recordings have.

    Returns
    -------
    tuple of (tuple of str, tuple of str)
        Inputs and outputs; empty where there is no channel.
    """
    if not channels:
        return (), ()
    units = {name: recordings[0].units.get(name, "") for name in channels} if recordings else {}
    inputs = _called(channels, DRIVING) or _in_units(channels, units, UNITS_DRIVING)
    inputs = inputs or tuple(channels[:1])
    rest = [name for name in channels if name not in inputs]
    outputs = _moved(rest, units, len(inputs))
    if FORCE in rest and outputs and not any_moves(recordings, outputs):
        return outputs[:1], (FORCE,)
    return inputs, outputs or ((FORCE,) if FORCE in rest else tuple((rest or list(channels))[:1]))


def force_over(
    recordings: Sequence[Recording], inputs: Sequence[str] | None, outputs: Sequence[str] | None
) -> str | None:
    """Return the length or displacement of which, beside pressure, force is to be modelled, or None.

    Parameters
    ----------
    recordings : sequence of Recording
    inputs, outputs : sequence of str or None
        Those asked for. Force is meant by its name, or where `lacks_displacement`.
    """
    meant = lacks_displacement(recordings) if outputs is None else tuple(outputs) == (FORCE,)
    for name in OF_FORCE if meant else ():
        asked = inputs is None or set(inputs) in ({name}, {name, PRESSURE})
        there = all({name, PRESSURE, FORCE} <= {*one.channels} for one in recordings)
        if asked and there and varies([one[name] for one in recordings]):
            return name
    return None


def varies(lengths: Sequence[Array]) -> bool:
    """Tell whether lengths, of all recordings, are held at more than one; how it is come to aside."""
    samples = np.concatenate([*lengths, np.zeros(0)])
    if not samples.size:
        return False
    return bool(np.ptp(np.percentile(samples, MOST)) > HELD * np.abs(samples).max())


def lacks_displacement(recordings: Sequence[Recording]) -> bool:
    """Tell whether force by length and pressure is all there is to model: nothing else is moved."""
    others = (*ALONG, *TURNED)
    return all(
        {OF_FORCE[0], PRESSURE, FORCE} <= {*one.channels}
        and not any(name.startswith(others) for name in one.channels if name != OF_FORCE[0])
        for one in recordings
    ) and any_moves(recordings, (FORCE,))


def moved_by(recordings: Sequence[Recording], given: str, channels: Sequence[str]) -> str:
    """Return the channel over which an output loops: its input, or what moves where that is held.

    Parameters
    ----------
    recordings : sequence of Recording
    given : str
        The input.
    channels : sequence of str
        Those that may stand in for it.
    """
    if any_moves(recordings, (given,)):
        return given
    driving = _called(channels, DRIVING)
    return driving[0] if driving and any_moves(recordings, driving[:1]) else given


def _moved(channels: Sequence[str], units: Mapping[str, str], n_inputs: int) -> tuple[str, ...]:
    """Return what is moved: the first kind of it, or where that is less than inputs, the most of a kind.

    Kinds are not mixed: errors in mm and in rad have no mean.
    """
    first = _called(channels, MOVED) or _in_units(channels, units, UNITS_MOVED)
    if len(first) >= n_inputs:
        return first
    along = _called(channels, (*ALONG, COORDINATES)) or _in_units(channels, units, ("mm",))
    turned = _called(channels, TURNED) or _in_units(channels, units, ("rad",))
    return max(first, along, turned, key=len)


def _called(channels: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """Return the channels that are called by the first of some words that any is: one, or several.

    Several are told apart by numbers, of which the first may be missing, or by places.
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
        if found := several or (plain or begun)[:1]:
            return tuple(found)
    return ()


def _in_units(
    channels: Sequence[str], units: Mapping[str, str], wanted: Sequence[str]
) -> tuple[str, ...]:
    measured = [name for name in channels if not name.startswith(ASKED)]
    for unit in wanted:
        found = tuple(name for name in measured if units.get(name) == unit)
        if found:
            return found
    return ()


def any_moves(recordings: Sequence[Recording], channels: Sequence[str]) -> bool:
    """Tell whether any channel moves within any recording, by more than its offset would round to."""
    return any(
        float(np.ptp(run[name])) > 1e-6 * (1.0 + float(np.abs(run[name]).max()))
        for run in recordings
        for name in channels
        if name in run and len(run)
    )
