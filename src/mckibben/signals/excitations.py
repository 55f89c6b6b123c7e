"""Excitations: how to drive a muscle so that its hysteresis can be seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.errors import DataError

Array = NDArray[np.float64]

N_WAVES = 64
"""Sines in a random wave: enough for it to look random, few enough to be quick."""


def sine(time: ArrayLike, period: float, peaks: float | Sequence[float], low: float = 0.0) -> Array:
    """Return a raised sine: every cycle starts and ends at ``low`` and has its own peak.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time from the start of the first cycle [s], not negative.
    period : float
        Time of one cycle [s], positive.
    peaks : float or sequence of float
        Highest value of each cycle, for example rising ones for progressive loops; from the first
        again when there are more cycles. A single number is the peak of all.
    low : float
        Lowest value.

    Returns
    -------
    array, shape (n,)
        In the unit of ``peaks`` and ``low``.

    Raises
    ------
    DataError
        On a period that is not positive, negative time, or no peaks.

    Examples
    --------
    >>> sine([0.0, 0.5, 1.0, 1.5], period=1.0, peaks=(2.0, 4.0)).round(12).tolist()
    [0.0, 2.0, 0.0, 4.0]
    """
    return _cycles(time, period, peaks, low, lambda phase: 0.5 - 0.5 * np.cos(2 * np.pi * phase))


def triangle(
    time: ArrayLike, period: float, peaks: float | Sequence[float], low: float = 0.0
) -> Array:
    """Return a triangle: every cycle starts and ends at ``low`` and has its own peak.

    Parameters and errors are those of `sine`.

    Examples
    --------
    >>> triangle([0.0, 0.25, 0.5, 1.0, 1.5], period=1.0, peaks=(2.0, 4.0)).tolist()
    [0.0, 1.0, 2.0, 0.0, 4.0]
    """
    return _cycles(time, period, peaks, low, lambda phase: 1 - np.abs(1 - 2 * phase))


def irregular_triangle(
    time: ArrayLike, n_turns: int, high: float, low: float = 0.0, *, seed: int
) -> Array:
    """Return ramps of one speed between random turning points: nested and crossing minor loops.

    Starts at ``low``, rises to ``high`` first and so has the major branch in it.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s], increasing; the turning points are spread over all of it.
    n_turns : int
        Turning points between the first sample and the last, at least 1.
    high, low : float
        Highest and lowest value, high above low.
    seed : int
        Of the turning points.

    Raises
    ------
    DataError
        On fewer than one turning point, or high not above low.
    """
    t = _checked(time)
    if n_turns < 1:
        raise DataError(f"{n_turns} turning points are too few", remedy="ask for at least 1")
    _check_order(low, high)
    levels = [0.0, 1.0]
    for share in np.random.default_rng(seed).uniform(0.1, 1.0, n_turns):
        far = 0.0 if levels[-1] > levels[-2] else 1.0
        levels.append(levels[-1] + share * (far - levels[-1]))
    ways = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(levels)))])
    instants = t[0] + (t[-1] - t[0]) * ways / ways[-1]
    return np.asarray(low + (high - low) * np.interp(t, instants, levels))


def staircase(time: ArrayLike, levels: Sequence[float], hold: float, ramp: float = 0.0) -> Array:
    """Return levels that are held one after another, so that creep can be seen.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time from the start of the first hold [s].
    levels : sequence of float
        Values to hold; the last one is held for good.
    hold : float
        Time that each level is held [s], positive.
    ramp : float
        Time that the way to the next level takes [s]; 0 for a jump.

    Raises
    ------
    DataError
        On no levels, a hold that is not positive, or a negative ramp.

    Examples
    --------
    >>> staircase([0.0, 1.0, 1.5, 2.0, 3.0], levels=(0.0, 4.0), hold=1.0, ramp=1.0).tolist()
    [0.0, 0.0, 2.0, 4.0, 4.0]
    """
    t = _checked(time)
    if not len(levels):
        raise DataError("a staircase needs levels", remedy="give at least one")
    _check_positive("hold", hold)
    if not ramp >= 0:
        raise DataError(f"a ramp of {ramp} s is impossible", remedy="give 0 or more seconds")
    heights = np.asarray(levels, dtype=float)
    step = np.clip(np.floor(t / (hold + ramp)), 0, heights.size - 1).astype(int)
    if ramp == 0:
        return np.asarray(heights[step])
    share = np.clip(t - step * (hold + ramp) - hold, 0.0, ramp) / ramp
    after = heights[np.minimum(step + 1, heights.size - 1)]
    return np.asarray(heights[step] + share * (after - heights[step]))


def random_wave(
    time: ArrayLike, max_frequency: float, high: float, low: float = 0.0, *, seed: int
) -> Array:
    """Return a sum of sines with random frequencies and phases: smooth, with loops of all sizes.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s].
    max_frequency : float
        Highest frequency in it [Hz], positive; all are equally strong.
    high, low : float
        Its highest and lowest sample, high above low.
    seed : int
        Of frequencies and phases.

    Raises
    ------
    DataError
        On a frequency that is not positive, or high not above low.
    """
    t = _checked(time)
    _check_positive("max_frequency", max_frequency)
    _check_order(low, high)
    rng = np.random.default_rng(seed)
    frequencies = rng.uniform(0.0, max_frequency, N_WAVES)
    phases = rng.uniform(0.0, 2 * np.pi, N_WAVES)
    wave = np.zeros_like(t)
    for frequency, phase in zip(frequencies, phases, strict=True):
        wave += np.cos(2 * np.pi * frequency * t + phase)
    bottom, top = wave.min(), wave.max()
    if bottom == top:
        raise DataError("one instant makes no wave", remedy="give more than one time")
    # Clipped, because rounding may carry the extreme samples past the limits.
    return np.asarray(np.clip(low + (high - low) * (wave - bottom) / (top - bottom), low, high))


def _cycles(
    time: ArrayLike,
    period: float,
    peaks: float | Sequence[float],
    low: float,
    shape: Callable[[Array], Array],
) -> Array:
    t = _checked(time)
    _check_positive("period", period)
    heights = np.atleast_1d(np.asarray(peaks, dtype=float)) - low
    if heights.size == 0:
        raise DataError("there are no peaks", remedy="give at least one")
    if t.min() < 0:
        raise DataError(
            f"time starts at {t.min():g} s", remedy="count time from the start of the first cycle"
        )
    count = np.floor(t / period)
    peak = heights[count.astype(int) % heights.size]
    return np.asarray(low + peak * shape(t / period - count))


def _checked(time: ArrayLike) -> Array:
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or t.size == 0 or not np.isfinite(t).all():
        raise DataError("time is not a row of finite numbers", remedy="give one time a sample")
    return t


def _check_positive(name: str, value: float) -> None:
    if not 0 < value < np.inf:
        raise DataError(f"{name} is {value}", remedy="give a positive number")


def _check_order(low: float, high: float) -> None:
    if not low < high:
        raise DataError(f"high {high} is not above low {low}", remedy="give low < high")
