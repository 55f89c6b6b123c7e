"""Small linear systems, solved in place inside kernels, as in every step of Newton's method."""

from __future__ import annotations

from mckibben.arrays import Array
from mckibben.blocks.core.exportable import Cost
from mckibben.blocks.core.kernels import NOTHING, kernel

USUAL_NEWTON, MOST_NEWTON = 3, 60
"""Steps of Newton's method, on smooth references and at worst."""


def newton_cost(step: int) -> Cost:
    """Return the cost of a sample that is solved by Newton's method, of whose steps one is known."""
    return Cost(USUAL_NEWTON * step, MOST_NEWTON * step)


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
            scale = NOTHING
        for row in range(column + 1, n):
            factor = matrix[row, column] / scale
            for j in range(column, n):
                matrix[row, j] -= factor * matrix[column, j]
            right[row] -= factor * right[column]
    for row in range(n - 1, -1, -1):
        for j in range(row + 1, n):
            right[row] -= matrix[row, j] * right[j]
        scale = matrix[row, row]
        right[row] /= scale if scale != 0.0 else NOTHING
