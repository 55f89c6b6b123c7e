"""Small linear systems, solved in place inside kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.kernels import kernel

Array = NDArray[np.float64]


@kernel
def eliminate(matrix: Array, right: Array) -> None:
    """Solve a small linear system in place, by elimination with pivots."""
    n = right.size
    for column in range(n):
        pivot = column
        for row in range(column + 1, n):
            if abs(matrix[row, column]) > abs(matrix[pivot, column]):
                pivot = row
        if pivot != column:
            for j in range(n):
                matrix[column, j], matrix[pivot, j] = matrix[pivot, j], matrix[column, j]
            right[column], right[pivot] = right[pivot], right[column]
        scale = matrix[column, column]
        if scale == 0.0:
            scale = 1e-300
        for row in range(column + 1, n):
            factor = matrix[row, column] / scale
            for j in range(column, n):
                matrix[row, j] -= factor * matrix[column, j]
            right[row] -= factor * right[column]
    for row in range(n - 1, -1, -1):
        for j in range(row + 1, n):
            right[row] -= matrix[row, j] * right[j]
        scale = matrix[row, row]
        right[row] /= scale if scale != 0.0 else 1e-300
