"""Turning points, branches and cycles: against a naive zigzag, and under noise."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import DataError
from mckibben.signals import branches, cycles, noise_level, reversals, sine, staircase, triangle

pytestmark = pytest.mark.kernel

Array = NDArray[np.float64]

LEVELS = st.lists(st.integers(-8, 8).map(float), min_size=2, max_size=60).map(np.array)
THRESHOLDS = st.sampled_from([0.0, 0.5, 1.0, 2.5, 6.0])
TIME = np.arange(10_001) / 100


def naive_turns(x: Array, threshold: float) -> list[int]:
    """Find each turn as the extreme sample before the first swing back beyond the threshold."""
    turns = [0]
    start, way = 0, 0
    for i in range(1, x.size):
        run = x[start : i + 1]
        back = {1: run.max() - x[i], -1: x[i] - run.min()}
        if way == 0:
            way = -1 if back[1] > threshold else 1 if back[-1] > threshold else 0
            start = start if way == 0 else i
        elif back[way] > threshold:
            extreme = run.max() if way > 0 else run.min()
            turns.append(start + int(np.flatnonzero(run == extreme)[-1]))
            start, way = i, -way
    return [*turns, x.size - 1]


@given(LEVELS, THRESHOLDS)
def test_reversals_are_those_of_a_naive_search(x: Array, threshold: float) -> None:
    # The naive search restarts where the swing is noticed, which is where the next extreme is too.
    assert reversals(x, threshold).tolist() == naive_turns(x, threshold)
    assert reversals(-x, threshold).tolist() == naive_turns(x, threshold)


@given(LEVELS, THRESHOLDS)
def test_branches_join_and_alternate(x: Array, threshold: float) -> None:
    found = branches(x, threshold)
    assert found[0][0] == 0
    assert found[-1][1] == x.size
    for (_, stop, way), (start, _, next_way) in pairwise(found):
        assert start == stop - 1
        assert way == -next_way != 0


@given(LEVELS, THRESHOLDS, st.integers(1, 5))
def test_holds_are_no_reversals(x: Array, threshold: float, hold: int) -> None:
    turns = reversals(x, threshold)
    held = reversals(np.repeat(x, hold), threshold)
    assert held[0] == 0
    assert held[1:].tolist() == ((turns[1:] + 1) * hold - 1).tolist()


@pytest.mark.parametrize("noise", [0.001, 0.01, 0.05, 0.1])
@pytest.mark.parametrize("seed", range(3))
def test_noise_makes_no_reversals(noise: float, seed: int) -> None:
    clean = triangle(TIME, 20.0, (5.0, 3.0, 4.0, 2.0, 5.0))
    noisy = clean + noise * np.random.default_rng(seed).standard_normal(TIME.size)
    turns = reversals(noisy)
    assert turns.size == reversals(clean).size == 11
    # A maximum of noisy samples lies where the signal is within the noise of its peak.
    assert np.abs(clean[turns] - clean[reversals(clean)]).max() <= 8 * noise


@pytest.mark.parametrize("noise", [1e-4, 0.01, 0.2])
def test_noise_level_is_that_of_the_noise(noise: float) -> None:
    rng = np.random.default_rng(1)
    jumps = staircase(TIME, [0.0, 2.0, 1.0, 4.0], hold=2.0)
    for clean in (sine(TIME, 10.0, 5.0), triangle(TIME, 7.0, 5.0), 0.1 * TIME, jumps):
        found = noise_level(clean + noise * rng.standard_normal(TIME.size))
        assert found == pytest.approx(noise, rel=0.1)


def test_levels_recorded_once_each_have_no_known_noise() -> None:
    levels = np.random.default_rng(0).uniform(0, 5, 200)
    assert math.isnan(noise_level(levels))
    assert math.isnan(noise_level(levels[:5]))
    assert reversals(levels).size > 100


def test_cut_cycles_at_the_ends_do_not_count() -> None:
    u = triangle(TIME, 20.0, 5.0)
    assert [len(cycles(part)) for part in (u[500:], u[:-500], u[50:-50], u[:900], -u)] == [
        *(4, 4, 5, 0, 4),
    ]
    assert branches([2.0, 2.0, 2.0]) == [(0, 3, 0)]


@pytest.mark.parametrize("x", [[1.0], [[1.0, 2.0]], [0.0, math.nan]])
def test_what_is_no_signal_is_refused(x: list[float]) -> None:
    for search in (noise_level, reversals, branches, cycles):
        with pytest.raises(DataError) as error:
            search(x)
        assert error.value.row == (2 if len(x) == 2 else None)
    with pytest.raises(DataError):
        reversals([0.0, 1.0], -1.0)
