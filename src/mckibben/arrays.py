"""The array type of the package, and the narrowest range of a channel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mckibben.errors import DataError

Array = NDArray[np.float64]
"""Double-precision numbers, of any shape."""

Rows = NDArray[np.intp]
"""Numbers of rows or samples."""

Mask = NDArray[np.bool_]
"""Which of some samples are meant."""

NARROWEST = 1e-30
"""Smallest range of a channel, in its unit; products of smaller ranges would underflow."""


def check_finite(
    values: Array, remedy: str = "leave those samples out", channel: str | None = None
) -> None:
    """Raise an error if a sample is not finite, naming the first.

    Raises
    ------
    DataError
        If one is infinite or no number.
    """
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise DataError(
            f"the value is {values[bad[0]]}, and {bad.size} of {values.size} are not finite",
            channel=channel,
            row=int(bad[0]) + 1,
            remedy=remedy,
        )


def true_runs(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the first of each run of true values and the first after it, shape (m, 2).

    >>> true_runs(np.array([True, False, True, True])).tolist()
    [[0, 1], [2, 4]]
    """
    return np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
