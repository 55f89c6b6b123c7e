"""Checks of arguments common to all signals."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import DataError, require


def as_time(given: ArrayLike) -> Array:
    """Return times as an array; raise an error for invalid ones."""
    t = np.asarray(given, dtype=float)
    if t.ndim != 1 or t.size == 0 or not np.isfinite(t).all():
        raise DataError("time is not a row of finite numbers", remedy="give one time a sample")
    return t


def require_positive(name: str, value: float) -> None:
    """Raise an error for a number that is not positive."""
    require(0 < value < np.inf, name, value, "a positive number", DataError)


LARGEST_SEED = 2**64 - 1
"""Of 64 bits, as other tools have them."""


def require_finite(name: str, values: ArrayLike) -> Array:
    """Return numbers as an array; raise an error if one is not finite."""
    numbers = np.atleast_1d(np.asarray(values, dtype=float))
    require(bool(np.isfinite(numbers).all()), name, values, "finite numbers", DataError)
    return numbers


def require_order(low: float, high: float) -> None:
    """Raise an error for limits that are not finite, or not in order."""
    require(-np.inf < low < high < np.inf, "high", high, f"more than low, {low:g}", DataError)


def generator(seed: int) -> np.random.Generator:
    """Return a random number generator; raise an error for an invalid seed."""
    require(0 <= seed <= LARGEST_SEED, "seed", seed, f"0 to {LARGEST_SEED}", DataError)
    return np.random.default_rng(seed)
