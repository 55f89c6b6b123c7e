"""The condition of recorded signals, in numbers: saturation, stuck sensors, the output's lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording

LONGEST_LAG = 0.125
"""Largest lag that is considered, over the length of the recording."""

RUN = 3
"""Fewest equal samples in a row that are saturation."""

CORRELATED = 0.7
"""Smallest correlation of input and output by which a lag can be found."""

CLEAR = 0.002
"""Least share by which the correlation at a negative lag exceeds that without a lag."""

EARLY = -2
"""Lag in samples from which on an output moves before its input."""

DRIVING, DRIVEN = {"pressure", "voltage"}, {"displacement", "length", "contraction", "angle"}
"""Channels that move others, and those that they move, never before they do."""


@dataclass(frozen=True)
class Condition:
    """The condition of one channel.

    Parameters
    ----------
    saturated : float
        Share of the samples that are the lowest or the highest value, at least `RUN` in a row.
    stuck : int
        Samples of the longest run of one value in between.
    """

    saturated: float
    stuck: int


def condition(samples: Array) -> Condition:
    """Return the condition of a channel's samples, shape (n,)."""
    edges = np.flatnonzero(np.diff(samples)) + 1
    starts = np.concatenate([[0], edges])
    lengths = np.diff(np.concatenate([starts, [samples.size]]))
    at_limit = np.isin(samples[starts], (samples.min(), samples.max()))
    saturated = lengths[at_limit & (lengths >= RUN)].sum() / samples.size
    inside = lengths[~at_limit]
    return Condition(float(saturated), int(inside.max()) if inside.size else 0)


def lag(recording: Recording, input_: str, output: str) -> int | None:
    """Return by how many samples the output follows the input, by their cross-correlation.

    Returns
    -------
    int or None
        Negative where the output clearly moves before the input; None where they hardly correlate. In
        long recordings, an output that follows its input at once by an increasing function has a lag of
        0 (rearrangement inequality), one with hysteresis or creep of 0 or more.
    """
    u, y = (recording[name] - recording[name].mean() for name in (input_, output))
    size = 2 ** int(np.ceil(np.log2(2 * u.size)))
    found = np.fft.irfft(np.conj(np.fft.rfft(u, size)) * np.fft.rfft(y, size), size)
    most = max(1, int(LONGEST_LAG * u.size))
    lags = np.arange(-most, most + 1)
    values = np.copysign(1.0, found[0]) * found[lags]
    best = int(lags[np.argmax(values)])
    if best < 0 and values[most] > (1 - CLEAR) * values.max():
        best = 0  # noise, or the ends of a recording, move a flat maximum
    size_of_both = float(np.sqrt(np.sum(u**2) * np.sum(y**2)))
    return best if abs(best) < most and values.max() >= CORRELATED * size_of_both > 0 else None


def early(recordings: Sequence[Recording], input_: str, output: str) -> int | None:
    """Return the lag [samples] of an output that moves before its input, or None where it does not.

    Only motion by pressure or voltage is judged.
    """
    if not (input_.partition("_")[0] in DRIVING and output.partition("_")[0] in DRIVEN):
        return None
    lags = [lag(recording, input_, output) for recording in recordings]
    known = sorted(found for found in lags if found is not None)
    median = known[len(known) // 2] if known else 0
    return median if median <= EARLY else None
