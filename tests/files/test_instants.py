"""Dates, times of day and counts as times."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording

N = 40
START = datetime.datetime(2026, 1, 31, 23, 59, 55)
INSTANTS = [START + datetime.timedelta(milliseconds=250 * k) for k in range(N)]


def read(
    folder: Path,
    times: Sequence[object],
    separator: str = ",",
    header: str = "time",
    **options: Any,
) -> Recording:
    path = folder / "run.csv"
    rows = [f"{time}{separator}{k % 7}" for k, time in enumerate(times)]
    path.write_text("\n".join([f"{header}{separator}pressure_bar", *rows]))
    (recording,) = mckibben.read(path, **options)
    return recording


DATES = ["%Y-%m-%dT", "%Y-%m-%d ", "%Y/%m/%d ", "%Y.%m.%d ", "%d.%m.%Y ", "%d.%m.%y "]
DATES += ["%d/%m/%Y ", "%m/%d/%Y ", "%d-%m-%Y ", "%d-%b-%Y "]
CLOCKS = ["%H:%M:%S.%f", "%H:%M:%S.%f+0100", "%H:%M:%S.%f UTC"]
FORMS = [date + clock for date in DATES for clock in CLOCKS]
FORMS += ["%m/%d/%Y %I:%M:%S.%f %p", "%Y%m%dT%H%M%S.%f", "%Y-%m-%dT%H:%M:%S.%fZ"]


@pytest.mark.parametrize("form", FORMS)
def test_dates_are_seconds_from_the_first(tmp_path: Path, form: str) -> None:
    recording = read(tmp_path, [instant.strftime(form) for instant in INSTANTS])
    assert (recording.sample_time, recording.start_time) == (0.25, 0.0)
    assert recording.n_samples == N


@pytest.mark.parametrize(
    "form", ["12:00:{:06.3f}", "12:00:{:06.3f} p.m.", "2025/03/01 10:11:{:06.3f}"]
)
@pytest.mark.parametrize("mark", ".,")
def test_fractions_after_either_mark(tmp_path: Path, form: str, mark: str) -> None:
    times = [form.format(0.25 * k).replace(".", mark, 1) for k in range(N)]
    assert read(tmp_path, times, ";").sample_time == 0.25


def test_whole_seconds_need_no_fraction(tmp_path: Path) -> None:
    times = [f"{t:%d.%m.%Y %H:%M:%S.%f}".removesuffix(".000000") for t in INSTANTS]
    assert read(tmp_path, times).sample_time == 0.25


def test_a_change_of_the_zone_is_no_jump(tmp_path: Path) -> None:
    ahead = datetime.timedelta(hours=1)
    times = [f"{t:%Y-%m-%d %H:%M:%S.%f}+01:00" for t in INSTANTS[:20]]
    times += [f"{t + ahead:%Y-%m-%d %H:%M:%S.%f}+02:00" for t in INSTANTS[20:]]
    assert read(tmp_path, times).sample_time == 0.25


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f"])
def test_a_day_that_may_be_a_month_is_refused_where_it_matters(tmp_path: Path, form: str) -> None:
    over_midnight = datetime.datetime(2026, 3, 4, 23, 59, 55)
    times = [over_midnight + datetime.timedelta(seconds=0.25 * k) for k in range(N)]
    with pytest.raises(DataError) as caught:
        read(tmp_path, [time.strftime(form) for time in times])
    assert (caught.value.channel, caught.value.row) == ("time", 2)
    on_one_day = [time - datetime.timedelta(hours=5) for time in times]
    assert read(tmp_path, [time.strftime(form) for time in on_one_day]).sample_time == 0.25


BAD = ["31.02.2026 23:59:57", "01.13.2026 23:59:57", "01.Foo.2026 23:59:57", "01.02.2026 25:00:00"]
BAD += ["2026-02-01T00:00:00", "soon", "", "31.01.2026 23:59:54", "31.01.2026 23:59:56.000000"]


@pytest.mark.parametrize("bad", BAD)
def test_bad_dates_are_refused_by_their_row(tmp_path: Path, bad: str) -> None:
    times = [instant.strftime("%d.%m.%Y %H:%M:%S.%f") for instant in INSTANTS]
    times[5] = bad
    with pytest.raises(DataError) as caught:
        read(tmp_path, times)
    assert (caught.value.channel, caught.value.row) == ("time", 7)


# Times without a unit ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("unit", "per_second"), [("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
def test_counts_since_1970_are_recognised_and_noted(
    tmp_path: Path, unit: str, per_second: int
) -> None:
    times = [1_750_000_000 * per_second + k * per_second // 100 for k in range(N)]
    with pytest.warns(DataWarning, match=f" {unit} .*1970.*--unit time="):
        recording = read(tmp_path, times)
    assert recording.sample_time == pytest.approx(0.01, rel=1e-3)
    stated = read(tmp_path, times, header=f"time_{unit}")
    assert stated.sample_time == pytest.approx(0.01, rel=1e-3)
    with pytest.raises(DataError, match=f"--unit time={unit}"):
        read(tmp_path, times, header="time_s")


@pytest.mark.parametrize("first", [45000, 739000])
def test_days_are_not_taken_for_seconds(tmp_path: Path, first: int) -> None:
    times = [f"{first + k * 1e-5:.5f}" for k in range(N)]
    with pytest.raises(DataError, match=r"--unit time=day or --unit time=s"):
        read(tmp_path, times)
    assert read(tmp_path, times, units={"time": "day"}).sample_time == pytest.approx(0.864)
    assert read(tmp_path, times, header="time_s").sample_time == 1e-5


@pytest.mark.parametrize("first", [20260131120000, 133500000000000000, 638000000000000000])
def test_other_clocks_stop(tmp_path: Path, first: int) -> None:
    with pytest.raises(DataError) as caught:
        read(tmp_path, [first + 100 * k for k in range(N)])
    assert caught.value.channel == "time"
