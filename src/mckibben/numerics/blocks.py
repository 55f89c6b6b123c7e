"""Blocks of successive samples, which are about independent: left out in turn, and drawn again.

A fit to all blocks but some is a fit to the sum of the others' products, so nothing is simulated twice.
Samples that follow one another are alike, and prove nothing about each other; whole blocks do.

Source: Burman, Chow and Nolan, "A cross-validatory method for dependent data", Biometrika, 1994.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.numerics.statistics import NORMAL_95, student

RESAMPLES = 1000
"""Number of resamples of a bootstrap."""

ANDREWS = 1.1447
"""Best block length over the cube root of (correlation length)² n / 4 (Andrews, 1991)."""


def blocks_of(pieces: Sequence[Array], count: int) -> list[list[Array]]:
    """Return the blocks of every piece of a series: at least one, and of all about ``count``."""
    total = sum(len(piece) for piece in pieces)
    return [np.array_split(piece, max(1, round(count * len(piece) / total))) for piece in pieces]


def sums_of_others(products: Array, folds: NDArray[np.intp]) -> Array:
    """Return the products, (blocks, ...), summed over all folds but one, shape (folds, ...)."""
    return np.array([products[folds != fold].sum(axis=0) for fold in range(int(folds.max()) + 1)])


def squared_errors(products: Array, weights: Array) -> Array:
    """Return the sums of squared errors of blocks, shape (blocks, m).

    Parameters
    ----------
    products : array, shape (blocks, width + m, width + m)
        Of columns, and of the m targets behind them.
    weights : array, shape (blocks, width, m)
        Of the columns, found without the block.
    """
    m = weights.shape[2]
    targets = np.broadcast_to(-np.eye(m), (len(weights), m, m))
    columns = np.concatenate([weights, targets], axis=1)
    return np.asarray((columns * (products @ columns)).sum(axis=1))


def block_length(n: int, correlation: float = 1.0) -> int:
    """Return the block length of a moving-block bootstrap of n samples.

    That which is best for an autoregression of such a correlation length (Andrews, Econometrica 59,
    1991), rounded up to doublings of the square root of n, and at most half of n.
    """
    doublings = 0
    if n > 1:
        best = ANDREWS * (correlation**2 * n / 4) ** (1 / 3)
        doublings = max(int(np.ceil(np.log2(best / np.sqrt(n)))), 0)
    return min(max(int(np.ceil(np.sqrt(n))), 1) << doublings, max(n // 2, 1))


class BlockBootstrap:
    """Circular moving-block bootstrap, with common resamples for all models (paired).

    Where there are few blocks, resamples are spread as Student's t is wider than a normal distribution.

    Parameters
    ----------
    lengths : sequence of int
        Scored samples of every test recording; blocks never cross from one into the next.
    seed : int
        Of the resampling.
    correlation : float
        Correlation length of the squared errors, in samples.
    """

    def __init__(self, lengths: Sequence[int], seed: int, correlation: float = 1.0) -> None:
        rng = np.random.default_rng(seed)
        self._parts: list[tuple[int, int, int, NDArray[np.intp]]] = []
        offset, n_blocks = 0, 0.0
        for n in lengths:
            block = block_length(n, correlation)
            starts = rng.integers(0, n, (RESAMPLES, int(np.ceil(n / block))))
            self._parts.append((offset, n, block, starts))
            offset += n
            n_blocks += n / block
        freedom = max(n_blocks - 1, 1.0)
        self._wider = student(freedom) / NORMAL_95 * float(np.sqrt(n_blocks / freedom))

    def rmse(self, errors: Array) -> Array:
        """Return the RMSE of every resample, shape (RESAMPLES,); of several outputs their mean.

        Parameters
        ----------
        errors : array, shape (sum of lengths,) or (sum of lengths, k)
            Errors of one model at all scored samples.
        """
        if errors.ndim == 2:
            result: Array = np.mean([self.rmse(column) for column in errors.T], axis=0)
            return result
        total, count = np.zeros(RESAMPLES), 0
        for offset, n, block, starts in self._parts:
            around = np.resize(errors[offset : offset + n] ** 2, n + block)
            squares = np.concatenate([[0.0], np.cumsum(around)])
            total += n * (squares[starts + block] - squares[starts]).mean(axis=1) / block
            count += n
        result = np.sqrt(total / count)
        middle = result.mean()
        return np.maximum(middle + self._wider * (result - middle), 0.0)


def interval(samples: Array) -> tuple[float, float]:
    """Return the central 95 % of resampled values."""
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(low), float(high)


def difference_intervals(samples: Array, values: Array, chosen: int) -> list[tuple[float, float]]:
    """Return simultaneous 95 % intervals of the differences of values to a chosen one.

    Half widths are one multiple of each difference's standard deviation (single-step max-t).

    Parameters
    ----------
    samples : array, shape (k, RESAMPLES)
        Resampled figures of k models, on the same blocks.
    values : array, shape (k,)
        The figures.
    chosen : int
        Index of the model that all are compared with; its own interval is 0 to 0.
    """
    differences, best_differences = samples - samples[chosen], values - values[chosen]
    deviation = differences.std(axis=1)
    varies = deviation > 1e-12 * np.abs(values)
    multiple = 0.0
    if varies.any():
        strayed = np.abs(differences[varies] - differences[varies].mean(axis=1, keepdims=True))
        largest = (strayed / deviation[varies, np.newaxis]).max(axis=0)
        multiple = float(np.quantile(largest, 0.95))
    half = multiple * deviation
    return [(float(d - h), float(d + h)) for d, h in zip(best_differences, half, strict=True)]
