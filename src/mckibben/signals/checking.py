"""What every signal asks of its arguments."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import DataError


def as_time(given: ArrayLike) -> Array:
    """Return times as an array, or say what is wrong with them."""
    t = np.asarray(given, dtype=float)
    if t.ndim != 1 or t.size == 0 or not np.isfinite(t).all():
        raise DataError("time is not a row of finite numbers", remedy="give one time a sample")
    return t


def require_positive(name: str, value: float) -> None:
    """Refuse what is not a positive number."""
    if not 0 < value < np.inf:
        raise DataError(f"{name} is {value}", remedy="give a positive number")


LARGEST_SEED = 2**64 - 1
"""Of 64 bits, as other tools have them."""


def require_finite(name: str, values: ArrayLike) -> Array:
    """Return numbers as an array, or refuse those that are not finite."""
    numbers = np.atleast_1d(np.asarray(values, dtype=float))
    if not np.isfinite(numbers).all():
        raise DataError(f"{name} is {values!r}", remedy="give finite numbers")
    return numbers


def require_order(low: float, high: float) -> None:
    """Refuse limits that are not finite, or not in order."""
    if not -np.inf < low < high < np.inf:
        raise DataError(f"high {high} is not above low {low}", remedy="give low < high")


def generator(seed: int) -> np.random.Generator:
    """Return what draws random numbers, or say that the seed is impossible."""
    if not 0 <= seed <= LARGEST_SEED:
        raise DataError(
            f"seed {seed} is {'negative' if seed < 0 else 'too large'}",
            remedy=f"give 0 to {LARGEST_SEED}",
        )
    return np.random.default_rng(seed)
