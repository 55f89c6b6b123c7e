"""Searches from many starts, of known minima."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.numerics.descent import by_differences
from mckibben.numerics.multi_start import Choice, follow_best, multi_start
from mckibben.numerics.tracker import Tracker

BOUNDS = np.full(2, -5.0), np.full(2, 5.0)


def waves(point: Array) -> Array:
    """Errors with a local minimum in every period of the first parameter; 0 at (2, 1)."""
    return np.array([3 * np.sin(3 * (point[0] - 2)), point[0] - 2, point[1] - 1])


def found(*starts: tuple[float, float], choices: tuple[Choice, ...] = ()) -> tuple[Array, Tracker]:
    tracker, errors = Tracker(), by_differences(waves, np.full(2, 1e-7))
    points = [np.array(start) for start in starts]
    best = multi_start(
        errors, points, BOUNDS, tracker, n_refined=1, max_evaluations=50, choices=choices
    )
    return best, tracker


def test_the_best_of_many_starts_is_refined_within_bounds() -> None:
    best, tracker = found((-9.0, 3.0), (1.8, 2.0), (4.0, 0.0))
    np.testing.assert_allclose(best, [2, 1], atol=1e-5)
    assert tracker.best_cost < 1e-5
    assert tracker.evaluations > 3


def test_exchange_leaves_a_local_minimum() -> None:
    start = (-1.0, 1.0)
    assert abs(found(start)[0][0] - 2) > 1
    choice = Choice(np.array([0]), np.array([[-3.0], [0.0], [2.1]]))
    np.testing.assert_allclose(found(start, choices=(choice,))[0], [2, 1], atol=1e-5)


def test_starts_that_come_to_one_place_are_followed_once() -> None:
    costs = {1.0: 3.0, 2.0: 1.0, 3.0: 1.0 + 1e-9, 4.0: 2.0}
    followed: list[float] = []
    follow_best(
        [np.array([x]) for x in costs],
        lambda start: (start, costs[float(start[0])]),
        lambda place: followed.append(float(place[0])),
        2,
        1e-6,
    )
    assert followed == [2.0, 4.0]
