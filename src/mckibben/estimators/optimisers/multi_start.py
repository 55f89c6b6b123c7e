"""Multi-start optimisation within bounds, with exchange of parameter groups."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.estimators.optimisers.tracker import Tracker

MARGIN = 1e-9
"""Smallest distance of a start from the bounds, relative to their width."""

SHORTEST = 1e-9
"""Step, relative to the parameters, that counts as zero."""

EXCHANGES = 3
"""Maximum number of exchanges of parameter groups, each followed by a refinement."""


@dataclass(frozen=True)
class Choice:
    """Alternatives, shape (n, k), for some of the parameters together."""

    places: NDArray[np.intp]
    values: Array


def exchange(cost: Callable[[Array], float], start: Array, choices: Sequence[Choice]) -> Array:
    """Return the best point after exchanging group after group, or the start if none is better.

    It leaves local minima from which no small step leads on.
    """
    best, least = start, cost(start)
    for choice in choices:
        held = best
        for values in choice.values:
            tried = held.copy()
            tried[choice.places] = values
            if (found := cost(tried)) < least:
                best, least = tried, found
    return best


def multi_start(
    residuals: Callable[[Array], Array],
    starts: Sequence[Array],
    lower: Array,
    upper: Array,
    tracker: Tracker,
    *,
    n_refined: int,
    max_evaluations: int,
    jacobian: Callable[[Array], Array] | None = None,
    choices: Sequence[Choice] = (),
) -> Array:
    """Return the best point after refining the most promising of many starts within bounds.

    Every start is evaluated once; the best ``n_refined`` are refined by a bounded trust-region
    method, with the derivatives of the residuals where given, else with finite differences. Where
    there are choices, the best is then improved by exchange, and refined again.

    Residuals are refined relative to the least RMSE of the starts, and parameters relative to their
    bounds, so that no tolerance or step of the search depends on a unit.
    """
    from scipy.optimize import least_squares

    def evaluate(point: Array) -> Array:
        r = residuals(point)
        tracker.update(point, float(np.sqrt(np.mean(r**2))))
        return r

    def cost(point: Array) -> float:
        return float(np.mean(evaluate(point) ** 2))

    def evaluated(start: Array) -> tuple[Array, float]:
        inside = np.clip(start, lower, upper)
        return inside, cost(inside)

    def refine(start: Array) -> None:
        span = upper - lower
        unit = tracker.best_cost or 1.0

        def errors(z: Array) -> Array:
            return evaluate(lower + span * z) / unit

        def slopes(z: Array) -> Array:
            assert jacobian is not None
            return jacobian(lower + span * z) * span / unit

        least_squares(
            errors,
            np.clip((start - lower) / span, MARGIN, 1.0 - MARGIN),
            jac="2-point" if jacobian is None else slopes,
            bounds=(0.0, 1.0),
            max_nfev=max_evaluations,
            ftol=1e-7,
            xtol=1e-7,
            gtol=None,
        )

    follow_best(starts, evaluated, refine, n_refined)
    for _ in range(EXCHANGES if choices else 0):
        assert tracker.best is not None
        best = tracker.best
        better = exchange(cost, best, choices)
        if better is best:
            break
        refine(better)
    assert tracker.best is not None
    return tracker.best


def follow_best(
    starts: Iterable[Array],
    first_steps: Callable[[Array], tuple[Array, float]],
    refine: Callable[[Array], object],
    most: int,
    same: float = -1.0,
) -> None:
    """Evaluate many starts, and refine the best ``most`` of them.

    ``first_steps`` leads from a start to a place not far from it, and the cost there. Starts whose costs
    differ by up to ``same``, relatively, have come to one place, which is followed once.
    """
    tried = sorted((first_steps(start) for start in starts), key=lambda found: found[1])
    costs: list[float] = []
    for place, cost in tried:
        if len(costs) < most and all(abs(cost - other) > same * cost for other in costs):
            costs.append(cost)
            refine(place)


def trust_region(
    errors: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    start: Array,
    *,
    scale: Array | Literal["jac"],
    least_gain: float,
    max_evaluations: int,
    bounds: tuple[Array | float, Array | float] = (-np.inf, np.inf),
) -> list[tuple[Array, float]]:
    """Yield the start, then the points of decreasing cost of the search.

    Parameters
    ----------
    errors : callable
        Parameters, shape (p,), to errors, shape (n,); a step to errors that are not finite is refused.
    slopes : callable
        Parameters to the derivatives of the errors, shape (n, p); called where errors were last.
    start : array, shape (p,)
    scale : array, shape (p,), or "jac"
        How far each parameter may move at first; or by the sizes of the slopes.
    least_gain : float
        Share of the sum of squares that a step has to gain for another to follow.
    max_evaluations : int
        Of the errors.
    bounds : (array, array), shapes (p,)
        Of the parameters.

    Returns
    -------
    list of (array of shape (p,), float)
        Parameters and their sums of squares; the start alone where its errors are zero or not finite.
    """
    from scipy.optimize import least_squares

    last = errors(start)
    first = float(last @ last)
    if not 0.0 < first < np.inf:
        return [(start, first)]
    # relative errors of relative parameters, so that nothing depends on a unit
    unit, sizes = (
        np.sqrt(first / last.size),
        np.ones(start.size) if isinstance(scale, str) else scale,
    )
    path: list[tuple[Array, float]] = []

    def errors_at(point: Array) -> Array:
        nonlocal last
        if path or not np.array_equal(point, start / sizes):
            last = errors(point * sizes)
        return last / unit

    def slopes_at(point: Array) -> Array:  # called at the start and after every step that is taken
        path.append((point * sizes, float(last @ last)))
        return slopes(point * sizes) * sizes / unit

    least_squares(
        errors_at,
        start / sizes,
        slopes_at,
        bounds=(bounds[0] / sizes, bounds[1] / sizes),
        x_scale=scale if isinstance(scale, str) else 1.0,
        ftol=least_gain,
        xtol=SHORTEST,
        gtol=None,
        max_nfev=max_evaluations,
    )
    return path
