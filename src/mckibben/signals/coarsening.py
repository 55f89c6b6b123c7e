"""Reduction of samples for fitting, without losing turning points of the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mckibben.errors import DataError, require
from mckibben.recording import FEWEST_SAMPLES, Recording
from mckibben.signals.reversals import reversals

MOST_SAMPLES = 100_000
"""Largest number of samples to fit to, and to test on."""


def coarsened(recording: Recording, factor: int, channel: str) -> Recording:
    """Return a recording with one sample per ``factor``, including turning points.

    Of every bin the sample at which the channel turns is taken, else the first: levels at turning
    points, on which memory depends, stay as they are, while times are off by less than a bin. Of
    several turns within one bin the outermost is taken; the first sample stays the first, and the last
    one is taken if it is the highest or lowest.

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
    turns = np.append(turns, u.size - 1) if _beyond(u) else turns
    turns = turns[np.argsort(np.abs(u[turns] - 0.5 * (u.max() + u.min())), kind="stable")]
    kept_rows = starts.copy()
    kept_rows[np.maximum(turns // factor, 1)] = (
        turns  # of several the last one stays, the outermost
    )
    step = recording.sample_time
    return replace(
        recording,
        channels={name: recording[name][kept_rows] for name in recording.channels},
        sample_time=None if step is None else step * factor,
    )


def _beyond(u: NDArray[np.float64]) -> bool:
    """Return whether the last sample is the highest or the lowest."""
    return bool(u[-1] >= u.max() or u[-1] <= u.min())


def made_manageable(
    sides: Sequence[Sequence[Recording]], channel: str, most: int | None = None
) -> tuple[list[list[Recording]], tuple[str, ...]]:
    """Return recordings thinned alike to at most so many samples for fit, for choice and for test.

    Parameters
    ----------
    sides : sequence of sequence of Recording
        For fit, for choice, for test. All have the channel.
    channel : str
        What drives.
    most : int, optional
        Samples of all recordings of a side together; default `MOST_SAMPLES`.

    Returns
    -------
    sides : list of list of Recording
    notes : tuple of str
        What was done, in words.

    Raises
    ------
    DataError
        If the limit is not positive, or leaves nothing.
    """
    most = MOST_SAMPLES if most is None else most
    require(most >= FEWEST_SAMPLES, "most_samples", most, f"{FEWEST_SAMPLES} or more", DataError)
    total = max(sum(map(len, recordings)) for recordings in sides)
    factor = -(-total // most)
    if factor == 1:
        return [list(recordings) for recordings in sides], ()
    step = next(recordings[0].sample_time for recordings in sides if recordings)
    grid = "" if step is None else f", {step * factor:g} s apart: models hold for that sample time"
    notes = [
        f"{total} samples are many: one in {factor} is used{grid}, turning points first. Models are "
        "fitted, chosen and tested on those."
    ]
    thinned, lost = [], 0
    for recordings in sides:
        long = [r for r in recordings if len(r) >= FEWEST_SAMPLES * factor]
        thinned.append([coarsened(recording, factor, channel) for recording in long])
        lost += sum(_lost(recording[channel], factor) for recording in long)
        left_out = [r.name for r in recordings if len(r) < FEWEST_SAMPLES * factor]
        if left_out:
            notes.append(f"Left out as too short: {', '.join(left_out)}.")
        if recordings and not long:
            raise DataError(
                f"these recordings have {max(map(len, recordings))} samples at most, of which one in "
                f"{factor} is too few",
                file=recordings[0].source,
                remedy="allow more samples with `most_samples`, or give fewer recordings",
            )
    if lost:
        notes.append(
            f"{lost} turning points lie too close to others and are lost: allow more samples."
        )
    return thinned, tuple(notes)


def _lost(u: NDArray[np.float64], factor: int) -> int:
    """Return the number of turning points that share a bin with another one."""
    turns = reversals(u)[1:-1]
    return int(turns.size - np.unique(np.maximum(turns // factor, 1)).size)
