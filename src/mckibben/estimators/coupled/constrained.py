"""Least squares with linear inequalities, as least-distance programming by non-negative least squares.

Source: Lawson and Hanson, "Solving Least Squares Problems", 1974, chapter 23.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import ModelError

FEASIBLE = 1e-9
"""Residual of the dual problem below which no point satisfies all inequalities."""


def constrained_least_squares(
    slopes: Array, target: Array, sides: Array, least: Array
) -> tuple[Array, Array]:
    """Return x with the least |slopes x - target| of those with sides x >= least.

    Parameters
    ----------
    slopes : array, shape (n, p)
        Of full column rank: a ridge sees to that.
    target : array, shape (n,)
    sides, least : arrays, shapes (m, p) and (m,)

    Returns
    -------
    x : array, shape (p,)
    pressed : array, shape (m,)
        Multipliers: positive for inequalities that hold the solution back.

    Raises
    ------
    ModelError
        If no x satisfies all inequalities.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    p = slopes.shape[1]
    size = np.maximum(np.sqrt((slopes**2).sum(axis=0)), 1e-300)
    triangle: Array = np.linalg.qr(np.column_stack([slopes / size, target]), mode="r")  # type: ignore[assignment]
    upper, right = triangle[:p, :p], triangle[:p, p]
    free = solve_triangular(upper, right)
    if not len(sides):
        return free / size, np.zeros(0)
    turned = solve_triangular(upper, (sides / size).T, trans="T").T
    lengths = np.maximum(np.sqrt((turned**2).sum(axis=1)), 1e-300)
    turned = turned / lengths[:, np.newaxis]
    lacking = least / lengths - turned @ right
    if (lacking <= 0).all():
        return free / size, np.zeros(len(sides))
    unit = float(np.abs(lacking).max())
    dual = np.vstack([turned.T, lacking / unit])
    goal = np.zeros(p + 1)
    goal[p] = 1.0
    pressed, rest = nnls(dual, goal, maxiter=100 * len(sides))
    residual = goal - dual @ pressed
    if rest < FEASIBLE or not residual[p] > 0:
        raise ModelError(
            "no parameters satisfy all that physics asks of them",
            remedy="give recordings of a wider range",
        )
    shift = -residual[:p] / residual[p] * unit
    x = solve_triangular(upper, right + shift) / size
    bounds = np.flatnonzero((np.count_nonzero(sides, axis=1) == 1) & (pressed > 0))
    bounded = np.abs(sides[bounds]).argmax(axis=1)
    x[bounded] = least[bounds] / sides[bounds, bounded]  # to the bit: 0, where rounding left 1e-17
    return x, pressed / residual[p] * unit / lengths
