"""Polynomial maps behind hysteresis operators, as sums of pieces on an argument from 0 to 1."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.fields import Channel, vector
from mckibben.blocks.memoryless import Polynomial

LEAST_PIECE = 1e-6
"""Smallest share of the output's range for a piece of an increasing map."""


class PolynomialMap:
    """Integrals of Bernstein polynomials: non-negative weights make the map increase.

    Parameters
    ----------
    size : int
        Degree.
    """

    def __init__(self, size: int) -> None:
        self.size = size

    def pieces(self, x: Array) -> Array:
        """Return the pieces at arguments, shape (n, k): integrals from 0 of Bernstein polynomials."""
        return np.asarray(np.vander(x, self.size + 1, increasing=True) @ bernstein(self.size).T)

    def slopes(self, x: Array) -> Array:
        """Return the derivatives of the pieces by the argument, shape (n, k)."""
        derivatives = bernstein(self.size)[:, 1:] * np.arange(1, self.size + 1)
        return np.asarray(np.vander(x, self.size, increasing=True) @ derivatives.T)

    def powers(self, weights: Array) -> Array:
        """Return the weighted sum of the pieces in ascending powers, shape (size + 1,)."""
        return np.asarray(weights @ bernstein(self.size))

    def centred(self, weights: Array) -> Array:
        """Return the weighted sum of the pieces in powers of an argument from -1 to 1."""
        return centred(self.powers(weights))

    def build(
        self, weights: Array, offset: float, low: float, high: float, channel: Channel
    ) -> Polynomial:
        """Return the block whose argument runs from ``low`` to ``high``."""
        powers = self.centred(weights)
        powers[0] += offset
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return Polynomial(vector(powers), middle, half, (low, high), channel, channel)


class FreePolynomialMap(PolynomialMap):
    """Powers of the centred argument, as the papers use them; the map may have no inverse."""

    def pieces(self, x: Array) -> Array:
        return np.asarray((2 * x - 1)[:, np.newaxis] ** np.arange(1, self.size + 1))

    def slopes(self, x: Array) -> Array:
        exponents = np.arange(1, self.size + 1)
        return np.asarray(2 * exponents * (2 * x - 1)[:, np.newaxis] ** (exponents - 1))

    def centred(self, weights: Array) -> Array:
        return np.append(0.0, weights)


def centred(powers: Array) -> Array:
    """Return a polynomial of an argument from 0 to 1 in powers of one from -1 to 1."""
    coefficients = np.polynomial.Polynomial(powers)(np.polynomial.Polynomial([0.5, 0.5])).coef
    return np.pad(coefficients, (0, powers.size - coefficients.size))


@lru_cache
def bernstein(size: int) -> Array:
    """Return the powers of the integrals of all Bernstein polynomials, shape (size, size + 1)."""
    from scipy.special import comb

    degree = size - 1
    powers = np.zeros((size, size + 1))
    for k in range(size):
        for j in range(degree - k + 1):
            share = comb(degree, k) * comb(degree - k, j) * (-1.0) ** j
            powers[k, k + j + 1] = share / (k + j + 1)
    powers.setflags(write=False)
    return powers


MAPS = {"polynomial": PolynomialMap, "free-polynomial": FreePolynomialMap}
