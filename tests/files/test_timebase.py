"""Time grids: rounding is told from jitter, and gaps from both."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mckibben
from mckibben import DataWarning, Recording
from mckibben.arrays import Array
from mckibben.files import timebase


@settings(deadline=None)
@given(
    rate=st.sampled_from([3, 7, 12, 12.5, 30, 60, 100, 128, 1000, 1024]),
    n=st.integers(10, 3000),
    start=st.floats(0, 100),
    more=st.integers(0, 5),
)
def test_printed_times_of_a_uniform_grid_are_seen_as_uniform(
    rate: float, n: int, start: float, more: int
) -> None:
    decimals = int(np.ceil(np.log10(2 * rate))) + more
    time = np.round(start + np.arange(n) / rate, decimals)
    step = timebase.common_step(time, np.array([[0, n]]))
    assert step.jitter is None
    assert abs(step.size - 1 / rate) * (n - 1) <= 2.0 * 10.0**-decimals


@given(st.floats(1e-6, 1e3), st.integers(10, 500), st.floats(-1e3, 1e3))
def test_full_precision_times_keep_their_step(step: float, n: int, start: float) -> None:
    time: Array = start + step * np.arange(n, dtype=np.float64)
    found = timebase.common_step(time, np.array([[0, n]]))
    assert found.jitter is None
    assert found.size == pytest.approx(step, rel=1e-5)


@pytest.mark.parametrize(("rate", "step"), [(1000, 0.001), (60, 1 / 60), (12, 1 / 12), (0.25, 4.0)])
def test_step_is_the_plain_number_that_was_meant(rate: float, step: float) -> None:
    time: Array = np.round(np.arange(5000) / rate, 9)
    assert timebase.common_step(time, np.array([[0, 5000]])).size == step


def test_a_lost_sample_is_not_taken_for_rounding() -> None:
    step = timebase.common_step(np.delete(np.arange(1000) / 1000, 500), np.array([[0, 999]]))
    assert step.jitter is not None
    assert step.size == 0.001


def test_steps_that_are_long_and_short_in_turn_are_no_lost_samples() -> None:
    jitter = np.random.default_rng(1).uniform(-0.3, 0.3, 1000)
    step = timebase.common_step((np.arange(1000) + jitter) / 100, np.array([[0, 1000]]))
    assert step.size == pytest.approx(0.01, rel=1e-4)


@given(st.lists(st.integers(1, 30), min_size=2, max_size=8))
def test_gaps_between_stretches_do_not_change_the_step(lengths: list[int]) -> None:
    pieces, spans, begin, at = [], [], 0.0, 0
    for length in lengths:
        pieces.append(begin + 0.02 * np.arange(length))
        spans.append((at, at + length))
        begin, at = pieces[-1][-1] + 0.731, at + length
    time = np.concatenate(pieces)
    if max(lengths) > 1:
        assert timebase.common_step(time, np.array(spans)).size == pytest.approx(0.02)


# Through files ---------------------------------------------------------------------------------


def read(
    tmp_path: Path, time: Sequence[object] | Array, header: str = "time_s", **options: Any
) -> tuple[list[Recording], Array]:
    path = tmp_path / "run.csv"
    samples = np.sin(np.arange(len(time)) / 5)
    lines = [f"{t},{x!r}" for t, x in zip(time, samples.tolist(), strict=True)]
    path.write_text("\n".join([f"{header},pressure_bar", *lines]))
    return mckibben.read(path, **options), samples


GAPPED = (
    [k / 10 for k in range(30)] + [8 + k / 10 for k in range(5)] + [20 + k / 10 for k in range(25)]
)


def test_gaps_interpolate(tmp_path: Path) -> None:
    with pytest.warns(DataWarning, match="2 gap"):
        (recording,), samples = read(tmp_path, GAPPED, gaps="interpolate")
    assert recording.sample_time == 0.1
    assert recording["pressure"] == pytest.approx(np.interp(recording.time, GAPPED, samples))
    assert recording.duration == pytest.approx(22.4)
