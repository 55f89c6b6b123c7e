"""Turning points of a noisy signal, and the branches and cycles between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.arrays import Array, check_finite
from mckibben.errors import DataError, require
from mckibben.system.compiling import deferred

Indices = NDArray[np.int64]

NOISE_SHARE = 0.05
"""Sample-to-sample scatter, as a share of the range, above which it counts as motion, not noise."""

SLIGHT = 1e-3
"""Scatter below this share of the range counts as small."""

GROWS = 1.5
"""Scatter that grows so much over every second of so many samples is of movement."""

FEWEST_FOR_NOISE = 32
"""Smallest number of samples from which noise is estimated."""

OF_NORMAL = 0.6745 * np.sqrt(20.0)
"""Median size of third differences of N(0, 1), of variance 20; 0.6745 is the median of |N(0, 1)|."""

RANGE_SHARE = 0.01
"""Smallest swing that counts as a movement, relative to the range."""

LEAST_WHOLE = 0.9
"""Smallest ratio of a first or last branch to its partner for a cycle to count."""


def noise_level(x: ArrayLike, span: float | None = None) -> float:
    """Return the standard deviation of the white noise on a signal, in its unit.

    Third differences remove what moves smoothly, and their median is not moved by jumps and turns.

    Parameters
    ----------
    x : array_like, shape (n,)
        At least two samples.
    span : float, optional
        Range of the movement to judge by; default that of ``x``. Give it where ``x`` is a quiet
        piece of something longer.

    Returns
    -------
    float
        NaN where noise cannot be distinguished from movement: fewer than eight samples, or a
        scatter above 5 % of the range, as in levels chosen at random of which each was recorded
        once; or one above 0.1 % that grows where every second sample is left out, as that of fast
        motion does.

    Raises
    ------
    DataError
        On fewer than two samples, or values that are not finite.
    """
    values = _checked(x)
    if values.size < 8:
        return float("nan")
    scatter, twice = third_differences(values)
    noise = scatter / OF_NORMAL
    span = float(np.ptp(values)) if span is None else span
    moves = values.size >= FEWEST_FOR_NOISE and noise > SLIGHT * span and twice > GROWS * scatter
    return noise if noise <= NOISE_SHARE * span and not moves else float("nan")


def third_differences(x: Array) -> tuple[float, float]:
    """Return the median size of third differences, and of those over every second sample.

    Of white noise they are alike; of motion the second is larger.
    """
    one, two = (float(np.median(np.abs(np.diff(x[::k], 3)))) for k in (1, 2))
    return one, two


def swing_threshold(noise: float, span: float, n: int) -> float:
    """Return the smallest significant swing: above the noise, and at least 1 % of the range.

    Parameters
    ----------
    noise : float
        Standard deviation; NaN for unknown.
    span : float
        Range of the signal.
    n : int
        Number of samples; the more there are, the further noise swings somewhere among them.
    """
    # The expected range of n samples of N(0, 1) is below 2 sqrt(2 ln n).
    factor = 2 * np.sqrt(2 * np.log(max(n, 2))) + 1
    return max(RANGE_SHARE * span, 0.0 if np.isnan(noise) else factor * noise)


def reversals(x: ArrayLike, threshold: float | None = None) -> Indices:
    """Return where a signal turns, with its first and last sample.

    Between two turning points the signal never swings back by more than the threshold, and each is
    the extreme sample of the branches that meet there; of a plateau it is the last sample, so that
    a hold is part of the branch before it. A hold within a branch is no reversal. Only the
    first and last sample may be less extreme than a neighbour, by at most the threshold.

    Parameters
    ----------
    x : array_like, shape (n,)
        At least two samples.
    threshold : float, optional
        Smallest swing back that makes a reversal, not negative, unit of the signal; default the
        greater of 1 % of the range and what noise reaches.

    Returns
    -------
    array of int, shape (m,), m at least 2
        Increasing sample numbers.

    Raises
    ------
    DataError
        On fewer than two samples, values that are not finite, or a negative threshold.

    Examples
    --------
    >>> reversals([0.0, 1.0, 2.0, 2.0, 1.0, 1.0, 0.0]).tolist()
    [0, 3, 6]
    """
    values = _checked(x)
    if threshold is None:
        threshold = swing_threshold(noise_level(values), float(np.ptp(values)), values.size)
    require(threshold >= 0, "threshold", threshold, "0 or more", DataError)
    indices = np.empty(values.size, dtype=np.int64)
    return indices[: _turns(values, float(threshold), indices)]


def branches(x: ArrayLike, threshold: float | None = None) -> list[tuple[int, int, int]]:
    """Return the monotonic branches of a signal.

    Parameters
    ----------
    x, threshold
        As for `reversals`.

    Returns
    -------
    list of (start, stop, direction)
        ``x[start:stop]`` is the branch with both its turning points, which neighbouring branches
        share; direction is 1 rising, -1 falling, and 0 for a signal that ends where it began
        without having turned.

    Examples
    --------
    >>> branches([0.0, 1.0, 2.0, 1.0])
    [(0, 3, 1), (2, 4, -1)]
    """
    values = _checked(x)
    return branches_between(values, reversals(values, threshold))


def branches_between(x: Array, turns: Indices) -> list[tuple[int, int, int]]:
    """Return the branches between known turning points, as `branches` does."""
    ways = np.sign(np.diff(x[turns])).astype(int)
    return [
        (int(start), int(stop) + 1, int(way))
        for start, stop, way in zip(turns[:-1], turns[1:], ways, strict=True)
    ]


def cycles(x: ArrayLike, threshold: float | None = None) -> list[slice]:
    """Return the whole cycles of a signal, from minimum to minimum.

    Every slice holds both its minima, so that neighbouring ones share a sample. What comes before
    the first minimum and after the last is left out; where a signal begins or ends within a cycle,
    that counts when no more than a tenth of its branch is missing.

    Parameters
    ----------
    x, threshold
        As for `reversals`.

    Examples
    --------
    >>> cycles([0.0, 2.0, 0.0, 3.0, 0.0, 1.0])
    [slice(0, 3, None), slice(2, 5, None)]
    """
    values = _checked(x)
    return whole_cycles(values, reversals(values, threshold))


def whole_cycles(x: Array, turns: Indices, whole: float = LEAST_WHOLE) -> list[slice]:
    """Return the whole cycles between known turning points.

    At either end of the signal, a branch counts as whole from this share of the other one.
    """
    heights = x[turns]
    # A minimum, a maximum and a minimum in a row, wherever the first two rise.
    first = 0 if heights[1] > heights[0] else 1
    last = turns.size - 3
    result = []
    for i in range(first, last + 1, 2):
        rise, fall = heights[i + 1] - heights[i], heights[i + 1] - heights[i + 2]
        is_whole = i > 0 or rise >= whole * fall
        ended = i < last or fall >= whole * rise
        if is_whole and ended:
            result.append(slice(int(turns[i]), int(turns[i + 2]) + 1))
    return result


@deferred
def _turns(x: Array, threshold: float, indices: Indices) -> int:
    """Write the turning points into ``found``; return how many there are."""
    n, count, way = x.size, 1, 0
    indices[0] = 0
    low = high = 0
    for i in range(1, n):
        if way <= 0 and x[i] <= x[low]:
            low = i
        if way >= 0 and x[i] >= x[high]:
            high = i
        if way >= 0 and x[high] - x[i] > threshold:
            if way > 0:
                indices[count] = high
                count += 1
            way, low = -1, i
        elif way <= 0 and x[i] - x[low] > threshold:
            if way < 0:
                indices[count] = low
                count += 1
            way, high = 1, i
    indices[count] = n - 1
    return count + 1


def _checked(x: ArrayLike) -> Array:
    values = np.ascontiguousarray(x, dtype=np.float64)
    if values.ndim != 1 or values.size < 2:
        raise DataError(
            f"a signal of shape {values.shape} has no branches",
            remedy="give a row of at least two samples",
        )
    check_finite(values)
    return values
