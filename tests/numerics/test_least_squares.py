"""Bounded and constrained linear least squares, against SciPy and the conditions of an optimum."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, lsq_linear, minimize, nnls

from mckibben.errors import ModelError
from mckibben.numerics.least_squares import solve_bounded, solve_constrained, solve_products


@given(st.integers(0, 10_000), st.sampled_from([None, 0.0, 0.2]))
def test_bounded_solutions_are_those_of_scipy(seed: int, least: float | None) -> None:
    """Of weights of either sign, and of weights with least values but for the first."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((60, 5))
    target = columns @ rng.uniform(-1, 1, 5) + 3 + 0.1 * rng.standard_normal(60)
    low = np.full(5, -np.inf if least is None else least)
    low[0] = -np.inf
    bounds = np.append(low, -np.inf), np.inf
    with_ones = np.column_stack([columns, np.ones(60)])
    reference = lsq_linear(with_ones, target, bounds, tol=1e-14, method="bvls")
    x, offset = solve_bounded(columns, target, None if least is None else low)
    np.testing.assert_allclose([*x, offset], reference.x, rtol=1e-6, atol=1e-8)


def test_nearly_parallel_columns_are_solved_without_squaring_the_condition() -> None:
    t = np.linspace(0, 1, 200)
    columns = np.column_stack([t, t + 1e-7 * np.sin(9 * t)])
    x, offset = solve_bounded(columns, columns @ [2.0, 1.0] + 5)
    np.testing.assert_allclose([*x, offset], [2, 1, 5], rtol=1e-6)


@pytest.mark.parametrize("least", [None, np.zeros(2)])
def test_a_column_that_varies_by_rounding_is_not_fitted_with(least: np.ndarray | None) -> None:
    rng = np.random.default_rng(2)
    moving = rng.standard_normal(200)
    saturated = np.nextafter(np.tanh(20.3) + np.zeros(200), rng.integers(0, 3, 200))
    columns = np.column_stack([moving, saturated])
    x, offset = solve_bounded(columns, 2.0 * moving + 5 + rng.standard_normal(200), least)
    assert x[0] == pytest.approx(2.0, abs=0.3)
    assert x[1] == 0.0
    assert offset == pytest.approx(5.0, abs=0.3)


@given(st.integers(0, 10_000))
def test_solutions_from_products_are_those_of_damped_rows(seed: int) -> None:
    """Of a stack, with two targets, in any units."""
    rng = np.random.default_rng(seed)
    stack, bounded = rng.standard_normal((3, 40, 7)), rng.random(5) < 0.5
    stack[:, :, 1] *= 1e6
    ridge = rng.uniform(0.01, 0.1, 5)
    products = stack.transpose(0, 2, 1) @ stack
    found = solve_products(products, 5, ridge, bounded=bounded)
    for table, solution in zip(stack, found, strict=True):
        damping = np.diag(np.sqrt(ridge) * np.linalg.norm(table[:, :5], axis=0))
        rows = np.vstack([table[:, :5], damping])
        for target, x in zip(table[:, 5:].T, solution.T, strict=True):
            bounds = np.where(bounded, 0.0, -np.inf), np.inf
            right = np.append(target, np.zeros(5))
            size = np.linalg.norm(rows, axis=0)
            reference = lsq_linear(rows / size, right, bounds, tol=1e-14, method="bvls").x / size
            np.testing.assert_allclose(x * size, reference * size, atol=1e-7)


def test_products_without_an_effect_have_no_weight() -> None:
    table = np.array([[1.0, 0.0, 2.0], [2.0, 0.0, 4.0]])
    found = solve_products((table.T @ table)[np.newaxis], 2, 1e-12)[0, :, 0]
    np.testing.assert_allclose(found, [2.0, 0.0], atol=1e-9)


def test_constrained_solutions_are_those_of_scipy() -> None:
    rng = np.random.default_rng(0)
    columns, target = rng.standard_normal((40, 6)), rng.standard_normal(40)
    sides, least = rng.standard_normal((9, 6)), 0.3 * rng.standard_normal(9)
    sides[4], least[4] = 0.0, 1.0  # asks for nothing
    near, effects = rng.standard_normal(6), (columns**2).sum(axis=0)

    def cost(x: np.ndarray) -> float:
        return float(((columns @ x - target) ** 2).sum() + 0.1 * effects @ (x - near) ** 2)

    asked = LinearConstraint(np.delete(sides, 4, axis=0), np.delete(least, 4))
    reference = minimize(cost, near, method="SLSQP", constraints=asked, tol=1e-14).x
    x = solve_constrained(columns, target, sides, least, ridge=0.1, near=near)
    assert (np.delete(sides @ x - least, 4) > -1e-12).all()
    np.testing.assert_allclose(x, reference, atol=1e-6)
    assert cost(x) == pytest.approx(cost(reference), rel=1e-9)


def test_bounds_hold_to_the_bit_and_contradictions_are_refused() -> None:
    rng = np.random.default_rng(0)
    columns, target = rng.standard_normal((40, 6)), rng.standard_normal(40)
    x = solve_constrained(columns, target, np.eye(6), np.zeros(6))
    np.testing.assert_allclose(x, nnls(columns, target)[0], atol=1e-12)
    assert (x[nnls(columns, target)[0] == 0.0] == 0.0).all()
    with pytest.raises(ModelError):
        solve_constrained(columns, target, np.eye(6)[[0, 0]] * [[1.0], [-1.0]], np.ones(2))


def test_a_column_of_zeros_has_no_weight() -> None:
    columns = np.column_stack([np.linspace(1, 2, 50), np.zeros(50), np.cos(np.arange(50.0))])
    x, _ = solve_bounded(columns, columns @ [2.0, 0.0, 1.0], with_offset=False)
    np.testing.assert_allclose(x, [2, 0, 1], atol=1e-12)
