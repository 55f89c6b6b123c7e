"""Pieces of a cross-validation: consecutive samples that errors are summed over, so that models pair."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.comparison.splits import Fold

PIECES = 8
"""Of every recording of a fold."""


def squares_of(errors: Array) -> list[tuple[float, ...]]:
    """Return the sums of squared errors (n, k) of consecutive pieces."""
    return [tuple((piece**2).sum(axis=0).tolist()) for piece in np.array_split(errors, PIECES)]


def counts_of(folds: Sequence[Fold]) -> list[int]:
    """Return how many samples every piece has, in the order of their squares."""
    tested = [int(rows.sum()) for fold in folds for rows in fold.test_rows]
    return [len(piece) for n in tested for piece in np.array_split(np.empty(n), PIECES)]
