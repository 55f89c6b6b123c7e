"""Splitting a recording at its cycles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mckibben.errors import DataError, require
from mckibben.recording import Recording
from mckibben.signals.reversals import reversals


def split_cycles(recording: Recording, channel: str, n_blocks: int) -> list[tuple[int, int]]:
    """Return blocks of whole cycles that cover a recording, about equally long.

    Parameters
    ----------
    channel : str
        The input, at whose minima is cut; at its maxima too where it has no minimum inside.
    n_blocks : int
        Most blocks, at least 1. There are fewer where there are fewer cycles.

    Returns
    -------
    list of (start, stop)
        Sample numbers, the first 0 and the last the number of samples; each stop is the next start.

    Raises
    ------
    DataError
        On fewer than one block, or on more than one where the channel never turns.
    """
    require(n_blocks >= 1, "n_blocks", n_blocks, "1 or more", DataError)
    n = len(recording)
    if n_blocks == 1:
        return [(0, n)]
    x = recording[channel]
    turns = reversals(x)
    inside = turns[1:-1]
    minima = inside[x[inside] < x[turns[:-2]]]
    allowed = minima if minima.size else inside
    if not allowed.size:
        raise DataError(
            "it never turns, so there is no cycle to split at",
            file=recording.source,
            channel=channel,
            remedy="record at least one rising and one falling branch",
        )
    wanted = n * np.arange(1, n_blocks) / n_blocks
    nearest = allowed[np.abs(allowed[:, np.newaxis] - wanted).argmin(axis=0)]
    cuts = [0, *np.unique(nearest).tolist(), n]
    return list(pairwise(cuts))
