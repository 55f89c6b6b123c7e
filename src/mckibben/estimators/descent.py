"""Descent of a sum of squares by Gauss-Newton steps within a region of trust.

The derivatives are brought to a triangle once a step, so that trying how far to trust them costs next
to nothing beside the evaluations.

Source: Moré, "The Levenberg-Marquardt algorithm: implementation and theory", 1978.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHORTEST = 1e-9
"""Step, relative to the parameters in their scales, that is none."""


def descend(
    errors: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    start: Array,
    scale: Array,
    *,
    most_evaluations: int,
    least_gain: float,
) -> Iterator[Array]:
    """Yield the start, then parameters of ever smaller sums of squares, until these stop falling.

    Parameters
    ----------
    errors : callable
        Parameters, shape (p,), to finite errors, shape (n,), n >= p.
    slopes : callable
        Parameters to the derivatives of the errors, shape (n, p); asked for where errors have been.
    start, scale : arrays, shape (p,)
        Where to start, and how far each parameter may be thought to move.
    most_evaluations : int
        Of the errors.
    least_gain : float
        Share of the sum of squares that a step has to gain for another to follow.
    """
    theta = start
    yield theta
    e = errors(theta)
    cost, evaluations = float(e @ e), 1
    radius = float(np.linalg.norm(start / scale)) or 1.0
    while cost > 0.0:
        triangle, right = reduced(slopes(theta) * scale, e)
        gained = 0.0
        while gained <= 0.0:
            step = trusted(triangle, right, radius)
            length = float(np.linalg.norm(step))
            least = SHORTEST * float(np.linalg.norm(theta / scale))
            if evaluations >= most_evaluations or length <= least:
                return
            tried = theta + step * scale
            e_tried = errors(tried)
            evaluations += 1
            gained = cost - float(e_tried @ e_tried)
            ratio = gained / float(right @ right - np.sum((triangle @ step + right) ** 2))
            if not ratio >= 0.25:
                radius = 0.25 * length
            elif ratio > 0.75 and length > 0.95 * radius:
                radius *= 2.0
        theta, e = tried, e_tried
        yield theta
        if gained < least_gain * cost and ratio > 0.25:
            return
        cost -= gained


def reduced(slopes: Array, errors: Array) -> tuple[Array, Array]:
    """Return a triangle, shape (p, p), and p errors that make the same steps as all of them."""
    p = slopes.shape[1]
    triangle: Array = np.linalg.qr(np.column_stack([slopes, errors]), mode="r")  # type: ignore[assignment]
    return triangle[:p, :p], triangle[:p, p]


def trusted(triangle: Array, right: Array, radius: float) -> Array:
    """Return the step s, no longer than the radius, with the least |triangle s + right|."""
    left, singular, turned = np.linalg.svd(triangle)
    kept = singular > np.finfo(float).eps * right.size * singular[0]
    singular, along = singular[kept], -(left.T @ right)[kept]
    damping = 0.0
    for _ in range(50):
        step = singular * along / (singular**2 + damping)
        length = float(np.linalg.norm(step))
        if length <= 1.01 * radius:
            break
        # Newton's method on 1 / length, which is nearly linear in the damping
        bend = float(np.sum(step**2 / (singular**2 + damping)))
        damping += (length / radius - 1.0) * length**2 / bend
    return np.asarray((step * min(1.0, radius / length if length > 0 else 1.0)) @ turned[kept])
