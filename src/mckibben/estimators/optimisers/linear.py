"""Parameters that a model is linear in, solved for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array

CONSTANT = 1e-13
"""Share of its mean below which what a column varies by is rounding, not to be fitted with."""


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
        if (either := np.isneginf(floor)).any():
            return _with_either(basis, target, floor, either, with_offset)
        x = floor + nnls(scaled, right - triangle[:, :m] @ floor, maxiter=30 * m)[0] / scale
    else:
        x = np.linalg.lstsq(scaled, right, rcond=1e-12)[0] / scale
    return x, mean - float(means @ x)


def _with_either(
    basis: Array, target: Array, least: Array, either: NDArray[np.bool_], with_offset: bool
) -> tuple[Array, float]:
    """Solve where some columns may have either sign: without what these take up, then for them."""
    from scipy.linalg import qr, solve_triangular

    offset = np.ones((len(basis), int(with_offset)))
    free, bound = np.column_stack([offset, basis[:, either]]), basis[:, ~either]
    scale = np.maximum(np.linalg.norm(free, axis=0), 1e-300)
    directions, triangle, order = qr(free / scale, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(triangle))
    rank = int(np.count_nonzero(sizes > 1e-12 * sizes[0]))
    directions, triangle, order = directions[:, :rank], triangle[:rank, :rank], order[:rank]

    def left(columns: Array) -> Array:
        return np.asarray(columns - directions @ (directions.T @ columns))

    x = np.empty(either.size)
    x[~either], _ = solve_linear(
        left(bound), left(target), nonnegative=True, least=least[~either], with_offset=False
    )
    found = np.zeros(scale.size)
    found[order] = solve_triangular(triangle, directions.T @ (target - bound @ x[~either]))
    found /= scale
    x[either] = found[int(with_offset) :]
    return x, float(found[0]) if with_offset else 0.0
