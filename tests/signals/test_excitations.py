"""Excitations: exact shapes, limits, repeatability."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import DataError
from mckibben.signals import (
    cycles,
    irregular_triangle,
    random_wave,
    reversals,
    sine,
    staircase,
    triangle,
)

TIME = np.arange(4001) / 100


@pytest.mark.parametrize("wave", [sine, triangle])
def test_each_cycle_starts_at_the_minimum_and_reaches_its_peak(wave: Callable[..., Any]) -> None:
    peaks = (2.0, 5.0, 3.0, 1.0)
    u = wave(TIME, 10.0, peaks, low=0.5)
    assert u[::1000] == pytest.approx(0.5)
    assert u[500::1000] == pytest.approx(peaks)
    assert [piece.start for piece in cycles(u)] == [0, 1000, 2000, 3000]
    assert wave(TIME, 10.0, (1.0, 2.0))[500::1000] == pytest.approx([1.0, 2.0, 1.0, 2.0])
    if wave is sine:
        expected = 0.5 + 1.5 * (0.5 - 0.5 * np.cos(2 * np.pi * 0.1 * TIME[:1000]))
        assert u[:1000] == pytest.approx(expected, abs=1e-12)


@given(st.integers(1, 40), st.integers(0, 1000))
def test_irregular_triangle_turns_as_often_as_asked(n_turns: int, seed: int) -> None:
    time = np.linspace(0, 100, 20001)
    u = irregular_triangle(time, n_turns, 5.0, 1.0, seed=seed)
    assert u[0] == 1.0
    assert u.min() >= 1.0
    assert u.max() == pytest.approx(5.0, abs=0.1)
    found = reversals(u, 0.0).size - 2
    assert found <= n_turns
    # Turns closer to each other than two samples may be lost.
    assert found >= 0.8 * n_turns - 1


def test_irregular_triangle_moves_at_one_speed() -> None:
    u = irregular_triangle(np.linspace(0, 10, 100_001), 12, 5.0, seed=4)
    speeds = np.abs(np.diff(u))
    assert np.quantile(speeds, 0.01) == pytest.approx(np.quantile(speeds, 0.99), rel=1e-6)


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=6), st.floats(0.0, 2.0))
def test_staircase_holds_every_level(levels: list[float], ramp: float) -> None:
    hold = 1.0
    for number, level in enumerate(levels):
        within = number * (hold + ramp) + np.array([0.01, 0.5, 0.99]) * hold
        assert staircase(within, levels, hold, ramp) == pytest.approx(level)
    late = np.array([1e3, 1e4])
    assert staircase(late, levels, hold, ramp) == pytest.approx(levels[-1])


@pytest.mark.parametrize(
    "wish",
    [
        lambda: sine(TIME, 0.0, 1.0),
        lambda: sine(TIME, 1.0, ()),
        lambda: triangle(TIME - 1.0, 1.0, 1.0),
        lambda: irregular_triangle(TIME, 0, 5.0, seed=0),
        lambda: irregular_triangle(TIME, 3, 1.0, 2.0, seed=0),
        lambda: staircase(TIME, (), 1.0),
        lambda: staircase(TIME, (1.0,), 0.0),
        lambda: staircase(TIME, (1.0,), 1.0, -1.0),
        lambda: random_wave(TIME, 1.0, 0.0, seed=0),
        lambda: random_wave([1.0], 1.0, 5.0, seed=0),
    ],
)
def test_impossible_wishes_are_refused(wish: Callable[[], Any]) -> None:
    with pytest.raises(DataError):
        wish()
