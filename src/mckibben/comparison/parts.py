"""Parts of the training data that are left out in turn, to choose a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Mask
from mckibben.channels import Channels, held_at_levels
from mckibben.comparison.doubts import Span
from mckibben.recording import Recording

N_PARTS = 8
"""Number of parts; a few more where recordings are cut equally."""

FEWEST = 10
"""Smallest number of samples of a part of a recording."""

Part = tuple[Mask, ...]
"""For every recording, the samples that a part has."""


def parts_of(recordings: Sequence[Recording], channels: Channels) -> tuple[Part, ...]:
    """Return the parts: blocks of time of fewer than `N_PARTS` recordings, else whole recordings.

    These are dealt to the parts in the order of what is held in each of them, such as a load or a
    length, so that every part has several levels, and repeats are in different parts. Samples bridged in
    reading belong to none. There are none of too little data.
    """
    each = -(-N_PARTS // len(recordings))
    pieces = [
        (place, piece)
        for place in _by_level(recordings, channels)
        for piece in np.array_split(
            np.arange(len(recordings[place])), np.clip(len(recordings[place]) // FEWEST, 1, each)
        )
    ]
    count = len(pieces) if each > 1 else N_PARTS
    measured = [~recording.bridged for recording in recordings]
    parts = []
    for first in range(count if count > 1 else 0):
        rows = [np.zeros(len(recording), dtype=bool) for recording in recordings]
        for place, piece in pieces[first::count]:
            rows[place][piece] = measured[place][piece]
        if any(kept.any() for kept in rows):
            parts.append(tuple(rows))
    return tuple(parts)


def spans_of(part: Part, recordings: Sequence[Recording]) -> tuple[Span, ...]:
    """Return what a part has of each recording."""
    found = []
    for recording, rows in zip(recordings, part, strict=True):
        times, unit = recording.time[rows], "" if recording.sample_time is None else "s"
        if times.size:
            found.append(Span(recording.name, float(times[0]), float(times[-1]), unit))
    return tuple(found)


def _by_level(recordings: Sequence[Recording], channels: Channels) -> list[int]:
    """Return the indices of recordings, in the order of the channels that each of them holds."""
    names = channels.given(recordings) if len(recordings) > 1 else ()
    held = [name for name in names if held_at_levels(recordings, name)]
    levels = [tuple(float(f"{r[name].mean():.3g}") for name in held) for r in recordings]
    return sorted(range(len(recordings)), key=lambda place: levels[place])
