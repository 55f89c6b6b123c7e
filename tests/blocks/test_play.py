"""The laws of the play operator, and the operators side by side that estimators use."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import PI, DataError, ModelError, Play
from mckibben.blocks.play_type.play import play_matrix
from tests.blocks.strategies import numbers, paths

Array = NDArray[np.float64]


@given(paths(-3.0, 3.0), numbers(0.0, 2.0))
def test_output_stays_within_the_dead_zone_of_the_input(u: Array, r: float) -> None:
    assert np.abs(Play(r).simulate(u) - u).max() <= r + 1e-12


@given(numbers(-3.0, 3.0), numbers(0.05, 2.0), numbers(0.0, 1.0))
def test_dead_zone_is_twice_the_threshold(peak: float, r: float, share: float) -> None:
    """After a peak the output holds until the input has come back by 2 r, then follows."""
    outputs = Play(r).simulate([peak - 10.0, peak, peak - 2 * r * share, peak - 2 * r - 1.0])
    np.testing.assert_allclose(outputs[1:], [peak - r, peak - r, peak - r - 1.0], atol=1e-12)


@given(paths(), paths(), numbers(0.0, 2.0))
def test_monotone_in_the_input(u: Array, raise_by: Array, r: float) -> None:
    """An input that is nowhere lower gives an output that is nowhere lower."""
    n = min(u.size, raise_by.size)
    lower, upper = Play(r).simulate(u[:n]), Play(r).simulate(u[:n] + raise_by[:n])
    assert (upper >= lower).all()


@given(paths(), numbers(0.0, 2.0), st.integers(1, 5))
def test_pace_does_not_matter(u: Array, r: float, repeats: int) -> None:
    slow = Play(r).simulate(np.repeat(u, repeats))
    np.testing.assert_array_equal(slow[::repeats], Play(r).simulate(u))


@given(paths(), numbers(0.0, 2.0), numbers(-4.0, 4.0))
def test_shifting_the_input_shifts_the_output(u: Array, r: float, shift: float) -> None:
    shifted = Play(r).simulate(u + shift)
    np.testing.assert_allclose(shifted, Play(r).simulate(u) + shift, atol=1e-12)


@given(paths(1.0, 4.0), numbers(0.0, 2.0))
def test_wiping_out(inner: Array, r: float) -> None:
    """An excursion between a peak and a valley leaves no memory once both are passed again."""
    framed = np.concatenate([[0.0, 5.0], inner, [5.0, 0.0, 2.0, 0.5]])
    plain = np.array([0.0, 5.0, 5.0, 0.0, 2.0, 0.5])
    np.testing.assert_array_equal(Play(r).simulate(framed)[-4:], Play(r).simulate(plain)[-4:])


@given(paths(), st.lists(numbers(0.01, 1.0), min_size=1, max_size=6))
def test_operators_side_by_side_are_single_operators(u: Array, steps: list[float]) -> None:
    r = np.cumsum(steps)
    operators = np.empty((u.size, r.size))
    play_matrix(u, r, u[0] - r, operators)
    for column, threshold in zip(operators.T, r.tolist(), strict=True):
        np.testing.assert_array_equal(column, Play(threshold).simulate(u))


def test_starts() -> None:
    assert Play(1.0).simulate([3.0, 2.0]).tolist() == [2.0, 2.0]
    assert Play(1.0).simulate([3.0, 2.0], initial="virgin").tolist() == [2.0, 2.0]
    assert Play(1.0).simulate([0.5, 0.0], initial="virgin").tolist() == [0.0, 0.0]
    assert Play(1.0).simulate([0.5, 0.0], initial=[1.2]).tolist() == [1.2, 1.0]
    assert Play(1.0, initial=(1.2,)).simulate([0.5, 0.0]).tolist() == [1.2, 1.0]


def test_refuses_what_makes_no_sense() -> None:
    with pytest.raises(ModelError, match=r"thresholds of 'play'.*Remedy:"):
        Play(-0.1)
    with pytest.raises(ModelError, match=r"1 states.*Remedy:"):
        Play(0.5).simulate([0.0, 1.0], initial=[0.0, 0.0])
    with pytest.raises(ModelError, match=r"no initial state 'fresh'.*Remedy:"):
        Play(0.5).simulate([0.0, 1.0], initial="fresh")  # type: ignore[arg-type]
    with pytest.raises(DataError, match=r"row 2.*the input is nan"):
        Play(0.5).simulate([0.0, np.nan])
    with pytest.raises(ModelError, match=r"no inverse|no exact inverse"):
        Play(0.5).inverse()


def test_one_operator_is_a_pi_model() -> None:
    u = np.sin(np.linspace(0, 20, 200))
    np.testing.assert_array_equal(Play(0.3).simulate(u), PI((0.3,), (1.0,)).simulate(u))
