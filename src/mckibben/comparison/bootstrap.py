"""Moving-block bootstrap: intervals of errors whose samples depend on their neighbours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.signals.checking import generator

Array = NDArray[np.float64]

RESAMPLES = 1000


class BlockBootstrap:
    """Resamples of blocks of consecutive samples, the same for every model, so that they pair.

    Parameters
    ----------
    lengths : sequence of int
        Scored samples of every test recording; blocks never cross from one into the next.
    seed : int
        Of the resampling.
    """

    def __init__(self, lengths: Sequence[int], seed: int) -> None:
        rng = generator(seed)
        self._parts: list[tuple[int, int, int, NDArray[np.intp]]] = []
        offset = 0
        for n in lengths:
            block = max(int(np.ceil(np.sqrt(n))), 1)
            count = int(np.ceil(n / block))
            starts = rng.integers(0, n - block + 1, (RESAMPLES, count))
            self._parts.append((offset, n, block, starts))
            offset += n

    def rmse(self, errors: Array) -> Array:
        """Return the RMSE of every resample, shape (RESAMPLES,).

        Parameters
        ----------
        errors : array, shape (sum of lengths,)
            Errors of one model at all scored samples.
        """
        total, count = np.zeros(RESAMPLES), 0
        for offset, n, block, starts in self._parts:
            squares = np.concatenate([[0.0], np.cumsum(errors[offset : offset + n] ** 2)])
            total += (squares[starts + block] - squares[starts]).sum(axis=1)
            count += block * starts.shape[1]
        return np.sqrt(total / count)


def interval(samples: Array) -> tuple[float, float]:
    """Return the central 95 % of resampled figures."""
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(low), float(high)
