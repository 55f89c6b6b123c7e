"""Residuals that remember, as an autoregression: how many terms, and what it makes of slopes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array

MOST_TERMS = 40
"""Of an autoregression of residuals."""


@dataclass(frozen=True, eq=False)
class Autoregression:
    """Residuals as an autoregression: e_t = a_1 e_{t-1} + ... + shock.

    Parameters
    ----------
    coefficients : array, shape (k,)
        a.
    shock : float
        Standard deviation of what is new in every sample.
    variance : float
        Of the residuals.
    """

    coefficients: Array
    shock: float
    variance: float

    @property
    def _whitener(self) -> Array:
        return np.concatenate([[1.0], -self.coefficients])

    def shocks(self, series: Array) -> Array:
        """Return what is new in every sample of a series."""
        from scipy.signal import lfilter

        return np.asarray(lfilter(self._whitener, [1.0], series))

    def tinted(self, slopes: Array) -> Array:
        """Return L' J, shape (n, k), of which the product with itself is J' R J."""
        from scipy.signal import lfilter

        back = lfilter([1.0], self._whitener, slopes[::-1], axis=0)[::-1]
        return np.asarray(self.shock * back)

    def worth(self, n: int) -> float:
        """Return how many independent samples tell as much of the mean as n of these."""
        if self.variance <= 0:
            return float(n)
        memory = (self.shock / float(self._whitener.sum())) ** 2 / self.variance
        return float(np.clip(n / max(memory, 1e-12), 1.0, n))


def autoregression(series: Sequence[Array]) -> Autoregression:
    """Return the autoregression of pieces of one series, of as many terms as BIC asks for.

    By Burg's method, which is always stable.

    Parameters
    ----------
    series : sequence of array, shape (n,)
    """
    n = sum(map(len, series))
    variance = float(np.mean(np.concatenate(series) ** 2)) if n else 0.0
    forward: list[NDArray[np.float64]] = [np.asarray(e, dtype=np.float64) for e in series]
    backward = list(forward)
    best, chosen, shock = n * np.log(max(variance, 1e-300)), np.zeros(0), variance
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
            best, chosen, shock = cost, a, power
    return Autoregression(chosen, float(np.sqrt(max(shock, 0.0))), variance)
