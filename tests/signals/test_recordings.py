"""Cutting, resampling, splitting and thinning."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mckibben import DataError, Recording
from mckibben.signals import (
    cut,
    decimate_minmax,
    resample,
    split_cycles,
    triangle,
)

TIME = np.arange(10_001) / 1000
UNTIMED = Recording({"pressure": np.array([0.0, 1.0])})


def wave(frequency: float, start_time: float = 0.0) -> Recording:
    """Return a sine over ten seconds at 1 kHz, with a ramp beside it."""
    channels = {"pressure": np.sin(2 * np.pi * frequency * TIME), "voltage": 0.3 * TIME - 1}
    return Recording(channels, 1e-3, start_time=start_time, meta={"load": "2 kg"})


@given(st.floats(0.0002, 0.1))
def test_slow_signals_survive_any_sample_time(sample_time: float) -> None:
    found = resample(wave(0.7, start_time=5.0), sample_time)
    assert found.sample_time == sample_time
    assert found.start_time == 5.0
    assert found.meta == {"load": "2 kg"}
    assert found.duration == pytest.approx(10.0, abs=sample_time)
    then = found.time - 5.0
    assert found["voltage"] == pytest.approx(0.3 * then - 1, abs=1e-9)
    inside = (then > 1) & (then < 9)
    error = found["pressure"] - np.sin(2 * np.pi * 0.7 * then)
    assert np.abs(error[inside]).max() < 2e-3
    assert np.abs(error).max() < 0.02


@pytest.mark.parametrize("ratio", [2.0, 7.0, 10.0, 13.7, 31.4159])
@pytest.mark.parametrize("above", [1.05, 1.5, 1.95])
def test_what_would_alias_is_taken_out(ratio: float, above: float) -> None:
    nyquist = 500 / ratio
    found = resample(wave(above * nyquist), ratio * 1e-3)
    inside = found["pressure"][len(found) // 4 : -len(found) // 4]
    assert np.abs(inside).max() < 2e-3


def test_a_finer_grid_keeps_every_sample_and_adds_no_overshoot() -> None:
    run = Recording({"voltage": np.repeat([0.0, 1.0, 0.5], 10)}, 0.1)
    assert resample(run, 0.1) is run
    finer = resample(run, 0.025)
    assert finer["voltage"][::4] == pytest.approx(run["voltage"], abs=1e-12)
    assert (finer["voltage"].min(), finer["voltage"].max()) == (0.0, 1.0)


@given(st.floats(-1, 11), st.floats(-1, 11), st.floats(-1, 11))
def test_neighbouring_cuts_join(a: float, b: float, c: float) -> None:
    first, middle, last = sorted((a, b, c))
    assume(min(middle - first, last - middle) > 0.01)
    assume(first < 9.9 and middle > 0.1 and middle < 9.9 and last > 0.1)
    run = wave(1.0)
    left, right = cut(run, first, middle), cut(run, middle, last)
    assert right.time[0] == pytest.approx(left.time[-1] + run.sample_time)
    assert cut(run, middle).time[-1] == pytest.approx(10.0)
    assert len(left) + len(right) == len(cut(run, first, last))
    assert left.time[0] >= first - 1e-6
    assert right.time[-1] < last


@given(st.integers(1, 12), st.integers(1, 9))
def test_blocks_cover_all_and_start_at_minima(n_cycles: int, n_blocks: int) -> None:
    u = triangle(np.arange(100 * n_cycles + 1) / 100, 1.0, 5.0)
    blocks = split_cycles(Recording({"pressure": u}, 0.01), "pressure", n_blocks)
    assert [start for start, _ in blocks[1:]] == [stop for _, stop in blocks[:-1]]
    assert (blocks[0][0], blocks[-1][1]) == (0, u.size)
    if n_cycles > 1:
        assert len(blocks) == min(n_blocks, n_cycles)
        assert u[[start for start, _ in blocks]] == pytest.approx(0.0)
    else:
        # A single cycle is cut at its maximum.
        assert len(blocks) == min(n_blocks, 2)


@pytest.mark.parametrize(
    "wish",
    [
        lambda: cut(wave(1.0), 3.0, 3.0),
        lambda: cut(wave(1.0), 20.0, 30.0),
        lambda: cut(UNTIMED, 0.0, 1.0),
        lambda: resample(wave(1.0), 0.0),
        lambda: resample(wave(1.0), 11.0),
        lambda: resample(UNTIMED, 1.0),
        lambda: split_cycles(wave(1.0), "pressure", 0),
        lambda: split_cycles(wave(1.0), "voltage", 2),
        lambda: split_cycles(wave(1.0), "force", 2),
        lambda: decimate_minmax([0.0, 1.0], max_points=10),
        lambda: decimate_minmax([0.0, 1.0], [0.0], max_points=10),
        lambda: decimate_minmax([0.0, 1.0], [0.0, 1.0], [0.0, 1.0], max_points=3),
    ],
)
def test_impossible_wishes_are_refused(wish: Callable[[], Any]) -> None:
    with pytest.raises(DataError):
        wish()
