"""The best of many starts, refined within bounds, and exchanged where groups of parameters may be."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.estimators.optimisers.tracker import Tracker

MARGIN = 1e-9
"""Least distance from the bounds at which a refinement begins, relative to theirs."""

EXCHANGES = 3
"""How often groups of parameters are exchanged and what was found refined, at most."""


@dataclass(frozen=True)
class Choice:
    """Values that some of the parameters may be exchanged for, together.

    Parameters
    ----------
    places : array of int, shape (k,)
        Which parameters.
    values : array, shape (n, k)
        What to try for them.
    """

    places: NDArray[np.intp]
    values: Array


def exchange(cost: Callable[[Array], float], start: Array, choices: Sequence[Choice]) -> Array:
    """Return the best point found by exchanging group after group, or the start where none is better.

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
    """Return the best point found by refining the most promising of many starts within bounds.

    Every start is evaluated once; the best ``n_refined`` are refined by a bounded trust-region
    method, with the derivatives of the residuals where given, else with finite differences. Where
    there are choices, the best is then improved by exchange, and refined again.

    Residuals are refined relative to the least RMSE of the starts, and parameters relative to their
    bounds, so that no tolerance or step of the search depends on a unit.
    """
    from scipy.optimize import least_squares

    def evaluate(point: Array) -> Array:
        r = residuals(point)
        tracker.saw(point, float(np.sqrt(np.mean(r**2))))
        return r

    def cost(point: Array) -> float:
        return float(np.mean(evaluate(point) ** 2))

    def begun(start: Array) -> tuple[Array, float]:
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

    with tracker.searching():
        follow_best(starts, begun, refine, n_refined)
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
    begun: Callable[[Array], tuple[Array, float]],
    followed: Callable[[Array], object],
    most: int,
    same: float = -1.0,
) -> None:
    """Begin at many starts, and follow those that promise most, the best first.

    Parameters
    ----------
    starts : iterable of array
    begun : callable
        A start to a place not far from it, and the cost there.
    followed : callable
        Such a place to whatever comes of it.
    most : int
        Places followed.
    same : float
        Relative difference of costs up to which two starts have come to one place, which is followed
        once.
    """
    tried = sorted((begun(start) for start in starts), key=lambda found: found[1])
    costs: list[float] = []
    for place, cost in tried:
        if len(costs) < most and all(abs(cost - other) > same * cost for other in costs):
            costs.append(cost)
            followed(place)
