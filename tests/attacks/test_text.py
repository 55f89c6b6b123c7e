"""Text tables that would be read silently wrong, slowly, or into the terminal.

Marks between thousands, units and times that cannot be, endless headers, lines and units, signs that
steer a terminal; and that what was assumed while reading stays with the recording.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files import stored
from mckibben.files.delimited import sidecar
from mckibben.files.headers import channel_of, parse
from mckibben.files.units import find

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


@pytest.fixture(autouse=True, scope="module")
def warm(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Import what reading needs, which is no matter of the attacks."""
    read(table(tmp_path_factory.mktemp("warm"), "p_kPa", TIME))


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Fail where what is inside takes many times longer than it should: bounds tell orders."""
    began = time.process_time()
    yield
    assert time.process_time() - began < seconds


# Marks -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("separator", [";", "\t", "|"])
@pytest.mark.parametrize("mark", [",", ".", "'", "’", " ", "\xa0", "\u2009", "\u202f", "_"])
@pytest.mark.parametrize("more", [0, 1000])
def test_marks_of_thousands_are_not_read_as_anything(
    tmp_path: Path, separator: str, mark: str, more: int
) -> None:
    cells = [f"{size + more:,}".replace(",", mark) for size in SIZES]
    path = table(tmp_path, "pressure (mbar)", cells, separator)
    if mark == "." and more:  # every number has three digits after the mark: decimals
        with pytest.warns(DataWarning, match=r"'pressure \(mbar\)'.* 1.900 is 1.9, not 1900"):
            assert read(path)["pressure"] == pytest.approx((np.array(SIZES) + 1000) / 1e6)
        return
    with pytest.raises(DataError, match="write numbers without marks") as caught:
        read(path)
    assert (caught.value.channel, caught.value.row) == ("pressure", 2 if more else 12)


@pytest.mark.parametrize("separator", [",", ";"])
def test_quoted_thousands_are_refused(tmp_path: Path, separator: str) -> None:
    path = table(tmp_path, "pressure (mbar)", [f'"{size:,}"' for size in SIZES], separator)
    with pytest.raises(DataError, match=r"'pressure', row 12: '1,000' may"):
        read(path)


def test_decimal_commas_that_may_be_of_thousands(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{k / 100:.2f};{size:,}".replace(".", ",") for k, size in enumerate(SIZES)]
    path.write_text("\n".join(["time_s;pressure (mbar)", *rows]))
    with pytest.raises(DataError, match=r"row 12: in column 'pressure \(mbar\)', '1,000' may be"):
        read(path)


@pytest.mark.parametrize("cell", ["1,234,567", "1.234.567", "12,34,567", "1,234.5", "1.234,5"])
def test_several_marks_in_one_number_are_refused(tmp_path: Path, cell: str) -> None:
    path = table(tmp_path, "pressure (Pa)", [f'"{cell}"'] * N)
    with pytest.raises(DataError, match=r"'pressure', row 2: .* may mean several numbers"):
        read(path)


def test_a_channel_beside_those_needed_is_left_out_and_said(tmp_path: Path) -> None:
    cells = [f"{k}.5;{size:,}" for k, size in enumerate(SIZES)]
    path = table(tmp_path, "x;y", cells)
    with pytest.warns(DataWarning, match="'y' is left out: '1,000' may mean several"):
        recording = read(path)
    assert list(recording.channels) == ["x"]
    assert "'y' is left out" in recording.notes[0]
    with pytest.raises(DataError, match="'y', row 12"):
        read(path, channels=["y"])


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
            with pytest.raises(DataError, match=r"row 2: in column 'x', '1.125' may be .* 1125"):
                read(path, channels=["x"])


def test_numbers_with_odd_blanks_are_numbers(tmp_path: Path) -> None:
    cells = [f"\xa0{k}.5\u202f" for k in range(N)]
    assert read(table(tmp_path, "x", cells))["x"].tolist() == [k + 0.5 for k in range(N)]


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
    with pytest.raises(DataError, match="which cannot be") as caught:
        read(path)
    assert remedy in caught.value.remedy


def test_a_travel_in_metres_under_millimetres_is_doubted(tmp_path: Path) -> None:
    travel = [f"{0.02 * k / N:.6f}" for k in range(N)]
    with pytest.warns(DataWarning, match=r"travels 0.0195 mm in all; where it is in m, use --unit"):
        read(table(tmp_path, "displacement_mm", travel))
    read(table(tmp_path, "displacement_m", travel))


@pytest.mark.parametrize(("channel", "unit"), [("pressure", "mPa"), ("displacement", "Gm")])
def test_given_units_that_cannot_be_stop(tmp_path: Path, channel: str, unit: str) -> None:
    path = table(tmp_path, channel, [f"{1 + k / 7:.4f}" for k in range(N)])
    with pytest.raises(DataError, match=f"'{channel}', row .*which cannot be.*--unit {channel}="):
        read(path, units={channel: unit})


@pytest.mark.parametrize(
    ("header", "cell"),
    [("pressure (mPa)", "0"), ("p [bar]", "1e-17"), ("p [Pa]", "2.5"), ("force (mN)", "1e-4")],
)
def test_nothing_rounding_and_small_values_are_read(tmp_path: Path, header: str, cell: str) -> None:
    assert len(read(table(tmp_path, header, [cell] * N))) == N


def test_what_this_package_wrote_is_not_judged(tmp_path: Path) -> None:
    recording = Recording({"pressure": np.linspace(0, 1e300, N)})
    mckibben.write(recording, tmp_path / "a.csv")
    assert read(tmp_path / "a.csv") == recording


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
    with pytest.warns(DataWarning, match=f"counted in {unit} since 1970.*--unit time="):
        recording = read(timed(tmp_path, "timestamp", times))
    assert recording.sample_time == pytest.approx(0.01, rel=1e-3)
    assert read(timed(tmp_path, f"time_{unit}", times)).sample_time == pytest.approx(0.01, rel=1e-3)
    with pytest.raises(DataError, match=f"which cannot be.*--unit time={unit}"):
        read(timed(tmp_path, "time_s", times))


@pytest.mark.parametrize("first", [45000, 739000])
def test_days_are_not_taken_for_seconds(tmp_path: Path, first: int) -> None:
    times = [f"{first + k * 1e-5:.5f}" for k in range(N)]
    with pytest.raises(DataError, match=r"may be days.*--unit time=day or --unit time=s"):
        read(timed(tmp_path, "time", times))
    recording = read(timed(tmp_path, "time", times), units={"time": "day"})
    assert recording.sample_time == pytest.approx(0.864)
    assert read(timed(tmp_path, "time_s", times)).sample_time == 1e-5


@pytest.mark.parametrize("first", [20260131120000, 133500000000000000, 638000000000000000])
def test_other_clocks_stop(tmp_path: Path, first: int) -> None:
    with pytest.raises(DataError, match=r"'time', row .*which cannot be"):
        read(timed(tmp_path, "time", [first + 100 * k for k in range(N)]))


def test_a_clock_that_has_run_long_is_in_seconds(tmp_path: Path) -> None:
    with pytest.warns(DataWarning, match="time in s"):
        recording = read(timed(tmp_path, "time", [f"{45000 + k / 100:.2f}" for k in range(N)]))
    assert recording.sample_time == 0.01


@pytest.mark.parametrize(
    "text",
    [
        "k" * 50_000_000,
        "k" + " " * 5_000_000 + "x",
        "10**10**10",
        "m**9999999",
        "(" * 20 + "m" + ")" * 20,
        "a" + "  a" * 12 + ";",
    ],
)
def test_hostile_units_are_none(text: str) -> None:
    with within(1.0):
        assert find(text) is None


def test_a_hostile_unit_is_refused_in_a_short_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="is unknown") as caught:
        read(table(tmp_path, "pressure", TIME), units={"pressure": "k" * 10_000_000})
    assert len(str(caught.value)) < 1000


# Length --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["pressure" + " " * 40_000 + "(bar", "p" + "_" * 40_000, "1" * 40_000 + "x", "a " * 40_000],
)
def test_long_headers_take_no_time(tmp_path: Path, text: str) -> None:
    with within(3.0):
        channel_of(parse(text))
        with pytest.raises(DataError, match=r"shorten it|columns"):
            read(table(tmp_path, text, TIME))
        with suppress(DataError):  # between blanks, it may be one header in several words
            read(table(tmp_path, text, TIME, " "))


def test_lines_and_columns_have_an_end(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with within(5.0):
        path.write_text("p_bar\n" + "1" * 20_000_000 + "\n1\n")
        with pytest.raises(DataError, match="row 2: the line has 20000000 bytes"):
            read(path)
        path.write_text("\n".join([",".join("x" * 20_000)] + [",".join("1" * 20_000)] * 12))
        with pytest.raises(DataError, match="20000 columns are more than"):
            read(path)


def test_many_columns_are_read_and_listed_shortly(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    header = ",".join(f"p{k}" for k in range(500))
    path.write_text("\n".join([header, *[",".join(["1.5"] * 500)] * 12]))
    with pytest.warns(DataWarning, match="and 470 more") as caught:
        assert len(read(path).channels) == 500
    assert all(len(str(warning.message)) < 2000 for warning in caught)
    with pytest.raises(DataError, match=r"there are p0, .* and 470 more"):
        read(path, columns={"force": "f"})


MEMORY = """
import re, sys
from pathlib import Path
import pandas, mckibben.files.delimited as delimited
def peak():
    return int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])
before = peak()
for path in sys.argv[1:]:
    with open(path, "rb") as file:
        (table,) = delimited.read(file, Path(path))
print(1024 * (peak() - before))
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is not told here")
def test_memory_is_a_small_multiple_of_the_file(tmp_path: Path) -> None:
    paths = [tmp_path / "numbers.csv", tmp_path / "words.csv"]
    for path, form in zip(paths, ("%.7f", "w%09.0f"), strict=True):
        cells = np.char.mod(form, np.arange(200_000) / 7.0).tolist()
        path.write_text("\n".join(["a,b,c", *(f"{cell},{cell},{cell}" for cell in cells)]))
    done = subprocess.run(
        [sys.executable, "-c", MEMORY, *map(str, paths)], capture_output=True, text=True, check=True
    )
    assert int(done.stdout) < 12 * paths[0].stat().st_size


# Signs ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", ["\x9b31m", "\u202e", "\u200b", "\u2028"])
def test_signs_that_cannot_be_printed_do_not_get_into_names(tmp_path: Path, sign: str) -> None:
    path = table(tmp_path, f"x{sign}y (a{sign})", TIME)
    recording = read(path)
    assert all(map(str.isprintable, (*recording.channels, *recording.units.values())))
    with pytest.raises(DataError) as caught:
        read(path, columns={"force": "none"})
    assert str(caught.value).isprintable()


def test_escapes_are_no_text(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="not text"):
        read(table(tmp_path, "\x1b[31mpressure", TIME))


def test_escapes_in_other_formats_are_written_out(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x\x1b[2J"] = np.arange(N, dtype=float)
        file.attrs["rig"] = "\x1b[31mred"
    recording = read(tmp_path / "a.h5")
    assert list(recording.channels) == ["x_x1b_2j"]
    assert recording.meta["rig"] == "\\x1b[31mred"


def test_a_sidecar_with_escapes_is_ignored(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    mckibben.write(Recording({"pressure": np.arange(N, dtype=float)}), path)
    described = json.loads(sidecar(path).read_text())
    described["units"] = {"pressure\x1b[31m": "bar"}
    assert stored.parse(json.dumps(described)) == "its names cannot be printed"
    with pytest.raises(DataError, match="no unit can be"):
        mckibben.write(Recording({"x": np.arange(N, dtype=float)}, units={"x": "\x1b[2J"}), path)


# Notes ---------------------------------------------------------------------------------------------


def test_notes_of_reading_stay_with_the_recording(tmp_path: Path) -> None:
    path = table(tmp_path, "pressure;x", [f"{k / 8};{'off' if k == 3 else k}" for k in range(N)])
    with pytest.warns(DataWarning) as caught:
        recording = read(path)
    assert [f"{path}: {note}" for note in recording.meta["notes"]] == [
        str(warning.message) for warning in caught
    ]
    assert len(recording.notes) == 2
    for ending in (".csv", ".parquet"):
        mckibben.write(recording, tmp_path / f"b{ending}")
        again = read(tmp_path / f"b{ending}")
        assert again == recording
        assert again.notes == recording.notes


def test_notes_of_the_one_who_recorded_are_kept(tmp_path: Path) -> None:
    given = Recording({"pressure": np.arange(N) / 8}, meta={"notes": "hand-held"})
    mckibben.write(given, tmp_path / "a.csv")
    assert read(tmp_path / "a.csv") == given
    sidecar(tmp_path / "a.csv").unlink()
    with pytest.warns(DataWarning):
        assert len(read(tmp_path / "a.csv").notes) == 1
    assert given.notes == ("hand-held",)
