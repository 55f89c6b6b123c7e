"""Descents, against SciPy and known minima."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares

from mckibben.arrays import Array
from mckibben.errors import ModelError
from mckibben.numerics.descent import by_differences, levenberg_marquardt, trust_region
from mckibben.numerics.least_squares import solve_constrained

START = np.array([-1.2, 1.0])


def valley(point: Array) -> Array:
    """Rosenbrock's errors, with their minimum 0 at (1, 1)."""
    return np.array([10 * (point[1] - point[0] ** 2), 1 - point[0]])


def slopes(point: Array) -> Array:
    return np.array([[-20 * point[0], 10.0], [-1.0, 0.0]])


def sloped(point: Array) -> tuple[Array, Callable[[], Array]]:
    return valley(point), lambda: slopes(point)


@pytest.mark.parametrize("bounds", [None, (np.full(2, -2.0), np.full(2, 1.5))])
@pytest.mark.parametrize("errors", [sloped, by_differences(valley, np.full(2, 1e-7))])
def test_a_trust_region_falls_at_every_step_and_arrives(
    errors: Callable[[Array], tuple[Array, Callable[[], Array]]],
    bounds: tuple[Array, Array] | None,
) -> None:
    path = trust_region(errors, START, bounds=bounds, max_evaluations=100, least_gain=1e-12)
    np.testing.assert_allclose(path[0][0], START, rtol=1e-15)
    costs = [float(np.sum(valley(point) ** 2)) for point, _ in path]
    np.testing.assert_allclose(costs, [cost for _, cost in path], rtol=1e-13)
    assert np.all(np.diff(costs) < 0)
    np.testing.assert_allclose(path[-1][0], [1, 1], atol=1e-6)


def test_a_trust_region_stops_at_a_bound_as_scipys() -> None:
    bounds = np.full(2, -2.0), np.array([0.5, 1.5])
    found = trust_region(sloped, START, bounds=bounds, max_evaluations=100, least_gain=1e-12)
    reference = least_squares(valley, START, slopes, bounds, ftol=1e-12, xtol=1e-12, gtol=1e-12)
    np.testing.assert_allclose(found[-1][0], reference.x, atol=1e-6)


def test_a_trust_region_depends_on_no_unit() -> None:
    unit = np.array([1e6, 1e-3])

    def rescaled(point: Array) -> tuple[Array, Callable[[], Array]]:
        return 1e9 * valley(point / unit), lambda: 1e9 * slopes(point / unit) / unit

    few = {"max_evaluations": 12, "least_gain": 1e-12}
    one = trust_region(sloped, START, **few)  # type: ignore[arg-type]
    other = trust_region(rescaled, START * unit, **few)  # type: ignore[arg-type]
    np.testing.assert_allclose(other[-1][0] / unit, one[-1][0], rtol=1e-9)


@pytest.mark.parametrize(("start", "cost"), [(1.0, 0.0), (np.inf, np.inf)])
def test_a_trust_region_does_not_start_where_errors_are_zero_or_infinite(
    start: float, cost: float
) -> None:
    errors = by_differences(lambda point: np.abs(point - 1.0), np.ones(2))
    path = trust_region(errors, np.full(2, start), least_gain=1e-9, max_evaluations=9)
    assert [found for _, found in path] == [cost]


def descended(start: Array, sides: Array, least: Array) -> tuple[Array, list[float]]:
    """Return the end and the costs of a descent with x within sides @ x >= least."""

    def errors(point: Array, wanted: bool) -> tuple[Array, Array]:
        return valley(point), slopes(point) if wanted else np.zeros((0, 2))

    def step(triangle: Array, point: Array, damping: float) -> Array:
        by, left = triangle[:, :-1], triangle[:, -1]
        target = by @ point - left
        return solve_constrained(by, target, sides, least, ridge=damping, near=point)

    costs: list[float] = []
    found = levenberg_marquardt(errors, step, start, 60, lambda _, cost: costs.append(cost))
    return found, costs


def test_damped_steps_fall_and_arrive() -> None:
    found, costs = descended(START, np.zeros((0, 2)), np.zeros(0))
    assert np.all(np.diff(costs) < 0)
    np.testing.assert_allclose(found, [1, 1], atol=1e-6)


def test_damped_steps_within_constraints_end_where_scipys_do() -> None:
    found, _ = descended(START, np.array([[-1.0, 0.0]]), np.array([-0.5]))
    bounds = np.full(2, -np.inf), np.array([0.5, np.inf])
    np.testing.assert_allclose(found, least_squares(valley, START, bounds=bounds).x, atol=1e-3)


def test_steps_that_cannot_be_solved_for_end_a_descent_where_it_is() -> None:
    def step(triangle: Array, point: Array, damping: float) -> Array:
        raise ModelError("no step", remedy="none")

    found = levenberg_marquardt(
        lambda point, _: (valley(point), slopes(point)), step, START, 9, lambda *_: None
    )
    np.testing.assert_array_equal(found, START)
