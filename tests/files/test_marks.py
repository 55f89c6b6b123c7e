"""Text tables that would be read silently wrong: marks of thousands, units and times that cannot be."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files.delimited import sidecar

N = 40
TIME = [f"{k / 100:.2f}" for k in range(N)]
SIZES = [900 + 10 * k for k in range(N)]  # from the 11th on, a thousand and more


def table(folder: Path, header: str, cells: Sequence[str], separator: str = ";") -> Path:
    """Write a column beside a time, and return its path."""
    path = folder / "run.csv"
    rows = [separator.join(row) for row in zip(TIME, cells, strict=True)]
    path.write_text("\n".join([f"time_s{separator}{header}", *rows]), encoding="utf-8")
    return path


def read(path: Path, **options: Any) -> Recording:
    (recording,) = mckibben.read(path, **options)
    return recording


# Marks -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("separator", [";", "\t", "|"])
@pytest.mark.parametrize("mark", [",", ".", "'", "’", " ", "\xa0", "\u2009", "\u202f", "_"])
@pytest.mark.parametrize("more", [0, 1000, 100_000])
def test_marks_of_thousands_are_not_read_as_anything(
    tmp_path: Path, separator: str, mark: str, more: int
) -> None:
    cells = [f"{size + more:,}".replace(",", mark) for size in SIZES]
    path = table(tmp_path, "pressure (mbar)", cells, separator)
    if mark == "." and more:  # every number has three digits after the mark: decimals
        with pytest.warns(DataWarning, match=r"'pressure \(mbar\)'"):
            assert read(path)["pressure"] == pytest.approx((np.array(SIZES) + more) / 1e6)
        return
    with pytest.raises(DataError) as caught:
        read(path)
    assert (caught.value.channel, caught.value.row) == ("pressure", 2 if more else 12)


@pytest.mark.parametrize("separator", [",", ";"])
def test_quoted_thousands_are_refused(tmp_path: Path, separator: str) -> None:
    path = table(tmp_path, "pressure (mbar)", [f'"{size:,}"' for size in SIZES], separator)
    with pytest.raises(DataError) as caught:
        read(path)
    assert (caught.value.channel, caught.value.row) == ("pressure", 12)


@pytest.mark.parametrize("cell", ["1,234,567", "1.234.567", "12,34,567", "1,234.5", "1.234,5"])
def test_several_marks_in_one_number_are_refused(tmp_path: Path, cell: str) -> None:
    path = table(tmp_path, "pressure (Pa)", [f'"{cell}"'] * N)
    with pytest.raises(DataError, match=cell) as caught:
        read(path)
    assert (caught.value.channel, caught.value.row) == ("pressure", 2)


def test_a_channel_beside_those_needed_is_left_out_and_said(tmp_path: Path) -> None:
    cells = [f"{k}.5;{size:,}" for k, size in enumerate(SIZES)]
    path = table(tmp_path, "x;y", cells)
    with pytest.warns(DataWarning, match="'y'.*'1,000'"):
        recording = read(path)
    assert list(recording.channels) == ["x"]
    assert "'y'" in recording.notes[0]
    with pytest.raises(DataError) as caught:
        read(path, channels=["y"])
    assert (caught.value.channel, caught.value.row) == ("y", 12)


DECIMALS = {
    "%.3f from zero": [f"{k / 100:.3f}" for k in range(N)],
    "%.3f to thousands": [f"{995 + k:.3f}" for k in range(N)],
    "%.3f below zero": [f"{k / 100 - 0.2:.3f}" for k in range(N)],
    "%g of eighths": [f"{k / 8:g}" for k in range(8, 8 + N)],
    "%.2f": [f"{k / 7 + 1:.2f}" for k in range(N)],
    "repr": [repr(1 + k / 3) for k in range(N)],
    "integers": [str(k) for k in range(980, 980 + N)],
    "one zero": [f"{k}.0" for k in range(N)],
    "blanks around": [f"  {k / 100:.3f} " for k in range(N)],
    "exponents": [f"{1 + k / 1000:.3f}e2" for k in range(N)],
}


@pytest.mark.parametrize("mark", ".,")
@pytest.mark.parametrize("form", DECIMALS)
def test_decimals_that_show_what_they_are_stay_so(tmp_path: Path, form: str, mark: str) -> None:
    path = table(tmp_path, "x", DECIMALS[form])
    path.write_text(path.read_text().replace(".", mark))
    assert read(path)["x"].tolist() == [float(cell) for cell in DECIMALS[form]]  # and no warning


@pytest.mark.parametrize("place", [5, 5000])
def test_one_number_anywhere_shows_that_a_mark_is_for_decimals(tmp_path: Path, place: int) -> None:
    cells = [str(1 + k % 9) if k % 2 else f"{1 + k % 9}.125" for k in range(6000)]
    for proof in (None, "2.5", "0.125", "1000.125", "7."):
        column = [proof if proof and k == place else cell for k, cell in enumerate(cells)]
        path = tmp_path / "run.csv"
        path.write_text("\n".join(["x", *column]))
        if proof:
            assert read(path)["x"].tolist() == [float(cell) for cell in column]
        else:
            with pytest.raises(DataError, match=r"row 2: .*'x', '1.125'"):
                read(path, channels=["x"])


# Units and times -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "factor", "remedy"),
    [
        ("pressure (mPa)", 0.01, "--unit pressure=MPa"),
        ("pressure (bar)", 1e300, "--unit pressure="),
        ("pressure (kPa)", 1e300, "--unit pressure="),
        ("pressure (MPa)", 300.0, "--unit pressure="),
        ("pressure (bar)", 4.9e5, "--unit pressure=Pa"),
        ("displacement (mm)", 1e9, "--unit displacement="),
        ("displacement (km)", 1e3, "--unit displacement="),
        ("force (GN)", 1.0, "--unit force="),
        ("temperature (°C)", 1e6, "--unit temperature="),
    ],
)
def test_declared_units_that_cannot_be_stop(
    tmp_path: Path, header: str, factor: float, remedy: str
) -> None:
    path = table(tmp_path, header, [repr(factor * (1 + k / 7)) for k in range(N)])
    with pytest.raises(DataError) as caught:
        read(path)
    assert caught.value.channel == header.partition(" ")[0]
    assert remedy in caught.value.remedy


@pytest.mark.parametrize(
    ("header", "cell"),
    [("pressure (mPa)", "0"), ("p [bar]", "1e-17"), ("p [Pa]", "2.5"), ("force (mN)", "1e-4")],
)
def test_nothing_rounding_and_small_values_are_read(tmp_path: Path, header: str, cell: str) -> None:
    assert len(read(table(tmp_path, header, [cell] * N))) == N


def timed(folder: Path, header: str, times: Sequence[object]) -> Path:
    """Write pressures at some times, and return the path."""
    path = folder / "run.csv"
    rows = [f"{t},{1 + k / 10:.1f}" for k, t in enumerate(times)]
    path.write_text("\n".join([f"{header},pressure_bar", *rows]))
    return path


@pytest.mark.parametrize(("unit", "per_second"), [("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
def test_counts_since_1970_are_recognised_and_said(
    tmp_path: Path, unit: str, per_second: int
) -> None:
    times = [1_750_000_000 * per_second + k * per_second // 100 for k in range(N)]
    with pytest.warns(DataWarning, match=f" {unit} .*1970.*--unit time="):
        recording = read(timed(tmp_path, "timestamp", times))
    assert recording.sample_time == pytest.approx(0.01, rel=1e-3)
    assert read(timed(tmp_path, f"time_{unit}", times)).sample_time == pytest.approx(0.01, rel=1e-3)
    with pytest.raises(DataError, match=f"--unit time={unit}"):
        read(timed(tmp_path, "time_s", times))


@pytest.mark.parametrize("first", [45000, 739000])
def test_days_are_not_taken_for_seconds(tmp_path: Path, first: int) -> None:
    times = [f"{first + k * 1e-5:.5f}" for k in range(N)]
    with pytest.raises(DataError, match=r"--unit time=day or --unit time=s"):
        read(timed(tmp_path, "time", times))
    recording = read(timed(tmp_path, "time", times), units={"time": "day"})
    assert recording.sample_time == pytest.approx(0.864)
    assert read(timed(tmp_path, "time_s", times)).sample_time == 1e-5


@pytest.mark.parametrize("first", [20260131120000, 133500000000000000, 638000000000000000])
def test_other_clocks_stop(tmp_path: Path, first: int) -> None:
    with pytest.raises(DataError) as caught:
        read(timed(tmp_path, "time", [first + 100 * k for k in range(N)]))
    assert caught.value.channel == "time"


@pytest.mark.parametrize(
    "change",
    [
        {"units": {"pressure": "bar"}},
        {"units": {"pressure": "bar", "displacement": "mm", "force": "N"}},
        {"units": {"displacement": "mm", "pressure": "bar"}},
        {"units": {"pressure\x1b[31m": "bar", "displacement": "mm"}},
        {"sample_time": None},
        {"sample_time": 1e-320},
        {"sample_time": 0.0},
    ],
)
def test_descriptions_of_other_columns_are_ignored(change: dict[str, Any], tmp_path: Path) -> None:
    run, n = tmp_path / "run.csv", np.arange(20, dtype=np.float64)
    units = {"pressure": "bar", "displacement": "mm"}
    mckibben.write(Recording({"pressure": n, "displacement": n}, 0.1, units=units), run)
    about = json.loads(sidecar(run).read_text(encoding="utf-8"))
    sidecar(run).write_text(json.dumps(about | change), encoding="utf-8")
    with pytest.warns(DataWarning):
        recording = read(run, units=units | {"time": "s"})
    assert recording.sample_time == pytest.approx(0.1)
    assert np.array_equal(recording["pressure"], n)
