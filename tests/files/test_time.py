"""Times as numbers, dates, times of day and counts; rounding, jitter and gaps."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mckibben import DataError, Recording
from mckibben.arrays import Array
from tests.files.made import Cells, one, place, put, refused
from tests.refusals import mentions

# Grids ---------------------------------------------------------------------------------

law = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def gridded(folder: Path, time: Any, **options: Any) -> tuple[Recording, Array]:
    """Read a file of times, as numbers to the last bit, and return its samples too."""
    samples = np.sin(np.arange(time.size) / 5)
    pq.write_table(pa.table({"time_s": time, "pressure_bar": samples}), folder / "a.parquet")
    return one(folder / "a.parquet", **options), samples


@law
@given(
    rate=st.sampled_from([3, 7, 12, 12.5, 30, 60, 100, 128, 1000, 1024]),
    n=st.integers(10, 3000),
    start=st.floats(0, 100),
    more=st.integers(0, 5),
)
def test_printed_times_of_a_uniform_grid_are_uniform(
    tmp_path: Path, rate: float, n: int, start: float, more: int
) -> None:
    decimals = int(np.ceil(np.log10(2 * rate))) + more
    recording, samples = gridded(tmp_path, np.round(start + np.arange(n) / rate, decimals))
    assert recording.sample_time == pytest.approx(1 / rate, abs=2 * 10.0**-decimals / (n - 1))
    assert recording["pressure"].tolist() == samples.tolist()
    assert not recording.notes


@law
@given(st.floats(1e-6, 1e3), st.integers(10, 500), st.floats(-1e3, 1e3))
def test_times_of_full_precision_have_their_step(
    tmp_path: Path, step: float, n: int, start: float
) -> None:
    recording, _ = gridded(tmp_path, start + step * np.arange(n), units={"time": "s"})
    assert recording.sample_time == pytest.approx(step, rel=1e-5)
    assert recording.start_time == start
    assert not recording.notes


@pytest.mark.parametrize("step", [0.001, 1 / 60, 1 / 12, 4.0])
def test_the_step_is_the_plain_number_that_was_meant(tmp_path: Path, step: float) -> None:
    recording, _ = gridded(tmp_path, np.round(np.arange(5000) * step, 9))
    assert recording.sample_time == step


def test_a_unit_of_time_names_the_time(tmp_path: Path) -> None:
    samples = pa.table({"ms": np.arange(50) * 20.0, "pressure_bar": np.sin(np.arange(50))})
    pq.write_table(samples, tmp_path / "a.parquet")
    assert one(tmp_path / "a.parquet").sample_time == 0.02


def test_a_lost_sample_is_not_taken_for_rounding(tmp_path: Path) -> None:
    times = np.delete(np.arange(1000) / 1000, 500)
    recording, samples = gridded(tmp_path, times)
    assert len(recording.notes) == 1
    assert recording["pressure"] == pytest.approx(np.interp(recording.time, times, samples))


@law
@given(st.lists(st.integers(10, 30), min_size=2, max_size=8), st.floats(0.1, 9))
def test_gaps_change_no_step_and_are_bridged_by_lines(
    tmp_path: Path, lengths: list[int], pause: float
) -> None:
    steps = [[pause, *[0.02] * (length - 1)] for length in lengths]
    times = np.cumsum(np.concatenate(steps))
    with pytest.raises(DataError) as caught:
        gridded(tmp_path, times)
    assert (caught.value.channel, caught.value.row) == ("time", lengths[0] + 1)
    recording, samples = gridded(tmp_path, times, gaps="interpolate")
    assert recording.sample_time == pytest.approx(0.02)
    assert recording.duration == pytest.approx(times[-1] - times[0], abs=0.02)
    expected = np.interp(recording.time, times, samples)
    assert recording["pressure"] == pytest.approx(expected, abs=1e-9)


# Dates ---------------------------------------------------------------------------------

N = 40
START = datetime.datetime(2026, 1, 31, 23, 59, 55)
INSTANTS = [START + datetime.timedelta(milliseconds=250 * k) for k in range(N)]


def written(folder: Path, times: Cells, header: str = "time") -> Path:
    cells = [k % 7 for k in range(len(times))]
    return put(folder / "a.csv", f"{header};pressure_bar", times, cells, separator=";")


DATES = ["%Y-%m-%dT", "%Y-%m-%d ", "%Y/%m/%d ", "%Y.%m.%d ", "%d.%m.%Y ", "%d.%m.%y "]
DATES += ["%d/%m/%Y ", "%m/%d/%Y ", "%d-%m-%Y ", "%d-%b-%Y "]
CLOCKS = ["%H:%M:%S.%f", "%H:%M:%S,%f", "%H:%M:%S.%f+0100", "%H:%M:%S.%f UTC"]
FORMS = [date + clock for date in DATES for clock in CLOCKS]
FORMS += ["%m/%d/%Y %I:%M:%S.%f %p", "%Y%m%dT%H%M%S.%f", "%Y-%m-%dT%H:%M:%S.%fZ"]
FORMS += ["%H:%M:%S.%f", "%H:%M:%S,%f", "%I:%M:%S.%f %p"]


@pytest.mark.parametrize("form", FORMS)
def test_dates_are_seconds_from_the_first(tmp_path: Path, form: str) -> None:
    recording = one(written(tmp_path, [instant.strftime(form) for instant in INSTANTS]))
    assert recording.time.tolist() == [k / 4 for k in range(N)]


def test_fractions_may_be_left_out_and_zones_change(tmp_path: Path) -> None:
    plain = [f"{t:%Y-%m-%d %H:%M:%S.%f}".removesuffix(".000000") for t in INSTANTS]
    ahead = [f"{t + datetime.timedelta(hours=1):%Y-%m-%d %H:%M:%S.%f}+02:00" for t in INSTANTS]
    for times in (plain, [*(f"{time}+01:00" for time in plain[:20]), *ahead[20:]]):
        assert one(written(tmp_path, times)).time.tolist() == [k / 4 for k in range(N)]


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f"])
def test_a_day_that_may_be_a_month_is_refused_where_it_matters(tmp_path: Path, form: str) -> None:
    over_midnight = [t.replace(month=3, day=5 - (t.day > 1)) for t in INSTANTS]
    assert place(written(tmp_path, [t.strftime(form) for t in over_midnight])) == ("time", 2)
    on_one_day = [t - datetime.timedelta(hours=5) for t in over_midnight]
    assert one(written(tmp_path, [t.strftime(form) for t in on_one_day])).sample_time == 0.25


BAD = ["31.02.2026 23:59:57", "01.13.2026 23:59:57", "01.Foo.2026 23:59:57", "01.02.2026 25:00:00"]
BAD += ["2026-02-01T00:00:00", "soon", "31.01.2026 23:59:54", "31.01.2026 23:59:56.000000"]


@pytest.mark.parametrize("bad", BAD)
def test_bad_dates_are_refused_by_their_row(tmp_path: Path, bad: str) -> None:
    times = [instant.strftime("%d.%m.%Y %H:%M:%S.%f") for instant in INSTANTS]
    times[5] = bad
    assert place(written(tmp_path, times)) == ("time", 7)


def test_a_row_without_a_date_is_left_out(tmp_path: Path) -> None:
    times = [instant.strftime("%d.%m.%Y %H:%M:%S.%f") for instant in INSTANTS]
    whole = one(written(tmp_path, times))
    times[5] = ""
    found = one(written(tmp_path, times), gaps="interpolate")
    assert found.duration == whole.duration
    assert any(mentions(note, 7) for note in found.notes)


# Counts --------------------------------------------------------------------------------


@pytest.mark.parametrize(("unit", "per_second"), [("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
def test_counts_since_1970_are_recognised_and_noted(
    tmp_path: Path, unit: str, per_second: int
) -> None:
    times = [1_750_000_000 * per_second + k * per_second // 100 for k in range(N)]
    assumed = one(written(tmp_path, times))
    assert "units[time]=" in " ".join(assumed.notes)
    stated = one(written(tmp_path, times, f"time_{unit}"))
    for recording in (assumed, stated):
        assert recording.sample_time == pytest.approx(0.01, rel=1e-3)
        assert recording.start_time == 0.0
        assert recording.meta["began"].startswith("2025-06-15T15:06:40")
    assert f"units[time]={unit}" in refused(written(tmp_path, times, "time_s")).remedy


@pytest.mark.parametrize("first", [45000, 739000])
def test_days_are_not_taken_for_seconds(tmp_path: Path, first: int) -> None:
    path = written(tmp_path, [f"{first + k * 1e-5:.5f}" for k in range(N)])
    assert "`units[time]=day` or `units[time]=s`" in refused(path).remedy
    assert one(path, units={"time": "day"}).sample_time == pytest.approx(0.864)
    assert one(path, units={"time": "s"}).sample_time == 1e-5


@pytest.mark.parametrize("first", [20260131120000, 133500000000000000, 638000000000000000])
def test_other_clocks_stop(tmp_path: Path, first: int) -> None:
    assert refused(written(tmp_path, [first + 100 * k for k in range(N)])).channel == "time"


def test_a_time_counter_that_wraps_goes_on(tmp_path: Path) -> None:
    recording = one(written(tmp_path, (65000 + 20 * np.arange(N)) % 2**16, "time_ms"))
    assert recording.time - recording.start_time == pytest.approx(0.02 * np.arange(N))


@pytest.mark.parametrize("header", ["time", "Time"])
def test_steps_of_many_seconds_ask_for_the_unit(tmp_path: Path, header: str) -> None:
    path = written(tmp_path, range(0, 20 * N, 20), header)
    assert refused(path).channel == "time"
    assert one(path, units={"time": "ms"}).sample_time == pytest.approx(0.02)
    assert one(path, units={"time": "s"}).sample_time == 20


@pytest.mark.parametrize("second", ["time_2", "time.1", "Time 2 (s)", "time_s"])
@pytest.mark.parametrize("late", [0.0, 0.25])
def test_columns_have_the_clock_before_them(tmp_path: Path, second: str, late: float) -> None:
    t = np.arange(400) * 0.02
    p, x = 2.5 + 2 * np.sin(t), 10 + 5 * np.cos(t)
    rows = [f"{a:.3f},{b:.6f},{a + late:.3f},{c:.6f}" for a, b, c in zip(t, p, x, strict=True)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join([f"time_s,pressure_bar,{second},displacement_mm", *rows]))
    recording = one(path)
    assert late <= recording.time[0] < late + 0.02
    assert recording["pressure"] == pytest.approx(2.5 + 2 * np.sin(recording.time), abs=1e-3)
    assert recording["displacement"] == pytest.approx(
        10 + 5 * np.cos(recording.time - late), abs=1e-3
    )
