"""A static map from inputs to outputs: what every model with memory has to beat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.comparison.splits import Split
from mckibben.recording import Recording

LARGEST_DEGREE, MOST_TERMS = 5, 60
"""Of the polynomial."""

RIDGE = 1e-9
"""Of the least squares, relative to the largest diagonal element."""


def static_error(split: Split, inputs: Sequence[str], outputs: Sequence[str]) -> float:
    """Return the error on the test of a polynomial of the inputs, mean RMSE over outputs.

    The polynomial is fitted to the training recordings by least squares, and has the largest degree up
    to 5 with at most 60 terms. Inputs beyond those fitted count as the nearest one.
    """
    train = [recording.with_derived((*inputs, *outputs)) for recording in split.train]
    test = [recording.with_derived((*inputs, *outputs)) for recording in split.test]
    known = [name for name in inputs if all(name in one for one in (*train, *test))]
    kept = [~recording.bridged for recording in train]

    fitted = _joined(train, kept, known)
    terms = polynomial(fitted)
    given = terms(fitted)
    gram = given.T @ given
    gram += RIDGE * gram.diagonal().max() * np.eye(len(gram))
    weights = np.linalg.solve(gram, given.T @ _joined(train, kept, outputs))
    errors = terms(_joined(test, split.test_rows, known)) @ weights
    errors -= _joined(test, split.test_rows, outputs)
    return float(np.sqrt((errors**2).mean(axis=0)).mean())


def polynomial(fitted: Array) -> Callable[[Array], Array]:
    """Return the function from values, (m, n), to the terms of a polynomial of them, (m, terms).

    Parameters
    ----------
    fitted : array, shape (k, n)
        Values beyond these count as the nearest one.
    """
    low, high = fitted.min(axis=0), fitted.max(axis=0)
    n = low.size
    fits = (d for d in range(LARGEST_DEGREE, 1, -1) if comb(n + d, d) <= MOST_TERMS)
    degree = next(fits, 1)
    factors = [
        list(places)
        for order in range(degree + 1)
        for places in combinations_with_replacement(range(n), order)
    ]

    def terms(values: Array) -> Array:
        scaled = (np.clip(values, low, high) - low) / np.where(high > low, high - low, 1.0) * 2 - 1
        return np.column_stack([scaled[:, places].prod(axis=1) for places in factors])

    return terms


def _joined(runs: Sequence[Recording], rows: Sequence[Mask], names: Sequence[str]) -> Array:
    pairs = zip(runs, rows, strict=True)
    return np.concatenate([run.matrix(names)[own] for run, own in pairs])
