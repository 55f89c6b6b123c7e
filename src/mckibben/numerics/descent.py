"""Nonlinear least squares: a trust region, and Levenberg-Marquardt with steps within constraints.

The trust region is SciPy's; simple bounds are its only constraints.

Source: Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import ModelError
from mckibben.numerics.statistics import rms

Errors = Callable[[Array], tuple[Array, Callable[[], Array]]]
"""From parameters, shape (p,), to errors, shape (n,), and a function to their derivatives there, shape
(n, p). That is called for points from which a search goes on, right after their errors.
"""

MARGIN = 1e-9
"""Smallest distance of a start from the bounds, relative to their width."""

SHORTEST = 1e-9
"""Step, relative to the parameters, that counts as zero."""

MOST_TRIES, HEAVIER, LIGHTER = 7, 10.0, 0.2
"""Number of dampings tried per step; factors on it where errors do not fall, and where they do."""

FIRST_DAMPING, RAISED, LIGHTEST = 1e-3, 1e-9, 1e-14
"""Damping of the first step, the smallest after a step that failed, and the smallest."""

SLOW_GAIN, MOST_SLOW_STEPS = 1e-3, 2
"""Relative gain of a slow step, and number of slow steps that end a descent."""


def trust_region(
    errors: Errors,
    start: Array,
    *,
    least_gain: float,
    max_evaluations: int,
    scale: Array | None = None,
    bounds: tuple[Array, Array] | None = None,
) -> list[tuple[Array, float]]:
    """Return the start, then the points of decreasing cost of the search.

    Parameters
    ----------
    errors : callable
        A step to errors that are not finite is refused.
    start : array, shape (p,)
    least_gain : float
        Share of the sum of squares that a step has to gain for another to follow.
    max_evaluations : int
        Of the errors.
    scale : array, shape (p,), optional
        How far each parameter may move at first; within bounds it is their width. Default: by the sizes
        of the derivatives.
    bounds : (array, array), shapes (p,), optional
        Of the parameters.

    Returns
    -------
    list of (array of shape (p,), float)
        Parameters and their sums of squares: the start alone where its errors are zero or not finite.
    """
    from scipy.optimize import least_squares

    # relative errors of relative parameters, so that nothing depends on a unit
    origin, limits = np.zeros(start.size), (-np.inf, np.inf)
    sizes = np.ones(start.size) if scale is None else scale
    if bounds is not None:
        origin, sizes, limits = bounds[0], bounds[1] - bounds[0], (0.0, 1.0)
        start = origin + sizes * np.clip((start - origin) / sizes, MARGIN, 1.0 - MARGIN)
    last = errors(start)
    first = float(last[0] @ last[0])
    if not 0.0 < first < np.inf:
        return [(start, first)]
    unit, is_current = np.sqrt(first / last[0].size), True
    path: list[tuple[Array, float]] = []

    def errors_at(z: Array) -> Array:
        nonlocal last, is_current
        if not is_current:
            last = errors(origin + sizes * z)
        is_current = False
        return last[0] / unit

    def slopes_at(z: Array) -> Array:  # called at the start and after every step that is taken
        path.append((origin + sizes * z if path else start, float(last[0] @ last[0])))
        return last[1]() * sizes / unit

    least_squares(
        errors_at,
        (start - origin) / sizes,
        slopes_at,
        bounds=limits,
        x_scale="jac" if bounds is None and scale is None else 1.0,
        ftol=least_gain,
        xtol=SHORTEST,
        gtol=None,
        max_nfev=max_evaluations,
    )
    return path


def differences(
    function: Callable[[Array], Array],
    at: Array,
    steps: Array,
    places: Sequence[int] | None = None,
    value: Array | None = None,
) -> Array:
    """Return the differences of a function's values by each of k arguments, shape (..., k).

    Parameters
    ----------
    function : callable
        Arguments, shape (n,), to values of any shape.
    at, steps : array, shape (n,)
        Arguments, and how far each is moved; either way.
    places : sequence of int, optional
        Of the k arguments; all by default.
    here : array, optional
        Values at the arguments, if known.
    """
    value, columns = function(at) if value is None else value, []
    for k in range(at.size) if places is None else places:
        shifted = at.copy()
        shifted[k] += steps[k]
        away = shifted[k] - at[k] or steps[k]  # one lost in rounding moves nothing
        columns.append((function(shifted) - value) / away)
    return np.stack(columns, axis=-1) if columns else np.zeros((*value.shape, 0))


def by_differences(errors: Callable[[Array], Array], steps: Array) -> Errors:
    """Return errors with derivatives by finite differences of so large steps, shape (p,)."""

    def sloped(point: Array) -> tuple[Array, Callable[[], Array]]:
        at_point = errors(point)
        return at_point, lambda: differences(errors, point, steps, value=at_point)

    return sloped


def triangle_of(slopes: Array, errors: Array) -> Array:
    """Return the triangle, (p + 1, p + 1), of derivatives, (n, p), and errors; rows not finite are 0."""
    columns = np.column_stack([slopes, errors])
    columns[~np.isfinite(columns).all(axis=1)] = 0.0
    triangle: Array = np.linalg.qr(columns, mode="r")  # type: ignore[assignment]
    return triangle


def levenberg_marquardt(
    errors: Callable[[Array, bool], tuple[Array, Array]],
    step: Callable[[Array, Array, float], Array],
    start: Array,
    steps: int,
    improved: Callable[[Array, float], object],
) -> Array:
    """Return the best point of a descent whose steps are solved for by the caller.

    Parameters
    ----------
    errors : callable
        From parameters to errors, shape (n,), and their derivatives by what is free, shape (n, p); the
        latter are needed only where the second argument is true, and may else have no rows.
    step : callable
        From the triangle, (p + 1, p + 1), of the derivatives and the errors, the parameters and a
        damping to other parameters; or it raises a `ModelError`. A step to errors that are not finite,
        or no smaller, is refused, and tried again with more damping.
    start : array
    steps : int
        Largest number of steps.
    improved : callable
        Called with every better point, and its root mean square error.
    """
    damping, slow, point = FIRST_DAMPING, 0, start
    errors_now, slopes = errors(point, True)
    cost = rms(errors_now)
    improved(point, cost)
    for number in range(steps):
        if not len(slopes):
            errors_now, slopes = errors(point, True)
        triangle = triangle_of(slopes, errors_now)
        for turn in range(MOST_TRIES):
            try:
                trial = step(triangle, point, damping)
                # most others are accepted, so that their slopes are needed
                errors_now, slopes = errors(trial, turn == 0 and number < steps - 1)
                size = rms(errors_now)
            except ModelError:
                size = np.inf
            if size < cost:
                break
            damping = max(HEAVIER * damping, RAISED)
        else:
            return point
        slow = slow + 1 if size > (1.0 - SLOW_GAIN) * cost else 0
        point, cost = trial, size
        improved(point, cost)
        if slow >= MOST_SLOW_STEPS:
            return point
        damping = max(LIGHTER * damping, LIGHTEST)
    return point
