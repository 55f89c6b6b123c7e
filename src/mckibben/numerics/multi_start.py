"""Multi-start optimisation within bounds, with exchange of parameter groups."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.numerics.descent import Errors, trust_region
from mckibben.numerics.statistics import rms
from mckibben.numerics.tracker import Tracker

EXCHANGES = 3
"""Maximum number of exchanges of parameter groups, each followed by a refinement."""

LEAST_GAIN = 1e-7
"""Share of the sum of squares that a step of a refinement has to gain for another to follow."""


@dataclass(frozen=True)
class Choice:
    """Alternatives, shape (n, k), for some of the parameters together."""

    places: NDArray[np.intp]
    values: Array


def multi_start(
    errors: Errors,
    starts: Sequence[Array],
    bounds: tuple[Array, Array],
    tracker: Tracker,
    *,
    n_refined: int,
    max_evaluations: int,
    choices: Sequence[Choice] = (),
) -> Array:
    """Return the best point after refining the most promising of many starts within bounds.

    Every start is evaluated once; the best ``n_refined`` are refined in a trust region. Where there are
    choices, they are tried group after group, which leaves local minima from which no small step leads
    on, and the best is refined again.
    """
    tracked = tracker.watched(errors)

    def evaluated(start: Array) -> tuple[Array, float]:
        inside = np.clip(start, *bounds)
        return inside, rms(tracked(inside)[0])

    refine = partial(
        trust_region, tracked, bounds=bounds, least_gain=LEAST_GAIN, max_evaluations=max_evaluations
    )
    follow_best(starts, evaluated, refine, n_refined)
    for _ in range(EXCHANGES if choices else 0):
        least = tracker.best_cost
        for choice in choices:
            best_point = tracker.found
            for values in choice.values:
                trial = best_point.copy()
                trial[choice.places] = values
                tracked(trial)
        if not tracker.best_cost < least:
            break
        refine(tracker.found)
    return tracker.found


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
    ranked = sorted((first_steps(start) for start in starts), key=lambda pair: pair[1])
    costs: list[float] = []
    for point, cost in ranked:
        if len(costs) < most and all(abs(cost - other) > same * cost for other in costs):
            costs.append(cost)
            refine(point)
