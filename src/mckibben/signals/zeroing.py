"""Zero offsets of sensors: the value of a channel at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.channels import quantity
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.signals.holds import STILL, holds, moves, shortest_hold

LOADS = ("pressure", "pressure_extensor", "force", "torque", "load")
"""Quantities that are constant at rest, in addition to the input."""


def rest(recording: Recording, channel: str, over: str) -> float | None:
    """Return the value of a channel at rest, or None where the recording does not rest.

    At rest, every input and every load is constant, and the input has its lowest value.

    Parameters
    ----------
    recording : Recording
    channel, over : str
        Such as ``"displacement"``, and the ``"pressure"`` that moves it.

    Raises
    ------
    DataError
        If there is no such channel.
    """
    for name in (channel, over):
        if name not in recording:
            raise DataError(
                f"there is no such channel among {', '.join(recording.channels)}",
                file=recording.source,
                channel=name,
                remedy="name one of them",
            )
    quantities = {*LOADS, quantity(over)}
    still = [
        name
        for name in recording.channels
        if quantity(name) in quantities and name not in (over, channel) and moves([recording[name]])
    ]
    columns = recording.matrix([over, *still])
    spans = np.ptp(columns, axis=0)
    within = 2 * STILL * spans
    candidates = holds(columns, spans.tolist(), shortest_hold(columns[:, 0], float(spans[0])))
    if not candidates:
        return None
    levels = [
        (columns[hold].mean(axis=0), np.median(recording[channel][hold])) for hold in candidates
    ]
    lowest = min((at for at, _ in levels), key=lambda at: float(at[0]))
    if lowest[0] > np.quantile(columns[:, 0], 0.01) + within[0]:
        return None  # the input is lower while it moves
    return float(np.median([y for at, y in levels if np.all(np.abs(at - lowest) <= within)]))


def zeroed(recording: Recording, channels: Sequence[str], over: str) -> Recording:
    """Return a recording whose channels are zero at rest at the lowest input; see `rest`.

    With a load that hangs on a muscle, its position at rest is removed, too.

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
    zeroed_channels = {}
    for name in channels:
        value_at_rest = rest(recording, name, over)
        if value_at_rest is None:
            raise DataError(
                f"it never rests at the lowest {over}, with all inputs and loads constant",
                file=recording.source,
                channel=name,
                remedy="begin or end with a hold there, or subtract a zero that is known",
            )
        zeroed_channels[name] = recording[name] - value_at_rest
    return replace(recording, channels={**recording.channels, **zeroed_channels})
