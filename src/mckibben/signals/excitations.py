"""Excitation signals that reveal hysteresis."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import DataError, require
from mckibben.signals.checking import (
    as_time,
    generator,
    require_finite,
    require_order,
    require_positive,
)


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


def progressive_sine(
    time: ArrayLike, period: float, high: float, low: float = 0.0, n_cycles: int = 8
) -> Array:
    """Return a raised sine whose peaks rise evenly, cycle by cycle, up to ``high``.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time from the start of the first cycle [s], not negative; after ``n_cycles`` it starts anew.
    period : float
        Time of one cycle [s], positive.
    high, low : float
        Highest peak, and the value where every cycle starts and ends; high above low.
    n_cycles : int
        Cycles until the highest peak, at least 1.

    Raises
    ------
    DataError
        On a period that is not positive, negative time, no cycles, or high not above low.

    Examples
    --------
    >>> progressive_sine([0.5, 1.5, 2.5], period=1.0, high=6.0, n_cycles=3).round(12).tolist()
    [2.0, 4.0, 6.0]
    """
    return sine(time, period, _rising(low, high, n_cycles), low)


def decaying_sine(
    time: ArrayLike, period: float, high: float, low: float = 0.0, n_cycles: int = 8
) -> Array:
    """Return a raised sine whose peaks fall evenly from ``high``: nested loops.

    Parameters and errors are those of `progressive_sine`.
    """
    return sine(time, period, _rising(low, high, n_cycles)[::-1], low)


def progressive_triangle(
    time: ArrayLike, period: float, high: float, low: float = 0.0, n_cycles: int = 8
) -> Array:
    """Return a triangle whose peaks rise evenly, cycle by cycle, up to ``high``.

    Parameters and errors are those of `progressive_sine`.
    """
    return triangle(time, period, _rising(low, high, n_cycles), low)


def decaying_triangle(
    time: ArrayLike, period: float, high: float, low: float = 0.0, n_cycles: int = 8
) -> Array:
    """Return a triangle whose peaks fall evenly from ``high``: nested loops.

    Parameters and errors are those of `progressive_sine`.

    Examples
    --------
    >>> decaying_triangle([0.5, 1.5, 2.5, 3.5], period=1.0, high=6.0, n_cycles=3).tolist()
    [6.0, 4.0, 2.0, 6.0]
    """
    return triangle(time, period, _rising(low, high, n_cycles)[::-1], low)


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
    t = as_time(time)
    require(n_turns >= 1, "n_turns", n_turns, "1 or more", DataError)
    require_order(low, high)
    levels = [0.0, 1.0]
    for share in generator(seed).uniform(0.1, 1.0, n_turns):
        far = 0.0 if levels[-1] > levels[-2] else 1.0
        levels.append(levels[-1] + share * (far - levels[-1]))
    ways = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(levels)))])
    instants = t[0] + (t[-1] - t[0]) * ways / ways[-1]
    return np.asarray(low + (high - low) * np.interp(t, instants, levels))


def _rising(low: float, high: float, n_cycles: int) -> list[float]:
    require_order(low, high)
    require(n_cycles >= 1, "n_cycles", n_cycles, "1 or more", DataError)
    return [low + (high - low) * (k + 1) / n_cycles for k in range(n_cycles)]


def _cycles(
    time: ArrayLike,
    period: float,
    peaks: float | Sequence[float],
    low: float,
    shape: Callable[[Array], Array],
) -> Array:
    t = as_time(time)
    require_positive("period", period)
    require_finite("low", low)
    heights = require_finite("peaks", peaks) - low
    if heights.size == 0:
        raise DataError("there are none", parameter="peaks", remedy="give at least one")
    if t.min() < 0:
        raise DataError(
            f"time starts at {t.min():g} s", remedy="count time from the start of the first cycle"
        )
    count = np.floor(t / period)
    peak = heights[count.astype(int) % heights.size]
    return np.asarray(low + peak * shape(t / period - count))
