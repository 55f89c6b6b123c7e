"""Zeros of sensors: where a channel rests, and recordings that do not rest at the same place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import Recording

LOWEST = 0.05
"""Share of an input's range up to which it counts as lowest."""

APART = 0.25
"""Share of the travel by which recordings rest apart that are not of one zero."""


def rest(recording: Recording, channel: str, over: str) -> float:
    """Return the median of a channel where another is within 5 % of its range of its lowest.

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
    return _rest(recording, channel, over, LOWEST * float(np.ptp(_known(recording, over))))


def _rest(recording: Recording, channel: str, over: str, within: float) -> float:
    driven = _known(recording, over)
    return float(np.median(_known(recording, channel)[driven <= driven.min() + within]))


def zeroed(recording: Recording, channels: Sequence[str], over: str) -> Recording:
    """Return a recording whose channels are zero where an input is lowest; see `rest`.

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
        If there is no such channel.
    """
    level = {name: _known(recording, name) - rest(recording, name, over) for name in channels}
    return replace(recording, channels={**recording.channels, **level})


def apart(recordings: Sequence[Recording], channel: str, over: str) -> tuple[float, float] | None:
    """Return the lowest and the highest rest of recordings that are not of one zero, or None.

    They are not where they rest apart by more than a quarter of what the one that moves most travels,
    and every input begins alike.

    Parameters
    ----------
    recordings : sequence of Recording
    channel, over : str
        As for `rest`.

    Raises
    ------
    DataError
        If there is no such channel.
    """
    if len(recordings) < 2:
        return None
    lows = [float(_known(one, over).min()) for one in recordings]
    span = max(float(one[over].max()) for one in recordings) - min(lows)
    if max(lows) - min(lows) > LOWEST * span:
        return None
    near = LOWEST * min(float(np.ptp(one[over])) for one in recordings)
    rests = [_rest(one, channel, over, near) for one in recordings]
    travel = max(float(np.ptp(one[channel])) for one in recordings)
    if travel == 0 or max(rests) - min(rests) <= APART * travel:
        return None
    return min(rests), max(rests)


def _known(recording: Recording, channel: str) -> Array:
    if channel not in recording:
        raise DataError(
            f"there is no such channel among {', '.join(recording.channels)}",
            file=recording.source,
            channel=channel,
            remedy="name one of them",
        )
    return recording[channel]
