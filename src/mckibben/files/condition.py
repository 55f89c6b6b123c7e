"""Condition of recorded signals: saturation, stuck sensors, lag of the output."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording

DRIVING, DRIVEN = {"bar", "V"}, {"mm", "rad"}
"""Units of channels that move others, and of those that they move, never before they do."""

MOST = 1 << 20
"""Number of samples of a recording used to estimate its lag."""


def condition(samples: Array) -> dict[str, float]:
    """Return the condition of a channel's samples, shape (n,).

    Returns
    -------
    dict
        ``saturated``: share of the samples that are the lowest or the highest value, at least three in
        a row; ``stuck``: samples of the longest run of one value in between.
    """
    starts = np.append(0, np.flatnonzero(np.diff(samples)) + 1)
    lengths = np.diff(starts, append=samples.size)
    at_limit = np.isin(samples[starts], (samples.min(), samples.max()))
    saturated = lengths[at_limit & (lengths >= 3)].sum() / samples.size
    return {"saturated": float(saturated), "stuck": int(lengths[~at_limit].max(initial=0))}


def lag(recording: Recording, input_: str, output: str) -> int | None:
    """Return the lag of the output after the input in samples, by cross-correlation.

    Returns
    -------
    int or None
        Negative where the output clearly moves before the input; None where they hardly correlate. In
        long recordings, an output that follows its input at once by an increasing function has a lag of
        0 (rearrangement inequality), one with hysteresis or creep of 0 or more.
    """
    u, y = (recording[name][:MOST] for name in (input_, output))
    u, y = u - u.mean(), y - y.mean()
    size = 2 ** int(np.ceil(np.log2(2 * u.size)))
    found = np.fft.irfft(np.conj(np.fft.rfft(u, size)) * np.fft.rfft(y, size), size)
    most = max(1, u.size // 8)
    lags = np.arange(-most, most + 1)
    values = np.copysign(1.0, found[0]) * found[lags]
    best = int(lags[np.argmax(values)])
    if best < 0 and values[most] > 0.998 * values.max():
        best = 0  # noise, or the ends of a recording, move a flat maximum
    size_of_both = float(np.sqrt(np.sum(u**2) * np.sum(y**2)))
    return best if abs(best) < most and values.max() >= 0.7 * size_of_both > 0 else None


def early(recordings: Sequence[Recording], input_: str, output: str) -> int | None:
    """Return the lag [samples] of an output that moves before its input, or None.

    Only motion by pressure or voltage is judged.
    """
    units = recordings[0].units
    if not (units[input_] in DRIVING and units[output] in DRIVEN):
        return None
    lags = [lag(recording, input_, output) for recording in recordings]
    known = sorted(found for found in lags if found is not None)
    median = known[len(known) // 2] if known else 0
    return median if median <= -2 else None
