"""Descent of a sum of squares: it arrives, only ever falls, and keeps within its trust."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mckibben.estimators.optimisers.descent import Damping, Radius, Trust, descend, trusted


def valley(point: np.ndarray) -> np.ndarray:
    """Rosenbrock's residuals, with their minimum 0 at (1, 1)."""
    return np.array([10 * (point[1] - point[0] ** 2), 1 - point[0]])


def slopes(point: np.ndarray) -> np.ndarray:
    return np.array([[-20 * point[0], 10.0], [-1.0, 0.0]])


@pytest.mark.parametrize("trust", [Radius(np.array([-1.2, 1.0]), np.ones(2)), Damping(1e-3, 1e9)])
def test_descent_falls_at_every_step_and_arrives(trust: Trust) -> None:
    start = np.array([-1.2, 1.0])
    path = list(descend(valley, slopes, start, trust, most_evaluations=100, least_gain=1e-12))
    costs = [float(np.sum(valley(point) ** 2)) for point, _ in path]
    np.testing.assert_allclose(costs, [cost for _, cost in path], rtol=1e-14)
    assert np.all(np.diff(costs) < 0)
    np.testing.assert_allclose(path[-1][0], [1, 1], atol=1e-6)


@pytest.mark.parametrize("made", [lambda start: Radius(start, np.ones(3)), lambda _: Damping(1e-3)])
def test_descent_leaves_alone_what_has_no_effect(made: Callable[[np.ndarray], Trust]) -> None:
    def blind(point: np.ndarray) -> np.ndarray:
        return np.pad(slopes(point[:2]), ((0, 1), (0, 1)))

    start = np.array([-1.2, 1.0, 7.0])
    *_, (end, _) = descend(
        lambda point: np.append(valley(point[:2]), 0.5),
        blind,
        start,
        made(start),
        most_evaluations=100,
        least_gain=1e-12,
    )
    np.testing.assert_allclose(end, [1, 1, 7], atol=1e-5)


def test_a_step_is_the_best_within_its_radius() -> None:
    rng = np.random.default_rng(0)
    triangle, right = np.triu(rng.standard_normal((4, 4))), rng.standard_normal(4)
    free = trusted(triangle, right, np.inf)
    np.testing.assert_allclose(free, -np.linalg.solve(triangle, right))
    step = trusted(triangle, right, 0.1)
    assert np.linalg.norm(step) <= 0.1 * (1 + 1e-12)
    others = rng.standard_normal((2000, 4))
    others *= 0.1 / np.linalg.norm(others, axis=1)[:, np.newaxis]
    reached = np.linalg.norm(others @ triangle.T + right, axis=1).min()
    assert np.linalg.norm(triangle @ step + right) <= reached * 1.001
