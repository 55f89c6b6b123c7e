"""Memoryless output maps of hysteresis models, as sums of increasing pieces.

With non-negative weights on increasing pieces the map increases, whatever the data, so it has an
inverse.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel, vector
from mckibben.blocks.memoryless import PiecewiseLinear, Polynomial


class OutputMap(ABC):
    """A family of maps of an argument that runs from 0 to 1.

    Parameters
    ----------
    size : int
        Pieces: the degree of a polynomial, or the number of straight lines.
    """

    def __init__(self, size: int) -> None:
        self.size = size

    @abstractmethod
    def pieces(self, x: Array) -> Array:
        """Return the pieces at arguments of shape (n,), side by side, shape (n, k)."""

    @abstractmethod
    def slopes(self, x: Array) -> Array:
        """Return the derivatives of the pieces by the argument, shape (n, k)."""

    @abstractmethod
    def build(
        self, weights: Array, offset: float, low: float, high: float, channel: Channel
    ) -> Block:
        """Return the block whose argument runs from ``low`` to ``high``."""


class PiecewiseLinearMap(OutputMap):
    """Piecewise-linear map with equally spaced knots: a superposition of dead zones."""

    def pieces(self, x: Array) -> Array:
        """Return a ramp per piece; the first and last are extrapolated."""
        ramps = x[:, np.newaxis] * self.size - np.arange(self.size)
        lowest, highest = np.zeros(self.size), np.ones(self.size)
        lowest[0], highest[-1] = -np.inf, np.inf
        return np.clip(ramps, lowest, highest)

    def slopes(self, x: Array) -> Array:
        """Return the number of pieces on the piece of the argument, and 0 on the others."""
        line = np.clip(np.floor(x * self.size), 0, self.size - 1)
        return self.size * (line[:, np.newaxis] == np.arange(self.size)).astype(np.float64)

    def build(
        self, weights: Array, offset: float, low: float, high: float, channel: Channel
    ) -> Block:
        knots = np.linspace(low, high, self.size + 1)
        values = offset + np.concatenate([[0.0], np.cumsum(weights)])
        return PiecewiseLinear(vector(knots), vector(values), channel, channel)


class PolynomialMap(OutputMap):
    """Integrals of Bernstein polynomials: non-negative weights make the polynomial increase."""

    def pieces(self, x: Array) -> Array:
        """Return the integral from 0 of every Bernstein polynomial of degree ``size - 1``."""
        return np.asarray(np.vander(x, self.size + 1, increasing=True) @ bernstein(self.size).T)

    def slopes(self, x: Array) -> Array:
        """Return every Bernstein polynomial."""
        derivatives = bernstein(self.size)[:, 1:] * np.arange(1, self.size + 1)
        return np.asarray(np.vander(x, self.size, increasing=True) @ derivatives.T)

    def powers(self, weights: Array) -> Array:
        """Return the weighted sum of the pieces in ascending powers, shape (size + 1,)."""
        return np.asarray(weights @ bernstein(self.size))

    def build(
        self, weights: Array, offset: float, low: float, high: float, channel: Channel
    ) -> Block:
        """Return the polynomial block, in powers of the centred argument for numerical accuracy."""
        polynomial = np.polynomial.Polynomial(self.powers(weights))
        centred = polynomial(np.polynomial.Polynomial([0.5, 0.5])).coef
        centred = np.pad(centred, (0, self.size + 1 - centred.size))
        centred[0] += offset
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return Polynomial(vector(centred), middle, half, (low, high), channel, channel)


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


class FreePolynomialMap(OutputMap):
    """Powers of the centred argument, all of them or odd ones only, as the papers use them.

    Nothing keeps such a polynomial increasing, so it may have no inverse.

    Parameters
    ----------
    size : int
        Degree.
    odd : bool
        Whether only odd powers are used.
    """

    def __init__(self, size: int, *, odd: bool = False) -> None:
        super().__init__(size)
        self.exponents = np.arange(1, size + 1, 2 if odd else 1)

    def pieces(self, x: Array) -> Array:
        return np.asarray((2 * x - 1)[:, np.newaxis] ** self.exponents)

    def slopes(self, x: Array) -> Array:
        return np.asarray(2 * self.exponents * (2 * x - 1)[:, np.newaxis] ** (self.exponents - 1))

    def build(
        self, weights: Array, offset: float, low: float, high: float, channel: Channel
    ) -> Block:
        polynomial = np.zeros(int(self.exponents[-1]) + 1)
        polynomial[self.exponents] = weights
        polynomial[0] = offset
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return Polynomial(vector(polynomial), middle, half, (low, high), channel, channel)


MAPS: dict[str, Callable[[int], OutputMap]] = {
    "piecewise-linear": PiecewiseLinearMap,
    "polynomial": PolynomialMap,
    "free-polynomial": FreePolynomialMap,
    "odd-polynomial": partial(FreePolynomialMap, odd=True),
}
