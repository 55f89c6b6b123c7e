"""Straight lines between knots: what the piecewise-linear block and envelope share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.kernels import kernel
from mckibben.errors import ModelError


@kernel
def interpolate(x: float, knots: Array, values: Array) -> float:
    """Return the piecewise-linear function at ``x``; the end pieces continue beyond the knots."""
    low = 0
    high = knots.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x < knots[middle]:
            high = middle
        else:
            low = middle
    slope = (values[high] - values[low]) / (knots[high] - knots[low])
    if x - knots[low] < knots[high] - x:
        return values[low] + slope * (x - knots[low])
    return values[high] - slope * (knots[high] - x)


def check_increasing(what: str, knots: Sequence[float], values: Sequence[float]) -> None:
    """Refuse fewer than two knots, and knots or values that do not increase."""
    if len(knots) < 2 or len(knots) != len(values):
        raise ModelError(
            f"a {what} has {len(knots)} knots and {len(values)} values. "
            "Remedy: give at least two knots and one value to each."
        )
    for name, numbers in (("knots", knots), ("values", values)):
        if np.any(np.diff(numbers) <= 0):
            raise ModelError(
                f"the {name} of a {what} do not increase. Remedy: give increasing {name}."
            )
