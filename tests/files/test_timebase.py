"""Time grids: rounding is told from jitter, and gaps from both."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mckibben
from mckibben import DataError, DataWarning, Recording
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
    step = timebase.common_step(time, [(0, n)])
    assert step.jitter is None
    assert abs(step.size - 1 / rate) * (n - 1) <= 2.0 * 10.0**-decimals


@given(st.floats(1e-6, 1e3), st.integers(10, 500), st.floats(-1e3, 1e3))
def test_full_precision_times_keep_their_step(step: float, n: int, start: float) -> None:
    time: Array = start + step * np.arange(n, dtype=np.float64)
    found = timebase.common_step(time, [(0, n)])
    assert found.jitter is None
    assert found.size == pytest.approx(step, rel=1e-5)


@pytest.mark.parametrize(("rate", "step"), [(1000, 0.001), (60, 1 / 60), (12, 1 / 12), (0.25, 4.0)])
def test_step_is_the_plain_number_that_was_meant(rate: float, step: float) -> None:
    time: Array = np.round(np.arange(5000) / rate, 9)
    assert timebase.common_step(time, [(0, 5000)]).size == step


def test_single_precision_times_are_uniform() -> None:
    time = (np.arange(20_000) * 0.001).astype(np.float32).astype(float)
    assert timebase.common_step(time, [(0, time.size)]).jitter is None


def test_jitter_is_measured() -> None:
    rng = np.random.default_rng(1)
    error = rng.normal(scale=0.0005, size=2000)
    time = np.arange(2000) * 0.01 + error
    step = timebase.common_step(time, [(0, 2000)])
    assert step.size == pytest.approx(0.01, rel=1e-4)
    assert step.jitter == pytest.approx(
        (np.sqrt(np.mean(np.diff(error) ** 2)), np.abs(np.diff(error)).max()), rel=1e-2
    )


def test_a_lost_sample_is_not_taken_for_rounding() -> None:
    time = np.delete(np.arange(1000) / 1000, 500)
    assert timebase.common_step(time, [(0, 999)]).jitter is not None


@given(st.lists(st.integers(1, 30), min_size=2, max_size=8))
def test_gaps_between_stretches_do_not_change_the_step(lengths: list[int]) -> None:
    pieces, spans, begin, at = [], [], 0.0, 0
    for length in lengths:
        pieces.append(begin + 0.02 * np.arange(length))
        spans.append((at, at + length))
        begin, at = pieces[-1][-1] + 0.731, at + length
    time = np.concatenate(pieces)
    if max(lengths) > 1:
        assert timebase.common_step(time, spans).size == pytest.approx(0.02)


def test_gaps_are_found() -> None:
    time = np.concatenate([np.arange(50) * 0.1, 7 + np.arange(50) * 0.1])
    assert timebase.gaps(time).tolist() == [50]


def test_resampling_keeps_what_is_linear() -> None:
    rng = np.random.default_rng(2)
    time = 5 + np.cumsum(rng.uniform(0.5, 1.5, 300))
    grid = timebase.resample(time, 2 * time - 1, 0.7)
    assert grid == pytest.approx(2 * (time[0] + 0.7 * np.arange(grid.size)) - 1)


# Through files ---------------------------------------------------------------------------------


def read(
    tmp_path: Path, time: Sequence[object] | Array, header: str = "time_s", **options: Any
) -> tuple[list[Recording], Array]:
    path = tmp_path / "run.csv"
    samples = np.sin(np.arange(len(time)) / 5)
    lines = [f"{t},{x!r}" for t, x in zip(time, samples.tolist(), strict=True)]
    path.write_text("\n".join([f"{header},pressure_bar", *lines]))
    return mckibben.read(path, **options), samples


@pytest.mark.parametrize(
    ("header", "scale"),
    [("time_s", 1.0), ("t (ms)", 1e3), ("time_us", 1e6), ("Zeit in min", 1 / 60)],
)
def test_uniform_time_leaves_the_samples_untouched(
    tmp_path: Path, header: str, scale: float
) -> None:
    time = [f"{scale * (0.5 + 0.25 * k):.10g}" for k in range(40)]
    (recording,), samples = read(tmp_path, time, header)
    assert recording.sample_time == pytest.approx(0.25, rel=1e-9)
    assert recording.start_time == pytest.approx(0.5, rel=1e-9)
    assert np.array_equal(recording["pressure"], samples)


def test_a_column_of_numbers_goes_before_timestamps(tmp_path: Path) -> None:
    lines = [f"2026-01-31 12:00:{k:02d},{k / 10},{k % 7}" for k in range(40)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["timestamp,time_s,p_bar", *lines]))
    (recording,) = mckibben.read(path)
    assert recording.sample_time == 0.1
    assert recording.meta["ignored_columns"] == ["timestamp"]
    (recording,) = mckibben.read(path, columns={"time": "timestamp"})
    assert recording.sample_time == 1.0


def test_jittered_time_is_resampled_and_said(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    time = np.arange(100) * 0.1 + rng.uniform(-0.02, 0.02, 100)
    with pytest.warns(DataWarning, match=r"run.csv"):
        (recording,), samples = read(tmp_path, time)
    assert recording.sample_time == pytest.approx(0.1, rel=1e-2)
    assert recording["pressure"] == pytest.approx(np.interp(recording.time, time, samples))


def test_rate_gives_the_time_where_there_is_none(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("p_bar\n" + "\n".join(map(str, range(20))))
    assert mckibben.read(path)[0].sample_time is None
    assert mckibben.read(path, rate=50)[0].sample_time == 0.02


def test_rate_that_agrees_with_rounded_and_repeated_times(tmp_path: Path) -> None:
    time = [f"{k / 300:.2f}" for k in range(60)]
    with pytest.raises(DataError, match="--rate") as caught:
        read(tmp_path, time)
    assert (caught.value.channel, caught.value.row) == ("time", 3)
    (recording,), samples = read(tmp_path, time, rate=300)
    assert recording.sample_time == 1 / 300
    assert np.array_equal(recording["pressure"], samples)


GAPPED = (
    [k / 10 for k in range(30)] + [8 + k / 10 for k in range(5)] + [20 + k / 10 for k in range(25)]
)


def test_gaps_stop_by_default(tmp_path: Path) -> None:
    with pytest.raises(
        DataError, match=r" 5.1 s .*\(2 .* 11.6 s.* 8.35 s.* 16.7 s.*--gaps"
    ) as caught:
        read(tmp_path, GAPPED)
    assert (caught.value.channel, caught.value.row) == ("time", 32)


def test_gaps_split(tmp_path: Path) -> None:
    with pytest.warns(DataWarning, match="1 of 3 "):
        parts, samples = read(tmp_path, GAPPED, gaps="split")
    assert [part.name for part in parts] == ["run[1]", "run[2]"]
    assert [part.start_time for part in parts] == [0.0, 20.0]
    assert [part.sample_time for part in parts] == [0.1, 0.1]
    assert np.array_equal(parts[0]["pressure"], samples[:30])
    assert np.array_equal(parts[1]["pressure"], samples[35:])


def test_stretches_too_short_for_later_steps_are_left_out_even_of_what_need_not_inform(
    tmp_path: Path,
) -> None:
    with pytest.warns(DataWarning, match="1 of 3 .* row 32"):
        parts, _ = read(tmp_path, GAPPED, gaps="split", informative=False)
    assert [len(part) for part in parts] == [30, 25]


def test_gaps_interpolate(tmp_path: Path) -> None:
    with pytest.warns(DataWarning, match="2 gap"):
        (recording,), samples = read(tmp_path, GAPPED, gaps="interpolate")
    assert recording.sample_time == 0.1
    assert recording["pressure"] == pytest.approx(np.interp(recording.time, GAPPED, samples))
    assert recording.duration == pytest.approx(22.4)


def test_warnings_point_at_the_caller(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("p\n" + "\n".join(map(str, range(20))))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mckibben.read(path)
    assert [warning.filename for warning in caught] == [__file__]
