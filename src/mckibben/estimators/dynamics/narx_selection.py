"""Forward orthogonal least squares: terms chosen one by one by how much of the output they explain.

Source: Chen, Billings and Luo, "Orthogonal least squares methods and their application to
non-linear system identification", 1989 (error reduction ratio).
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from mckibben.arrays import Array

Terms = tuple[tuple[int, ...], ...]

DEPENDENT = 1e-10
"""Share of a term left after taking the chosen ones out of it, below which it says nothing new."""


def candidate_terms(n_regressors: int, degree: int) -> Terms:
    """Return all products of up to ``degree`` regressors, the constant first.

    >>> candidate_terms(2, 2)
    ((), (0,), (1,), (0, 0), (0, 1), (1, 1))
    """
    return tuple(
        term
        for order in range(degree + 1)
        for term in combinations_with_replacement(range(n_regressors), order)
    )


def select(columns: Array, target: Array, most: int) -> list[int]:
    """Return columns in the order in which they explain the target, at most so many.

    Parameters
    ----------
    columns : array, shape (n, k)
        Candidates.
    target : array, shape (n,)
    most : int
        Columns to choose.
    """
    left = columns.copy()
    power = (columns**2).sum(axis=0)
    rest = target.copy()
    chosen: list[int] = []
    for _ in range(min(most, columns.shape[1])):
        size = (left**2).sum(axis=0)
        usable = size > DEPENDENT * np.maximum(power, 1e-300)
        usable[chosen] = False
        if not usable.any():
            break
        explained = np.where(usable, (left.T @ rest) ** 2 / np.where(usable, size, 1.0), -1.0)
        best = int(np.argmax(explained))
        direction = left[:, best] / np.sqrt(size[best])
        rest = rest - direction * (direction @ rest)
        left = left - np.outer(direction, direction @ left)
        chosen.append(best)
    return chosen
