"""Statistics of autocorrelated residuals.

Intervals and tests of time series count dependent samples by these functions. Pieces of a series
(one per recording) are pooled, and nothing crosses from one into the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.signals.checking import generator

RESAMPLES = 1000
"""Number of resamples of a bootstrap."""

UNCORRELATED = 0.05
"""Autocorrelation below which samples count as independent."""

MOST_TERMS = 40
"""Largest order of an autoregression of residuals."""

ANDREWS = 1.1447
"""Best block length over the cube root of (correlation length)² n / 4 (Andrews, 1991)."""

NORMAL_95 = 1.96
"""Standard deviations in which 95 % of a normal distribution lie."""


def correlation_length(series: Sequence[Array]) -> float:
    """Return the integral of the autocorrelation of a series, in samples: 1 for white noise.

    Parameters
    ----------
    series : sequence of array, shape (n,)
        Pieces; the mean of each is removed. A constant offset of a piece is no correlation.
    """
    pieces = [piece - piece.mean() for piece in series if piece.size]
    total = sum(float(piece @ piece) for piece in pieces)
    if total <= 0:
        return 1.0
    longest = max(piece.size for piece in pieces)
    size = 1 << (2 * longest - 1).bit_length()
    products, pairs = np.zeros(longest), np.zeros(longest)
    for piece in pieces:
        spectrum = np.fft.rfft(piece, size)
        products[: piece.size] += np.fft.irfft(spectrum * spectrum.conj(), size)[: piece.size]
        pairs[: piece.size] += np.arange(piece.size, 0, -1)
    count = sum(piece.size for piece in pieces)
    correlation = products / np.maximum(pairs, 1.0) / (total / count)
    low = np.flatnonzero(correlation < UNCORRELATED)
    end = int(low[0]) if low.size else longest
    return float(1.0 + 2.0 * correlation[1:end].clip(max=1.0).sum())


@dataclass(frozen=True, eq=False)
class Autoregression:
    """Residuals as a stable autoregression: e_t = a_1 e_{t-1} + ... + innovation.

    Parameters
    ----------
    coefficients : array, shape (order,)
    innovation : float
        Standard deviation of what is new in every sample.
    variance : float
        Of the residuals.
    """

    coefficients: Array
    innovation: float
    variance: float

    @property
    def _whitener(self) -> Array:
        return np.concatenate([[1.0], -self.coefficients])

    @property
    def long_run_variance(self) -> float:
        """Variance of the mean of n residuals, times n, for large n."""
        return float((self.innovation / self._whitener.sum()) ** 2)

    def whitened(self, series: Array) -> Array:
        """Return the innovations of a series (n, ...)."""
        found = np.array(series, dtype=np.float64)
        for lag, coefficient in enumerate(self.coefficients.tolist(), start=1):
            found[lag:] -= coefficient * series[:-lag]
        return found

    def coloured(self, slopes: Array) -> Array:
        """Return L' J, shape (n, k), whose product with itself is J' R J, R the covariance."""
        from scipy.linalg import solve_banded

        bands = np.tile(self._whitener[::-1, np.newaxis], len(slopes))
        return np.asarray(self.innovation * solve_banded((0, len(bands) - 1), bands, slopes))

    def effective_sample_size(self, n: int) -> float:
        """Return the number of independent samples that determine the mean as well as n of these."""
        if self.variance <= 0:
            return float(n)
        return float(np.clip(n / max(self.long_run_variance / self.variance, 1e-12), 1.0, n))


def autoregression(series: Sequence[Array]) -> Autoregression:
    """Return the autoregression of pieces of one series, each (n,), by Burg's method.

    Its order is chosen by BIC.
    """
    n = sum(map(len, series))
    variance = float(np.mean(np.concatenate(series) ** 2)) if n else 0.0
    forward: list[NDArray[np.float64]] = [np.asarray(piece, dtype=np.float64) for piece in series]
    backward = list(forward)
    best, chosen, power_of_best = n * np.log(max(variance, 1e-300)), np.zeros(0), variance
    a, power = np.zeros(0), variance
    for order in range(1, min(MOST_TERMS, n // 10) + 1):
        ahead = [f[1:] for f in forward]
        behind = [b[:-1] for b in backward]
        below = sum(float(f @ f + b @ b) for f, b in zip(ahead, behind, strict=True))
        if not below > 1e-300:
            break
        k = 2 * sum(float(f @ b) for f, b in zip(ahead, behind, strict=True)) / below
        forward = [f - k * b for f, b in zip(ahead, behind, strict=True)]
        backward = [b - k * f for f, b in zip(ahead, behind, strict=True)]
        a = np.append(a - k * a[::-1], k)
        power *= 1 - k * k
        if not power > 1e-300:
            break
        cost = n * np.log(power) + order * np.log(n)
        if cost < best:
            best, chosen, power_of_best = cost, a, power
    return Autoregression(chosen, float(np.sqrt(max(power_of_best, 0.0))), variance)


def hats(x: Array, n_knots: int) -> Array:
    """Return piecewise-linear basis functions of samples (n,), with equal numbers between knots.

    Their sum is 1, shape (n, knots).
    """
    knots = np.unique(np.quantile(x, np.linspace(0, 1, n_knots)))
    return np.column_stack([np.interp(x, knots, row) for row in np.eye(knots.size)])


def dependence(columns: Array) -> Array:
    """Return the R² of each column (n, k) regressed on the others, shape (k,)."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0, size, 1.0)
    gram = scaled.T @ scaled + 1e-9 * np.eye(size.size)
    inflation = np.where(size > 0, np.diag(np.linalg.pinv(gram)), 1.0)
    return np.asarray(1.0 - 1.0 / np.maximum(inflation, 1.0))


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
        rng = generator(seed)
        self._parts: list[tuple[int, int, int, NDArray[np.intp]]] = []
        offset, n_blocks = 0, 0.0
        for n in lengths:
            block = block_length(n, correlation)
            starts = rng.integers(0, n, (RESAMPLES, int(np.ceil(n / block))))
            self._parts.append((offset, n, block, starts))
            offset += n
            n_blocks += n / block
        freedom = max(n_blocks - 1, 1.0)
        from scipy.special import stdtrit  # which takes a fifth of a second to import

        student = float(stdtrit(freedom, 0.975)) / NORMAL_95
        self._wider = student * float(np.sqrt(n_blocks / freedom))

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


def interval(samples: Array) -> tuple[float, float]:
    """Return the central 95 % of resampled values."""
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(low), float(high)


def differences(samples: Array, values: Array, chosen: int) -> list[tuple[float, float]]:
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
    apart, found = samples - samples[chosen], values - values[chosen]
    deviation = apart.std(axis=1)
    varies = deviation > 1e-12 * np.abs(values)
    multiple = 0.0
    if varies.any():
        strayed = np.abs(apart[varies] - apart[varies].mean(axis=1, keepdims=True))
        largest = (strayed / deviation[varies, np.newaxis]).max(axis=0)
        multiple = float(np.quantile(largest, 0.95))
    half = multiple * deviation
    return [(float(d - h), float(d + h)) for d, h in zip(found, half, strict=True)]
