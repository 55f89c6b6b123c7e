"""Load profiles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import DataError, require
from mckibben.signals.checking import as_time, require_finite, require_positive


def constant(time: ArrayLike, value: float) -> Array:
    """Return one value for all times.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s].
    value : float
        The value, finite.

    Raises
    ------
    DataError
        On a value that is not finite.
    """
    require_finite("value", value)
    return np.full(as_time(time).shape, float(value))


def ramps(time: ArrayLike, instants: Sequence[float], values: Sequence[float]) -> Array:
    """Return straight lines through points, constant before the first and after the last.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s].
    instants : sequence of float
        Times of the points [s], increasing.
    values : sequence of float
        Values there, as many.

    Raises
    ------
    DataError
        On points that are not finite, not in order, or not as many values as instants.

    Examples
    --------
    >>> ramps([0.0, 1.0, 2.0, 3.0], instants=(1.0, 2.0), values=(0.0, 10.0)).tolist()
    [0.0, 0.0, 10.0, 10.0]
    """
    t = as_time(time)
    places, heights = require_finite("instants", instants), require_finite("values", values)
    if places.shape != heights.shape or places.ndim != 1 or places.size == 0:
        raise DataError(
            f"{places.size} instants and {heights.size} values make no ramps",
            parameter="instants",
            remedy="give one value an instant, and at least one",
        )
    if not (np.diff(places) > 0).all():
        raise DataError(
            "they are not in order", parameter="instants", remedy="give increasing ones"
        )
    return np.asarray(np.interp(t, places, heights))


def pulls(
    time: ArrayLike, high: float, n_pulls: int = 3, duration: float = 8.0, low: float = 0.0
) -> Array:
    """Return pulls as by a hand, evenly spaced in time: smooth rise, short hold, release.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s], increasing; each pull is in the middle of its share of it.
    high, low : float
        Highest value of every pull, and the value between them.
    n_pulls : int
        Number of pulls, at least 1.
    duration : float
        Of each pull [s], positive, and no more than its share of the time.

    Raises
    ------
    DataError
        On no pulls, values that are not finite, or pulls that do not fit into the time.

    Examples
    --------
    >>> pulls([0.0, 5.0, 10.0], high=100.0, n_pulls=1, duration=6.0).tolist()
    [0.0, 100.0, 0.0]
    """
    t = as_time(time)
    require_positive("duration", duration)
    require(n_pulls >= 1, "n_pulls", n_pulls, "1 or more", DataError)
    require_finite("high", high)
    require_finite("low", low)
    share = float(t[-1] - t[0]) / n_pulls
    if duration > share:
        raise DataError(
            f"{n_pulls} pulls of {duration:g} s do not fit into {t[-1] - t[0]:g} s",
            parameter="duration",
            remedy="ask for fewer or shorter ones",
        )
    count = np.minimum(np.floor((t - t[0]) / share), n_pulls - 1)
    away = np.abs(t - t[0] - (count + 0.5) * share) / (0.5 * duration)
    # A hand takes two thirds of a pull to come and go, and holds for the third between.
    rise = np.clip(1.5 * (1.0 - away), 0.0, 1.0)
    return np.asarray(low + (high - low) * (0.5 - 0.5 * np.cos(np.pi * rise)))
