"""Zero offsets of sensors: rest values of channels, and their differences between recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.signals.holds import STILL, holds, moves, shortest_hold

LOADS = ("pressure", "pressure_extensor", "force", "torque", "load")
"""Quantities that are constant at rest, in addition to the input."""

LARGEST_DIFFERENCE = 0.25
"""Largest difference of rest values, as a share of the travel, of recordings with one zero."""


def rests(recordings: Sequence[Recording], channel: str, over: str) -> list[float] | None:
    """Return the rest value of a channel in each recording.

    At rest, every input and every load stands still, loads as in all other recordings, and the input is
    at the lowest value that all recordings have. None where some recording has no such rest.

    Parameters
    ----------
    recordings : sequence of Recording
    channel, over : str
        Such as ``"displacement"``, and the ``"pressure"`` that moves it.

    Raises
    ------
    DataError
        If there is no such channel.
    """
    for one in recordings:
        for name in (channel, over):
            if name not in one:
                raise DataError(
                    f"there is no such channel among {', '.join(one.channels)}",
                    file=one.source,
                    channel=name,
                    remedy="name one of them",
                )
    quantities = {*LOADS, _quantity(over)}
    common = [n for n in recordings[0].channels if all(n in one for one in recordings)]
    standing = [n for n in common if _quantity(n) in quantities and n not in (over, channel)]
    names = [over, *(n for n in standing if moves([one[n] for one in recordings]))]
    columns = [one.matrix(names) for one in recordings]
    spans = np.ptp(np.concatenate(columns), axis=0)
    within = 2 * STILL * spans
    levels = [
        [(part[hold].mean(axis=0), float(np.median(one[channel][hold]))) for hold in found]
        for one, part in zip(recordings, columns, strict=True)
        if (found := holds(part, spans.tolist(), shortest_hold(part[:, 0], float(spans[0]))))
    ]
    if len(levels) < len(recordings):
        return None
    lowest = min((at for run in levels for at, _ in run), key=lambda at: float(at[0]))
    if lowest[0] > np.quantile(np.concatenate(columns)[:, 0], 0.01) + within[0]:
        return None  # it stands still, and goes lower while it moves
    there = [[y for at, y in run if np.all(np.abs(at - lowest) <= within)] for run in levels]
    return [float(np.median(run)) for run in there] if all(there) else None


def zeroed(recording: Recording, channels: Sequence[str], over: str) -> Recording:
    """Return a recording whose channels are zero at rest at the lowest input; see `rests`.

    Of a load that hangs on a muscle, this takes away where it hangs, too.

    Parameters
    ----------
    recording : Recording
    channels : sequence of str
    over : str
        The input.

    Raises
    ------
    DataError
        If there is no such channel, or the recording does not rest.
    """
    level = {}
    for name in channels:
        at = rests([recording], name, over)
        if at is None:
            raise DataError(
                f"it never rests at the lowest {over}, with all inputs and loads standing still",
                file=recording.source,
                channel=name,
                remedy="begin or end with a hold there, or subtract a zero that is known",
            )
        level[name] = recording[name] - at[0]
    return replace(recording, channels={**recording.channels, **level})


def apart(recordings: Sequence[Recording], channel: str, over: str) -> tuple[float, float] | None:
    """Return the lowest and the highest rest value if recordings have different zeros, or None.

    They are not where all of them rest, by more than a quarter of what the one that moves most travels
    apart.

    Parameters
    ----------
    recordings : sequence of Recording
    channel, over : str
        As for `rests`.

    Raises
    ------
    DataError
        If there is no such channel.
    """
    found = rests(recordings, channel, over) if len(recordings) > 1 else None
    travel = max((float(np.ptp(one[channel])) for one in recordings), default=0.0)
    if found is None or travel == 0 or max(found) - min(found) <= LARGEST_DIFFERENCE * travel:
        return None
    return min(found), max(found)


def _quantity(name: str) -> str:
    return name.rstrip("0123456789").rstrip("_")
