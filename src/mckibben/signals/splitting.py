"""Splitting a recording at its cycles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mckibben.errors import DataError, require
from mckibben.recording import Recording
from mckibben.signals.reversals import reversals


def split_cycles(recording: Recording, channel: str, n_blocks: int) -> list[tuple[int, int]]:
    """Return blocks of whole cycles that cover a recording, of about equal length.

    Parameters
    ----------
    recording : Recording
    channel : str
        Input whose minima separate the cycles; its maxima if it has no minimum between its ends.
    n_blocks : int
        Largest number of blocks, at least 1. Recordings of fewer cycles have fewer blocks.

    Returns
    -------
    list of (start, stop)
        Sample numbers, the first 0 and the last the number of samples; each stop is the next start.

    Raises
    ------
    DataError
        If ``n_blocks`` is below 1, or above 1 for a channel that never turns.
    """
    require(n_blocks >= 1, "n_blocks", n_blocks, "1 or more", DataError)
    n = len(recording)
    if n_blocks == 1:
        return [(0, n)]
    x = recording[channel]
    turns = reversals(x)
    inside = turns[1:-1]
    minima = inside[x[inside] < x[turns[:-2]]]
    boundaries = minima if minima.size else inside
    if not boundaries.size:
        raise DataError(
            "it never turns, so there is no cycle to split at",
            file=recording.source,
            channel=channel,
            remedy="record at least one rising and one falling branch",
        )
    equal = n * np.arange(1, n_blocks) / n_blocks
    nearest = boundaries[np.abs(boundaries[:, np.newaxis] - equal).argmin(axis=0)]
    return list(pairwise([0, *np.unique(nearest).tolist(), n]))
