"""Linear least squares."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array

CONSTANT = 1e-13
"""Variation of a column, relative to its mean, below which it is constant to rounding."""


def solve_linear(
    basis: Array,
    target: Array,
    *,
    nonnegative: bool,
    least: Array | None = None,
    with_offset: bool = True,
) -> tuple[Array, float]:
    """Solve ``basis @ x + offset = target`` in least squares.

    Columns are centred, which solves for the offset exactly, then reduced by an orthogonal (QR)
    factorisation; normal equations would square the condition of neighbouring operators.

    Parameters
    ----------
    basis : array, shape (n, m)
    target : array, shape (n,)
    nonnegative : bool
        Whether every x must be at least 0.
    least : array, shape (m,), optional
        Then the least that every x may be, instead; minus infinity where it may have either sign.
    with_offset : bool
        Whether the offset is free, or 0.

    Returns
    -------
    x : array, shape (m,)
    offset : float
    """
    from scipy.optimize import nnls

    m = basis.shape[1]
    means, mean = np.zeros(m), 0.0
    if with_offset:
        means, mean = basis.mean(axis=0), float(target.mean())
    triangle: Array = np.linalg.qr(np.column_stack([basis - means, target - mean]), mode="r")  # type: ignore[assignment]
    scale = np.maximum(np.sqrt((triangle[:, :m] ** 2).sum(axis=0)), 1e-300)
    scaled, right = triangle[:, :m] / scale, triangle[:, m]
    scaled[:, scale <= CONSTANT * np.sqrt(len(basis)) * np.abs(means)] = 0.0
    if nonnegative:
        floor = np.zeros(m) if least is None else least
        either = np.isneginf(floor)  # of either sign: the difference of two that are not negative
        floor = np.where(either, 0.0, floor)
        both = np.hstack([scaled, -scaled[:, either]])
        found = nnls(both, right - triangle[:, :m] @ floor, maxiter=30 * both.shape[1])[0]
        found[:m][either] -= found[m:]
        x = floor + found[:m] / scale
    else:
        x = np.linalg.lstsq(scaled, right, rcond=1e-12)[0] / scale
    return x, mean - float(means @ x)
