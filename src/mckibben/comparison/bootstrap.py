"""Circular moving-block bootstrap: intervals of errors whose samples depend on their neighbours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from mckibben.arrays import Array
from mckibben.signals.checking import generator

RESAMPLES = 1000

BEST = 1.1447
"""Of the best length of blocks, over the cube root of what the autoregression says."""

GAUSS = 1.96
"""Deviations in which 95 % lie."""


class BlockBootstrap:
    """Resamples of blocks of consecutive samples, the same for every model, so that they pair.

    Blocks are as long as is best for an autoregression of that memory (Andrews, Econometrica 59, 1991),
    rounded up to doublings of the square root of the samples; they go on from the end of a recording at
    its start, so that its ends count as often as its middle (Politis and Romano's circular blocks).
    Where that leaves few blocks, resamples are spread as Student's t is wider than Gauss.

    Parameters
    ----------
    lengths : sequence of int
        Scored samples of every test recording; blocks never cross from one into the next.
    seed : int
        Of the resampling.
    memory : float
        Samples for which squared errors stay alike: 1 for white ones; see `doublings`.
    """

    def __init__(self, lengths: Sequence[int], seed: int, memory: float = 1.0) -> None:
        rng = generator(seed)
        self._parts: list[tuple[int, int, int, NDArray[np.intp]]] = []
        offset, n_blocks = 0, 0.0
        for n in lengths:
            block = max(int(np.ceil(np.sqrt(n))), 1) << doublings(n, memory)
            block = min(block, max(n // 2, 1))
            count = int(np.ceil(n / block))
            starts = rng.integers(0, n, (RESAMPLES, count))
            self._parts.append((offset, n, block, starts))
            offset += n
            n_blocks += n / block
        freedom = max(n_blocks - 1, 1.0)
        self._wider = float(stdtrit(freedom, 0.975) / GAUSS * np.sqrt(n_blocks / freedom))

    def rmse(self, errors: Array) -> Array:
        """Return the RMSE of every resample, shape (RESAMPLES,); of several outputs their mean.

        Parameters
        ----------
        errors : array, shape (sum of lengths,) or (sum of lengths, k)
            Errors of one model at all scored samples.
        """
        if errors.ndim == 2:
            found: Array = np.mean([self.rmse(column) for column in errors.T], axis=0)
            return found
        total, count = np.zeros(RESAMPLES), 0
        for offset, n, block, starts in self._parts:
            around = np.resize(errors[offset : offset + n] ** 2, n + block)
            squares = np.concatenate([[0.0], np.cumsum(around)])
            total += n * (squares[starts + block] - squares[starts]).mean(axis=1) / block
            count += n
        found = np.sqrt(total / count)
        middle = found.mean()
        return np.maximum(middle + self._wider * (found - middle), 0.0)


def doublings(n: int, memory: float) -> int:
    """Return how often blocks of the square root of n samples are doubled, for errors of a memory."""
    wanted = BEST * (memory**2 * n / 4) ** (1 / 3)
    return max(int(np.ceil(np.log2(wanted / np.sqrt(n)))), 0) if n > 1 else 0


def skill_of(squares: Sequence[float], constant: Sequence[float], seed: int) -> tuple[float, float]:
    """Return the share of a constant's squared error that a model removes, and its lower bound.

    The bound is what 99 % of resamples exceed. Blocks are resampled
    together for both, so that what is hard for the two does not count.

    Parameters
    ----------
    squares, constant : sequence of float
        Sums of squared errors of the model and of the constant on the same blocks.
    seed : int
        Of the resampling.
    """
    both = np.array([squares, constant])
    if not np.isfinite(both).all() or both[1].sum() == 0:
        return float("-inf"), float("-inf")
    drawn = np.random.default_rng(seed).integers(0, both.shape[1], (RESAMPLES, both.shape[1]))
    model, mean = both[:, drawn].sum(axis=2)
    left = model / np.maximum(mean, np.finfo(float).tiny)
    return float(1 - both[0].sum() / both[1].sum()), float(1 - np.quantile(left, 0.99))


def interval(samples: Array) -> tuple[float, float]:
    """Return the central 95 % of resampled figures."""
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(low), float(high)


def differences(samples: Array, values: Array, chosen: int) -> list[tuple[float, float]]:
    """Return intervals of the differences of figures to a chosen one, which hold all at once in 95 %.

    Their half widths are one multiple of each difference's own standard deviation, that which the
    largest of all deviations of a resample exceeds in 5 % (the method of single-step max-t).

    Parameters
    ----------
    samples : array, shape (k, RESAMPLES)
        Resampled figures of k models, on the same blocks.
    values : array, shape (k,)
        The figures.
    chosen : int
        Place of the one that all are compared with; its own interval is 0 to 0.
    """
    apart, found = samples - samples[chosen], values - values[chosen]
    deviation = apart.std(axis=1)
    told = deviation > 1e-12 * np.abs(values)
    multiple = 0.0
    if told.any():
        strayed = np.abs(apart[told] - apart[told].mean(axis=1, keepdims=True))
        largest = (strayed / deviation[told, np.newaxis]).max(axis=0)
        multiple = float(np.quantile(largest, 0.95))
    half = multiple * deviation
    return [(float(d - h), float(d + h)) for d, h in zip(found, half, strict=True)]
