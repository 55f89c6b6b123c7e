"""Choosing channels and units, and what is done about missing samples."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording

N = 40
K = np.arange(N)
PRESSURE = (2 + np.sin(K / 4)).tolist()
POSITION = (10 + 3 * np.cos(K / 4)).tolist()


Write = Callable[..., Path]


@pytest.fixture
def table(tmp_path: Path) -> Write:
    """Write a file of the columns given and return its path."""

    def write(**columns: Sequence[object]) -> Path:
        path = tmp_path / "run.csv"
        header = ",".join(f'"{name}"' for name in columns)
        rows = [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
        path.write_text("\n".join([header, *rows]))
        return path

    return write


def blank(samples: Sequence[object], *places: int) -> list[object]:
    return ["" if k in places else sample for k, sample in enumerate(samples)]


def read_one(path: Path, **options: Any) -> Recording:
    (recording,) = mckibben.read(path, **options)
    return recording


# Columns -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["P2 [kPa]", "P2", "p2", "p2 [KPA]"])
def test_a_column_is_found_by_header_or_name(table: Write, name: str) -> None:
    path = table(**{"P1 [kPa]": PRESSURE, "P2 [kPa]": POSITION})
    recording = read_one(path, columns={"pressure": name})
    assert recording["pressure"] == pytest.approx(np.array(POSITION) / 100)
    assert list(recording.channels) == ["pressure_1", "pressure"]


def test_a_mapped_column_goes_before_an_alias(table: Write) -> None:
    path = table(position_mm=POSITION, x_mm=PRESSURE, displacement_mm=POSITION)
    recording = read_one(path, columns={"displacement": "x_mm"})
    assert recording["displacement"].tolist() == PRESSURE
    assert recording["position"].tolist() == POSITION
    assert recording.meta["ignored_columns"] == ["displacement_mm"]


def test_a_cell_that_is_no_number(table: Write) -> None:
    cells = [*PRESSURE[:7], "n.d.", *PRESSURE[8:]]
    for header, channels in (("pressure_bar", None), ("pressure_bar", ["pressure"]), ("a", ["a"])):
        with pytest.raises(DataError, match=r"'n\.d\.'") as caught:
            mckibben.read(table(**{header: cells, "b": POSITION}), channels=channels)
        assert (caught.value.channel, caught.value.row) == (header.partition("_")[0], 9)
    with pytest.warns(DataWarning, match=r"a .*'n\.d\.'"):
        recording = read_one(table(a=cells, b=POSITION))
    assert list(recording.channels) == ["b"]


# Units ---------------------------------------------------------------------------------------


# Missing samples -----------------------------------------------------------------------------


@pytest.mark.parametrize("cell", ["", "NaN", "inf", "-inf", "NA"])
def test_a_missing_sample_stops_by_default(table: Write, cell: str) -> None:
    cells = [*PRESSURE[:7], cell, *PRESSURE[8:]]
    with pytest.raises(DataError, match=r"1 of 40 .*--gaps interpolate") as caught:
        mckibben.read(table(pressure_bar=cells, force_N=POSITION))
    assert (caught.value.channel, caught.value.row) == ("pressure", 9)


def test_missing_samples_interpolated_and_ends_cut(table: Write) -> None:
    holes = (0, 1, 10, 11, 39)
    path = table(time_s=K / 10, pressure_bar=blank(PRESSURE, *holes), force_N=POSITION)
    with (
        pytest.warns(DataWarning, match=r" 2 .* 1 "),
        pytest.warns(DataWarning, match="2 missing sample"),
    ):
        recording = read_one(path, gaps="interpolate")
    assert recording.start_time == pytest.approx(0.2)
    assert recording.n_samples == 37
    whole = np.delete(K, holes)
    expected = np.interp(K[2:39], whole, np.array(PRESSURE)[whole])
    assert recording["pressure"] == pytest.approx(expected)
    assert recording["force"].tolist() == POSITION[2:39]


@pytest.mark.parametrize("timed", [True, False])
def test_missing_samples_split(table: Write, timed: bool) -> None:
    time = {"time_s": K / 10} if timed else {}
    path = table(**time, pressure_bar=blank(PRESSURE, 15), force_N=blank(POSITION, 16, 20))
    with pytest.warns(DataWarning, match="1 of 3 "):
        first, second = mckibben.read(path, gaps="split", rate=None if timed else 10)
    assert first["pressure"].tolist() == PRESSURE[:15]
    assert second["force"].tolist() == POSITION[21:]
    assert second.start_time == pytest.approx(2.1)
    assert (first.name, second.name) == ("run[1]", "run[2]")


def test_constant_channel_is_refused_only_where_asked_for(table: Write) -> None:
    path = table(pressure_bar=[1.5] * N, force_N=POSITION)
    assert read_one(path).n_samples == N
    assert read_one(path, channels=["force"]).n_samples == N
    with pytest.raises(DataError, match=r" 1\.5") as caught:
        mckibben.read(path, channels=["pressure"])
    assert caught.value.channel == "pressure"
