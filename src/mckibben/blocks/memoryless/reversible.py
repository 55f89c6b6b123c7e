"""The reversible part of hysteresis models: a polynomial of the centred and scaled input."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from annotated_types import MinLen

from mckibben.arrays import Array
from mckibben.blocks.fields import Coefficients
from mckibben.blocks.kernels import kernel

Reversible = Annotated[Coefficients, MinLen(1)]
"""Ascending coefficients of such a polynomial, as a field of a block."""


@kernel
def polynomial_at(x: float, coefficients: Array, first: int, size: int) -> float:
    """Return the polynomial whose ascending coefficients start at ``first``."""
    y = 0.0
    for k in range(first + size - 1, first - 1, -1):
        y = y * x + coefficients[k]
    return y


def least_slope(
    polynomial: Sequence[float], centre: float, scale: float, limits: tuple[float, float]
) -> float:
    """Return the least derivative by the input over a range of inputs."""
    slope = np.polynomial.Polynomial(polynomial).deriv()
    low, high = ((end - centre) / scale for end in limits)
    turns = np.asarray(slope.deriv().roots(), dtype=np.complex128)
    at = np.array([low, high, *turns.real[np.abs(turns.imag) < 1e-9].clip(low, high)])
    return float(np.min(slope(at))) / scale
