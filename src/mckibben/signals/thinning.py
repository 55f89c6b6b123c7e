"""Thinning a signal for a plot without losing an extremum."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError


def decimate_minmax(t: ArrayLike, *series: ArrayLike, max_points: int) -> tuple[Array, ...]:
    """Return the lowest and highest sample of every bin, for display.

    Bins hold equally many samples. The extrema of every series remain, and all are thinned to the
    same samples, so that one may be drawn over another. The first and last sample stay where there
    is room.

    Parameters
    ----------
    t : array_like, shape (n,)
        What the series are drawn over, usually time.
    *series : array_like, shape (n,)
        At least one.
    max_points : int
        Most samples left, at least two a series.

    Returns
    -------
    tuple of array, shape (m,)
        ``t`` and the series, in the order given; as they are when they are short enough.

    Raises
    ------
    DataError
        On series of another length than t, none, or too few points.

    Examples
    --------
    >>> t, y = decimate_minmax([0, 1, 2, 3, 4, 5, 6, 7], [0, 0, 9, 0, 0, -9, 0, 0], max_points=6)
    >>> t.tolist(), y.tolist()
    ([0.0, 2.0, 4.0, 5.0, 7.0], [0.0, 9.0, 0.0, -9.0, 0.0])
    """
    columns = [np.asarray(column, dtype=np.float64) for column in (t, *series)]
    n, per_bin = columns[0].size, 2 * len(series)
    if not series or any(column.shape != (n,) for column in columns):
        raise DataError(
            f"shapes {[column.shape for column in columns]} cannot be drawn together",
            remedy="give at least one series, and all of the same length as t",
        )
    if max_points < per_bin:
        raise DataError(
            f"{max_points} points cannot hold the extrema of {len(series)} series",
            remedy=f"allow at least {per_bin}",
        )
    if n <= max_points:
        return tuple(columns)
    with_ends = max_points >= per_bin + 2
    size = -(-n // ((max_points - 2 * with_ends) // per_bin))
    extremes = [extreme for column in columns[1:] for extreme in _extremes(column, size)]
    if with_ends:
        extremes.append(np.array([0, n - 1]))
    places = np.unique(np.concatenate(extremes))
    return tuple(column[places] for column in columns)


def _extremes(y: Array, size: int) -> list[NDArray[np.intp]]:
    n_full = y.size // size * size
    bins, tail = y[:n_full].reshape(-1, size), y[n_full:]
    starts = np.arange(0, n_full, size)
    extremes = [starts + bins.argmin(axis=1), starts + bins.argmax(axis=1)]
    if tail.size:
        extremes.append(n_full + np.array([tail.argmin(), tail.argmax()]))
    return extremes
