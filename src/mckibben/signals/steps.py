"""Step signals, for creep and air dynamics."""

from __future__ import annotations

from collections.abc import Sequence

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

REGISTER_BITS = 15
"""Length of the shift register: its sequence repeats after 2**15 - 1 holds."""


def staircase(time: ArrayLike, levels: Sequence[float], hold: float, ramp: float = 0.0) -> Array:
    """Return a staircase of constant levels, for identifying creep.

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
    t = as_time(time)
    if not len(levels):
        raise DataError("there are none", parameter="levels", remedy="give at least one")
    require_positive("hold", hold)
    require(0 <= ramp < np.inf, "ramp", ramp, "0 s or more", DataError)
    heights = require_finite("levels", levels)
    step = np.clip(np.floor(t / (hold + ramp)), 0, heights.size - 1).astype(int)
    if ramp == 0:
        return np.asarray(heights[step])
    share = np.clip(t - step * (hold + ramp) - hold, 0.0, ramp) / ramp
    after = heights[np.minimum(step + 1, heights.size - 1)]
    return np.asarray(heights[step] + share * (after - heights[step]))


def binary_steps(
    time: ArrayLike,
    high: float,
    low: float = 0.0,
    hold: float = 1.0,
    ramp: float = 0.0,
    seed: int = 0,
) -> Array:
    """Return pseudo-random binary steps (PRBS) between two levels, which excite all frequencies.

    A shift register of 15 bits, so that high and low are equally frequent over its 32767 holds.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time from the start of the first hold [s].
    high, low : float
        The two levels, high above low.
    hold : float
        Shortest time between two steps [s], positive.
    ramp : float
        Time that a step takes [s], below ``hold``; 0 for a jump.
    seed : int
        Where in the sequence to start.

    Raises
    ------
    DataError
        On high not above low, a hold that is not positive, or a ramp that does not fit into it.
    """
    t = as_time(time)
    require_order(low, high)
    n = _holds(t, hold, ramp)
    period = 2**REGISTER_BITS - 1
    register = 1 + int(generator(seed).integers(period))
    bits = np.empty(n)
    for i in range(n):
        bits[i] = register & 1
        feedback = (register ^ (register >> 1)) & 1
        register = (register >> 1) | (feedback << (REGISTER_BITS - 1))
    return staircase(t, (low + (high - low) * bits).tolist(), hold - ramp, ramp)


def _holds(t: Array, hold: float, ramp: float) -> int:
    """Return the number of holds that fill the time."""
    require_positive("hold", hold)
    require(
        0 <= ramp < hold, "ramp", ramp, f"0 s or more, less than a hold of {hold:g} s", DataError
    )
    if t.min() < 0:
        raise DataError(
            f"time starts at {t.min():g} s", remedy="count time from the start of the first hold"
        )
    return int(t.max() / hold) + 1
