"""Linear least squares within bounds and linear inequalities, by non-negative least squares.

Source: Lawson and Hanson, "Solving Least Squares Problems", 1974, chapter 23.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.errors import ModelError

CONSTANT = 1e-13
"""Variation of a column, relative to its mean, below which it is constant to rounding."""

FEASIBLE = 1e-9
"""Residual of the dual problem below which no point satisfies all inequalities."""

LEAST_EFFECT = 0.01
"""Effect of a coefficient, relative to that in others of a stack, that its ridge is of at least."""


def solve_bounded(
    columns: Array, target: Array, least: Array | None = None, *, with_offset: bool = True
) -> tuple[Array, float]:
    """Solve ``columns @ x + offset = target`` in least squares.

    Columns are centred, which solves for the offset exactly, then reduced by an orthogonal (QR)
    factorisation; normal equations would square the condition of neighbouring operators.

    Parameters
    ----------
    columns : array, shape (n, m)
    target : array, shape (n,)
    least : array, shape (m,), optional
        The least that every x may be; minus infinity where it may have either sign. Default: all may.
    with_offset : bool
        Whether the offset is free, or 0.

    Returns
    -------
    x : array, shape (m,)
    offset : float
    """
    from scipy.optimize import nnls

    m = columns.shape[1]
    means, mean = np.zeros(m), 0.0
    if with_offset:
        means, mean = columns.mean(axis=0), float(target.mean())
    triangle: Array = np.linalg.qr(np.column_stack([columns - means, target - mean]), mode="r")  # type: ignore[assignment]
    scale = _sizes(triangle[:, :m])
    scaled, right = triangle[:, :m] / scale, triangle[:, m]
    scaled[:, scale <= CONSTANT * np.sqrt(len(columns)) * np.abs(means)] = 0.0
    if least is None:
        x = np.linalg.lstsq(scaled, right, rcond=1e-12)[0] / scale
    else:
        either = np.isneginf(least)  # of either sign: the difference of two that are not negative
        floor = np.where(either, 0.0, least)
        signed = np.hstack([scaled, -scaled[:, either]])
        solution = nnls(signed, right - triangle[:, :m] @ floor, maxiter=30 * signed.shape[1])[0]
        solution[:m][either] -= solution[m:]
        x = floor + solution[:m] / scale
    return x, mean - float(means @ x)


def solve_products(
    products: Array,
    width: int,
    ridge: float | Array,
    *,
    effects: Array | None = None,
    bounded: Mask | None = None,
) -> Array:
    """Return damped least squares from products of columns and targets, of all in a stack.

    With the bounded columns last, the last rows of the Cholesky factor are what those are solved from.

    Parameters
    ----------
    products : array, shape (k, width + m, width + m)
        Of the columns, and of the m targets behind them; those of the targets are not needed.
    width : int
        Number of columns.
    ridge : float or array, shape (width,)
        Damping by each coefficient's own effect, so that units do not matter.
    effects : array, shape (width,), optional
        Sums of squares of the columns by which the ridge is measured; default those of every member of
        the stack.
    bounded : array of bool, shape (width,), optional
        Which coefficients are non-negative; default none.

    Returns
    -------
    array, shape (k, width, m)
    """
    from scipy.optimize import nnls

    bounded = np.zeros(width, dtype=bool) if bounded is None else bounded
    order, first = np.argsort(bounded, kind="stable"), width - np.count_nonzero(bounded)
    effects_ = np.diagonal(products, axis1=1, axis2=2)[:, :width] if effects is None else effects
    effects_ = np.maximum(np.broadcast_to(effects_, (len(products), width)), 0.0)
    size = np.sqrt(effects_[:, order, np.newaxis])
    size = np.maximum(size, LEAST_EFFECT * size.max(axis=0))
    size[~(size > 0.0)] = 1.0
    damping = np.broadcast_to(ridge, width)[order]
    a = products[:, order][:, :, order] / (size * size.transpose(0, 2, 1)) + np.diag(damping)
    b = products[:, order, width:] / size
    if first == width:
        return np.asarray(np.linalg.solve(a, b) / size)
    lower = np.linalg.cholesky(a)
    upper = lower.transpose(0, 2, 1)
    solution = np.linalg.solve(lower, b)
    for one, root in zip(solution, upper, strict=True):
        for x in one.T:
            x[first:] = nnls(root[first:, first:], x[first:], maxiter=100 * width)[0]
    back = solution[:, :first] - upper[:, :first, first:] @ solution[:, first:]
    solution[:, :first] = np.linalg.solve(upper[:, :first, :first], back)
    return np.asarray((solution / size)[:, np.argsort(order)])


def solve_constrained(
    columns: Array,
    target: Array,
    sides: Array,
    least: Array,
    *,
    ridge: float = 0.0,
    near: Array | None = None,
) -> Array:
    """Return x with the least |columns x - target| of those with sides x >= least.

    By least-distance programming.

    Parameters
    ----------
    columns : array, shape (n, p)
        Of full column rank, unless there is a ridge.
    target : array, shape (n,)
    sides, least : arrays, shapes (m, p) and (m,)
        Sides that are 0 ask for nothing.
    ridge : float
        Damping by each coefficient's own effect.
    near : array, shape (p,), optional
        Towards what coefficients are damped; default 0.

    Returns
    -------
    array, shape (p,)

    Raises
    ------
    ModelError
        If no x satisfies all inequalities.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    p, asks = columns.shape[1], sides.any(axis=1)
    size = _sizes(columns)
    damping = np.sqrt(ridge) * np.eye(p)
    right = np.append(target, np.zeros(p) if near is None else damping @ (size * near))
    table = np.column_stack([np.vstack([columns / size, damping]), right])
    triangle: Array = np.linalg.qr(table, mode="r")  # type: ignore[assignment]
    upper, right = triangle[:p, :p], triangle[:p, p]
    sides, least = sides[asks] / size, least[asks]
    turned = solve_triangular(upper, sides.T, trans="T").T
    lengths = _sizes(turned.T)
    turned = turned / lengths[:, np.newaxis]
    lacking = least / lengths - turned @ right
    if (lacking <= 0).all():
        return np.asarray(solve_triangular(upper, right) / size)
    unit = float(np.abs(lacking).max())
    dual = np.vstack([turned.T, lacking / unit])
    goal = np.zeros(p + 1)
    goal[p] = 1.0
    pressed, distance = nnls(dual, goal, maxiter=100 * len(sides))
    residual = goal - dual @ pressed
    if distance < FEASIBLE or not residual[p] > 0:
        raise ModelError(
            "no parameters satisfy all that physics asks of them",
            remedy="give recordings of a wider range",
        )
    x: Array = solve_triangular(upper, right - residual[:p] / residual[p] * unit)
    bounds = np.flatnonzero((np.count_nonzero(sides, axis=1) == 1) & (pressed > 0))
    bounded = np.abs(sides[bounds]).argmax(axis=1)
    x[bounded] = least[bounds] / sides[bounds, bounded]  # to the bit: 0, where rounding left 1e-17
    return x / size


def _sizes(columns: Array) -> Array:
    """Return the lengths of columns to divide by, 1 of a column of zeros."""
    size = np.sqrt((columns**2).sum(axis=0))
    return np.where(size > 0.0, size, 1.0)
