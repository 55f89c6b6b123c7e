"""Holds: segments in which several signals, such as all inputs and loads, are constant."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array, true_runs
from mckibben.signals.reversals import NOISE_SHARE, noise_level, swing_threshold

STILL = 0.01
"""Share of its range within which a signal is constant, unless noise or resolution is wider."""

CLEAR = 20.0
"""A step this many times the noise shows movement."""

ALTERNATING = 0.1
"""Share of the smallest steps that turn straight back, from which on they are a sensor's resolution."""


def holds(columns: Array, spans: Sequence[float] | None = None, shortest: int = 10) -> list[slice]:
    """Return the segments in which every column is constant, in order of time.

    A column is constant while it stays within 1 % of its range, its noise or one step of its
    resolution to either side, whichever is widest. Holds are as long as possible and do not overlap. A
    slow ramp is no hold: a sequence of constant windows must not be longer than twice the longest of
    them.

    Parameters
    ----------
    columns : array, shape (n, k)
        Signals with one row a sample, such as pressures and loads.
    spans : sequence of float, length k, optional
        Range by which each column is judged; default its own. Give the range over all recordings.
    shortest : int
        Samples of a hold, at least.

    Examples
    --------
    >>> steps = np.repeat([0.0, 3.0, 1.0], 20)
    >>> holds(steps[:, np.newaxis])
    [slice(0, 20, None), slice(20, 40, None), slice(40, 60, None)]
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    columns = np.asarray(columns, dtype=np.float64)
    n = len(columns)
    if n < shortest:
        return []
    ranges = np.ptp(columns, axis=0).tolist() if spans is None else spans
    bands = [_band(x, span) for x, span in zip(columns.T, ranges, strict=True)]
    stretches: list[tuple[int, slice]] = []
    length = shortest
    while length <= n:
        quiet = np.ones(n - length + 1, dtype=bool)
        window = slice(length // 2, length // 2 + quiet.size)
        for x, band in zip(columns.T, bands, strict=True):
            swing = maximum_filter1d(x, length) - minimum_filter1d(x, length)
            quiet &= swing[window] <= band
        if not quiet.any():
            break
        stretches += [
            (length, slice(start, stop - 1 + length)) for start, stop in true_runs(quiet).tolist()
        ]
        length *= 2
    result: list[slice] = []
    is_taken = np.zeros(n, dtype=bool)
    for length, stretch in reversed(stretches):
        lasts = stretch.stop - stretch.start
        if lasts < 2 * length + shortest and not is_taken[stretch].any():
            result.append(stretch)
            is_taken[stretch] = True
    return sorted(result, key=lambda stretch: int(stretch.start))


def shortest_hold(x: Array, span: float) -> int:
    """Return the samples in which a moving signal covers half of its range; at least ten.

    A turning point lasts less, so that it is no hold. The mean speed is weighted with the way covered,
    and taken over steps that are long enough to stand out of the noise.
    """
    noise, stride = np.nan_to_num(noise_level(x, span)) if x.size > 1 else 0.0, 1
    while True:
        steps = np.abs(np.diff(x[::stride]))
        step = float(np.sum(steps**2) / np.sum(steps)) if steps.any() else 0.0
        if step > CLEAR * noise or 16 * stride > x.size:
            return max(10, int(np.ceil(0.5 * span * stride / step))) if step else x.size + 1
        stride *= 2


def moves(signals: Sequence[Array]) -> bool:
    """Return whether a channel varies, within its pieces or between them, by more than white noise."""
    steps = np.concatenate([np.diff(x) for x in signals])
    # of white noise it is twice the variance
    return float(np.mean(steps**2)) < float(np.concatenate(signals).var())


def _band(x: Array, span: float) -> float:
    """Return the variation of a constant signal."""
    noise = noise_level(x, span) if x.size > 1 else float("nan")
    return max(STILL * span, swing_threshold(noise, 0.0, x.size), 2.5 * _resolution(x, span))


def _resolution(x: Array, span: float) -> float:
    """Return the resolution of a coarse sensor, 0 for a fine one.

    Two readings side by side alternate under noise; the levels of a staircase do only where it turns.
    """
    steps = np.diff(x)
    steps = steps[steps != 0]
    step = float(np.abs(steps).min()) if steps.size > 1 else 0.0
    if not 0 < step <= NOISE_SHARE * span:
        return 0.0
    single = np.abs(steps) < 1.5 * step
    back = single[:-1] & single[1:] & (steps[:-1] * steps[1:] < 0)
    return step if np.sum(back) > ALTERNATING * np.sum(single) else 0.0
