"""Fewer samples for models to be fitted to, without losing a turning point of what drives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.signals.reversals import reversals

FEWEST = 10
"""Samples that a recording keeps; shorter ones are left out."""


def coarsened(recording: Recording, factor: int, channel: str) -> Recording:
    """Return a recording with one sample for every ``factor``, turning points kept.

    Of every bin the sample at which the channel turns is taken, else the first: levels at turning
    points, on which memory depends, stay as they are, while times are off by less than a bin. Of
    several turns within one bin the outermost is taken; the first sample stays the first.

    Parameters
    ----------
    recording : Recording
        Of at least two bins.
    factor : int
        Samples in a bin, at least 1.
    channel : str
        What drives.

    Raises
    ------
    DataError
        If fewer than two samples would be left.

    Examples
    --------
    >>> run = Recording({"pressure": [0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, 1.0]}, 0.1)
    >>> coarsened(run, 2, "pressure")["pressure"].tolist()
    [0.0, 3.0, 2.0, 0.0]
    """
    if factor == 1:
        return recording
    starts = np.arange(0, len(recording), factor)
    if starts.size < 2:
        raise DataError(
            f"one sample in {factor} leaves nothing of it",
            file=recording.source,
            remedy="allow more samples",
        )
    u = recording[channel]
    turns = reversals(u)[1:-1]
    turns = turns[np.argsort(np.abs(u[turns] - 0.5 * (u.max() + u.min())), kind="stable")]
    taken = starts.copy()
    taken[np.maximum(turns // factor, 1)] = turns  # of several the last one stays, the outermost
    step = recording.sample_time
    return replace(
        recording,
        channels={name: recording[name][taken] for name in recording.channels},
        sample_time=None if step is None else step * factor,
    )


def made_manageable(
    train: Sequence[Recording], test: Sequence[Recording], channel: str, most: int
) -> tuple[list[Recording], list[Recording], tuple[str, ...]]:
    """Return recordings thinned alike, so that no more than so many samples are fitted or tested on.

    Parameters
    ----------
    train, test : sequence of Recording
        All have the channel.
    channel : str
        What drives.
    most : int
        Samples of all training recordings together, and of all test recordings.

    Returns
    -------
    train, test : list of Recording
    notes : tuple of str
        What was done, in words.

    Raises
    ------
    DataError
        If the limit is not positive, or leaves nothing.
    """
    if most < FEWEST:
        raise DataError(f"{most} samples are too few to fit to", remedy=f"allow {FEWEST} or more")
    total = max(sum(map(len, train)), sum(map(len, test)))
    factor = -(-total // most)
    if factor == 1:
        return list(train), list(test), ()
    notes = [
        f"{total} samples are many: of every {factor} one is used, the turning points of {channel} "
        f"among them, which is {most} at most."
    ]
    parts = []
    for recordings in (train, test):
        long = [r for r in recordings if len(r) >= FEWEST * factor]
        parts.append([coarsened(recording, factor, channel) for recording in long])
        left_out = [r.name for r in recordings if len(r) < FEWEST * factor]
        if left_out:
            notes.append(f"Too short beside the others, so left out: {', '.join(left_out)}.")
        if recordings and not long:
            raise DataError(
                f"one sample in {factor} leaves none of these recordings",
                file=recordings[0].source,
                remedy="allow more samples, or leave out the long recordings",
            )
    return parts[0], parts[1], tuple(notes)
