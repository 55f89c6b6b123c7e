"""Derivatives of smooth functions for tests, by central differences of eighth order."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.derivatives import WEIGHTS

Array = NDArray[np.float64]


def smooth_slopes(function: Callable[[Array], Any], at: Array, change: float = 1e-2) -> Array:
    """Return the derivatives by all arguments, the last axis; error about 1e-15 / change."""
    columns = []
    for way in change * np.eye(at.size):
        apart = [
            function(at + k * way) - function(at - k * way) for k in range(1, 1 + len(WEIGHTS))
        ]
        columns.append(np.tensordot(WEIGHTS, np.array(apart), 1) / change)
    return np.stack(columns, axis=-1)
