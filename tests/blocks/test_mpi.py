"""Modified Prandtl-Ishlinskii models: a PI model, then a curve without memory, in series."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import PI, Affine, ModelError, ModelWarning, PiecewiseLinear, Polynomial, Series
from mckibben.blocks.core.fields import vector
from tests.blocks.strategies import HIGH, LOW, increasing_cubics, numbers, paths, pi_models

Array = NDArray[np.float64]


def outputs_of(model: PI) -> tuple[float, float]:
    """Return a range that contains every output of a PI model over its input range."""
    size = float(np.abs(model.weights).sum()) * (HIGH - LOW + max(model.thresholds))
    return model.offset - size, model.offset + size


@given(pi_models(), st.data(), paths(0.1, 4.9))
def test_inverse_with_a_piecewise_linear_curve(model: PI, data: st.DataObject, u: Array) -> None:
    low, high = outputs_of(model)
    steps = data.draw(st.lists(numbers(0.1, 2.0), min_size=4, max_size=4))
    knots = vector(np.linspace(low, high, 5))
    curve = PiecewiseLinear(knots, vector(np.cumsum([0.0, *steps]) * (high - low)))
    assert_exact(Series((model, curve)), u, 3.0 * (high - low))


@given(pi_models(), st.data(), paths(0.1, 4.9))
def test_inverse_with_a_polynomial(model: PI, data: st.DataObject, u: Array) -> None:
    curve = data.draw(increasing_cubics(*outputs_of(model)))
    assert_exact(Series((model, curve)), u, abs(curve.polynomial[1]))


def assert_exact(series: Series, u: Array, scale: float) -> None:
    references = series.simulate(u)
    recovered = series.inverse().simulate(references)
    assert np.abs(series.simulate(recovered) - references).max() <= 1e-9 * scale


@given(increasing_cubics(0.0, 10.0), st.lists(numbers(0.0, 10.0), min_size=1, max_size=20))
def test_polynomial_inverse(curve: Polynomial, u: list[float]) -> None:
    recovered = curve.inverse().simulate(curve.simulate(u))
    np.testing.assert_allclose(curve.simulate(recovered), curve.simulate(u), atol=1e-12 * 100)


def test_polynomial_that_is_flat_at_an_end_has_an_inverse_still() -> None:
    parabola = Polynomial((0.0, 0.0, 1.0), input_range=(0.0, 2.0))
    u = np.linspace(0.0, 2.0, 101)
    np.testing.assert_allclose(parabola.inverse().simulate(parabola.simulate(u)), u, atol=1e-12)


@pytest.mark.parametrize(
    ("coefficients", "reason"),
    [
        ((0.0, 0.0, 1.0), "does not increase"),
        ((0.0, -1.0), "does not increase"),
        ((3.0,), "does not increase"),
        ((0.0, 0.1, 0.0, -1.0), "does not increase"),
    ],
)
def test_polynomials_that_do_not_increase(coefficients: tuple[float, ...], reason: str) -> None:
    with pytest.raises(ModelError, match=rf"{reason}.*Remedy:"):
        Polynomial(coefficients, input_range=(-1.0, 1.0)).inverse()


def test_polynomial_without_a_range_has_no_inverse() -> None:
    with pytest.raises(ModelError, match=r"without an input range.*Remedy:"):
        Polynomial((0.0, 1.0)).inverse()


def test_polynomial_clips_and_says_so() -> None:
    curve = Polynomial.example()
    low, high = (float(end[0]) for end in curve.reachable())
    with pytest.warns(ModelWarning, match=r"2 sample\(s\)"):
        recovered = curve.inverse().simulate([low - 1, high + 1, low, high])
    assert recovered.tolist() == [0.0, 10.0, 0.0, 10.0]


@given(st.data())
def test_piecewise_linear_is_numpy_between_its_knots(data: st.DataObject) -> None:
    steps = data.draw(st.lists(numbers(0.01, 3.0), min_size=3, max_size=8))
    rises = data.draw(st.lists(numbers(0.01, 3.0), min_size=len(steps), max_size=len(steps)))
    knots, values = vector(np.cumsum(steps)), vector(np.cumsum(rises))
    curve = PiecewiseLinear(knots, values)
    x = np.array(data.draw(st.lists(numbers(knots[0], knots[-1]), min_size=1, max_size=20)))
    np.testing.assert_allclose(curve.simulate(x), np.interp(x, knots, values), atol=1e-12)
    np.testing.assert_allclose(curve.inverse().simulate(curve.simulate(x)), x, atol=1e-9)


def test_piecewise_linear_goes_on_straight_beyond_its_ends() -> None:
    curve = PiecewiseLinear((0.0, 1.0, 3.0), (0.0, 2.0, 3.0))
    assert curve.simulate([-1.0, 5.0]).tolist() == [-2.0, 4.0]


@pytest.mark.parametrize(
    ("knots", "values"),
    [((0.0,), (0.0,)), ((0.0, 1.0), (0.0,)), ((0.0, 0.0), (0.0, 1.0)), ((0.0, 1.0), (1.0, 1.0))],
)
def test_piecewise_linear_refuses_what_does_not_increase(
    knots: tuple[float, ...], values: tuple[float, ...]
) -> None:
    with pytest.raises(ModelError, match="Remedy:"):
        PiecewiseLinear(knots, values)


@given(numbers(0.01, 100.0), numbers(-100.0, 100.0), st.lists(numbers(-50, 50), min_size=1))
def test_affine_inverse(gain: float, offset: float, u: list[float]) -> None:
    for block in (Affine(gain, offset), Affine(-gain, offset)):
        expected = [block.gain * x + offset for x in u]
        np.testing.assert_allclose(block.simulate(u), expected, rtol=1e-15, atol=1e-13)
        recovered = block.inverse().simulate(block.simulate(u))
        np.testing.assert_allclose(recovered, u, rtol=1e-12, atol=1e-13 * (1 + 100 / gain))


def test_affine_of_gain_zero_has_no_inverse() -> None:
    with pytest.raises(ModelError, match=r"gain 0.*Remedy:"):
        Affine(0.0).inverse()
