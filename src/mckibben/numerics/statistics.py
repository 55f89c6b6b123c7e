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

UNCORRELATED = 0.05
"""Autocorrelation below which samples count as independent."""

MOST_TERMS = 40
"""Largest order of an autoregression of residuals."""

NORMAL_95 = 1.96
"""Standard deviations in which 95 % of a normal distribution lie."""


def rms(errors: Array) -> float:
    """Return the root mean square, infinite if that of an error is not finite."""
    size = float(np.sqrt(np.mean(errors**2)))
    return size if np.isfinite(size) else np.inf


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
        white = np.array(series, dtype=np.float64)
        for lag, coefficient in enumerate(self.coefficients.tolist(), start=1):
            white[lag:] -= coefficient * series[:-lag]
        return white

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
    best, best_a, power_of_best = n * np.log(max(variance, 1e-300)), np.zeros(0), variance
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
            best, best_a, power_of_best = cost, a, power
    return Autoregression(best_a, float(np.sqrt(max(power_of_best, 0.0))), variance)


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


def student(freedom: float, level: float = 0.95) -> float:
    """Return half the width of the central interval of Student's t, in standard deviations."""
    from scipy.special import stdtrit  # which takes a fifth of a second to import

    return float(stdtrit(freedom, 0.5 + level / 2))


def half_interval(values: Array, level: float) -> float:
    """Return half the width of the interval of the mean of independent values, by Student's t."""
    return student(values.size - 1, level) * float(values.std(ddof=1) / np.sqrt(values.size))
