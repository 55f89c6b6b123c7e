"""Searches and linear solutions of fits, against SciPy and known minima."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from mckibben import Recording
from mckibben.blocks.compose import Series
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.hysteresis.pi import PI
from mckibben.estimators.core.data import training_data
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.coupled.swarm import Swarm, particle_swarm
from mckibben.estimators.optimisers.linear import solve_linear
from mckibben.estimators.optimisers.multi_start import multi_start, trust_region
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.registry import load

CPI = Series((PI.example(), Creep.example()))


@given(st.integers(0, 10_000), st.sampled_from([None, 0.0, 0.2]))
def test_linear_solution_matches_scipy(seed: int, least: float | None) -> None:
    """Of weights of either sign, and of weights with least values but for the first."""
    rng = np.random.default_rng(seed)
    basis = rng.standard_normal((60, 5))
    target = basis @ rng.uniform(-1, 1, 5) + 3 + 0.1 * rng.standard_normal(60)
    low = np.full(5, -np.inf if least is None else least)
    low[0] = -np.inf
    bounds = np.append(low, -np.inf), np.inf
    columns = np.column_stack([basis, np.ones(60)])
    reference = lsq_linear(columns, target, bounds, tol=1e-14, method="bvls")
    given_least = None if least is None else low
    x, offset = solve_linear(basis, target, nonnegative=least is not None, least=given_least)
    np.testing.assert_allclose([*x, offset], reference.x, rtol=1e-6, atol=1e-8)


def test_nearly_parallel_columns_are_solved_without_squaring_the_condition() -> None:
    t = np.linspace(0, 1, 200)
    basis = np.column_stack([t, t + 1e-7 * np.sin(9 * t)])
    x, offset = solve_linear(basis, basis @ [2.0, 1.0] + 5, nonnegative=False)
    np.testing.assert_allclose([*x, offset], [2, 1, 5], rtol=1e-6)


@pytest.mark.parametrize("nonnegative", [False, True])
def test_a_column_that_varies_by_rounding_is_not_fitted_with(nonnegative: bool) -> None:
    rng = np.random.default_rng(2)
    moving = rng.standard_normal(200)
    saturated = np.nextafter(np.tanh(20.3) + np.zeros(200), rng.integers(0, 3, 200))
    x, offset = solve_linear(
        np.column_stack([moving, saturated]),
        2.0 * moving + 5 + rng.standard_normal(200),
        nonnegative=nonnegative,
    )
    assert x[0] == pytest.approx(2.0, abs=0.3)
    assert x[1] == 0.0
    assert offset == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize("name", ["mpi", "cpi"])
def test_moves_in_closed_form_are_those_of_finite_differences(name: str) -> None:
    time = np.arange(800) * 0.05
    pressure = 2.5 + 2.3 * np.sin(0.6 * time) * np.exp(-0.02 * time)
    y = CPI.simulate(pressure, sample_time=0.05)
    recording = Recording({"pressure": pressure, "displacement": y}, 0.05)
    data = training_data(recording, "pressure", "displacement")
    estimator = load("estimators", name)()
    lower, upper = estimator.bounds(data)
    theta = 0.999 * np.clip(estimator.guesses(data)[0], lower, upper) + 0.0005 * (lower + upper)
    linear, _ = solve_linear(estimator.design_matrix(theta, data), data.target, nonnegative=True)
    moves = estimator.moves(theta, linear, data)
    differences = SeparableEstimator.moves(estimator, theta, linear, data)
    np.testing.assert_allclose(moves, differences, atol=2e-4 * np.abs(moves).max())


def valley(point: np.ndarray) -> np.ndarray:
    """Rosenbrock's residuals, with their minimum 0 at (1, 1)."""
    return np.array([10 * (point[1] - point[0] ** 2), 1 - point[0]])


def test_multi_start_finds_the_minimum_and_reports() -> None:
    starts = [np.array([-1.2, 1.0]), np.array([2.0, -1.0])]
    best = multi_start(
        valley,
        starts,
        np.full(2, -5.0),
        np.full(2, 5.0),
        Tracker(),
        n_refined=2,
        max_evaluations=100,
    )
    np.testing.assert_allclose(best, [1, 1], atol=1e-5)


def test_a_swarm_finds_the_minimum_and_repeats() -> None:
    lower, upper = np.array([-1.0, -2.0, 0.0]), np.array([1.0, 2.0, 3.0])

    def sphere(points: np.ndarray) -> np.ndarray:
        return np.asarray(((points - 0.3) ** 2).sum(axis=1))

    start = np.random.default_rng(0).uniform(lower, upper, (8, 3))
    first, second = (
        particle_swarm(sphere, lower, upper, Swarm(8, 30), Tracker(), 5, start) for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)
    assert sphere(first[np.newaxis])[0] < 1e-2


@pytest.mark.parametrize("bounds", [(-np.inf, np.inf), (-2.0, 1.5)])
def test_a_trust_region_falls_at_every_step_and_arrives(bounds: tuple[float, float]) -> None:
    def slopes(point: np.ndarray) -> np.ndarray:
        return np.array([[-20 * point[0], 10.0], [-1.0, 0.0]])

    start = np.array([-1.2, 1.0])
    path = trust_region(
        valley, slopes, start, scale="jac", bounds=bounds, max_evaluations=100, least_gain=1e-12
    )
    np.testing.assert_array_equal(path[0][0], start)
    costs = [float(np.sum(valley(point) ** 2)) for point, _ in path]
    np.testing.assert_allclose(costs, [cost for _, cost in path], rtol=1e-13)
    assert np.all(np.diff(costs) < 0)
    np.testing.assert_allclose(path[-1][0], [1, 1], atol=1e-6)


def test_a_trust_region_does_not_start_where_errors_are_zero_or_infinite() -> None:
    for start, cost in ((np.ones(2), 0.0), (np.full(2, np.inf), np.inf)):
        path = trust_region(
            lambda point: np.abs(point - 1.0),
            lambda point: np.eye(2),
            start,
            scale="jac",
            least_gain=1e-9,
            max_evaluations=9,
        )
        assert [found for _, found in path] == [cost]
