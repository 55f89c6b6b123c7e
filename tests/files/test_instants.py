"""Dates and times of day as times."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import mckibben
from mckibben import DataError, Recording

N = 40
START = datetime.datetime(2026, 1, 31, 23, 59, 55)
INSTANTS = [START + datetime.timedelta(milliseconds=250 * k) for k in range(N)]


def read(folder: Path, times: Sequence[str], separator: str = ",", **options: Any) -> Recording:
    path = folder / "run.csv"
    rows = [f"{time}{separator}{k % 7}" for k, time in enumerate(times)]
    path.write_text("\n".join([f"timestamp{separator}pressure_bar", *rows]))
    (recording,) = mckibben.read(path, **options)
    return recording


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%dT%H:%M:%S.%f",
        "%Y-%m-%d %H:%M:%S.%f",
        "%Y-%m-%dT%H:%M:%S.%fZ",
        "%Y-%m-%dT%H:%M:%S.%f+02:00",
        "%d.%m.%Y %H:%M:%S.%f",
        "%d.%m.%y %H:%M:%S.%f",
        "%d/%m/%Y %H:%M:%S.%f",
        "%m/%d/%Y %H:%M:%S.%f",
        "%m/%d/%Y %I:%M:%S.%f %p",
        "%d-%m-%Y %H:%M:%S.%f",
        "%d-%b-%Y %H:%M:%S.%f",
    ],
)
def test_dates_are_seconds_from_the_first(tmp_path: Path, form: str) -> None:
    recording = read(tmp_path, [instant.strftime(form) for instant in INSTANTS])
    assert (recording.sample_time, recording.start_time) == (0.25, 0.0)
    assert recording.n_samples == N


def test_times_of_the_day(tmp_path: Path) -> None:
    times = [f"12:00:{0.25 * k:06.3f}" for k in range(N)]
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


@pytest.mark.parametrize(
    "bad",
    [
        *("31.02.2026 23:59:57", "01.13.2026 23:59:57", "01.Foo.2026 23:59:57"),
        *("01.02.2026 25:00:00", "2026-02-01T00:00:00", "soon", ""),
        *("31.01.2026 23:59:54", "31.01.2026 23:59:56.000000"),
    ],
)
def test_bad_dates_are_refused_by_their_row(tmp_path: Path, bad: str) -> None:
    times = [instant.strftime("%d.%m.%Y %H:%M:%S.%f") for instant in INSTANTS]
    times[5] = bad
    with pytest.raises(DataError) as caught:
        read(tmp_path, times)
    assert (caught.value.channel, caught.value.row) == ("time", 7)
