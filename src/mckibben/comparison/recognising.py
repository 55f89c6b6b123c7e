"""What drives and what is moved, by the names and units of recordings' channels."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from mckibben.recording import Recording

DRIVING = ("pressure", "voltage", "command", "input", "u", "p")
"""What inputs are called, those nearest to the muscle first."""

MOVED = ("displacement", "length", "contraction", "position", "angle", "output", "y", "x")
"""What outputs are called."""

UNITS_DRIVING, UNITS_MOVED = ("bar", "V"), ("mm", "rad")
"""Units of either, where names say nothing."""

FORCE = "force"

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
    outputs = _called(rest, MOVED) or _in_units(rest, units, UNITS_MOVED)
    if FORCE in rest and outputs and not any_moves(recordings, outputs):
        return outputs[:1], (FORCE,)
    return inputs, outputs or ((FORCE,) if FORCE in rest else tuple((rest or list(channels))[:1]))


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


def _called(channels: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """Return the channels that are called by the first of some words that any is, numbered or not."""
    for word in words:
        several = [name for name in channels if re.fullmatch(rf"{word}_?\d+", name)]
        alone = [name for name in channels if name == word or name.startswith(f"{word}_")]
        found = several or (alone if len(word) > 1 else [n for n in channels if n == word])[:1]
        if found:
            return tuple(found)
    return ()


def _in_units(
    channels: Sequence[str], units: Mapping[str, str], wanted: Sequence[str]
) -> tuple[str, ...]:
    for unit in wanted:
        found = tuple(name for name in channels if units.get(name) == unit)
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
