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


def test_what_was_held_is_a_channel_whatever_the_columns(table: Write) -> None:
    path = table(time_s=K * 0.1, pressure_bar=PRESSURE, force_N=PRESSURE)
    found = read_one(path, constants={"force": (200, "g"), "angle_1": (90, "deg")})
    assert found["force"].tolist() == pytest.approx([1.96133] * N)
    assert found["angle_1"].tolist() == pytest.approx([np.pi / 2] * N)
    assert found.units["force"] == "N"
    assert read_one(path, constants={"flow": (2, "")}, channels=["flow"])["flow"][0] == 2
    mckibben.write(found, path)
    assert read_one(path, constants={"force": (1, "kN")})["force"][0] == 1000
    with pytest.raises(DataError, match="load"):
        read_one(path, constants={"load": (1, "N")}, columns={"load": "force"})
    with pytest.raises(DataError, match="does not convert to N"):
        read_one(path, constants={"force": (1, "mm")})


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


def test_text_is_left_out_where_it_is_not_asked_for(table: Write) -> None:
    assert read_one(table(pressure=["up"] * N, b=POSITION)).meta["ignored_columns"] == ["pressure"]


def test_a_cell_that_is_no_number(table: Write) -> None:
    cells = [*PRESSURE[:7], "n.d.", *PRESSURE[8:]]
    for header, channels in (("pressure_bar", None), ("pressure_bar", ["b"]), ("a", ["a"])):
        with pytest.raises(DataError, match=r"'n\.d\.'") as caught:
            mckibben.read(table(**{header: cells, "b": POSITION}), channels=channels)
        assert (caught.value.channel, caught.value.row) == (header.partition("_")[0], 9)
    with pytest.warns(DataWarning, match=r"'a'.*'n\.d\.'"):
        recording = read_one(table(a=cells, b=POSITION))
    assert list(recording.channels) == ["b"]


# Units ---------------------------------------------------------------------------------------


def test_assumed_units_are_said_once(table: Write) -> None:
    with pytest.warns(DataWarning) as caught:
        read_one(table(pressure=PRESSURE, displacement=POSITION, level=POSITION))
    (warning,) = caught
    assert "pressure in bar, displacement in mm" in str(warning.message)
    assert "level" not in str(warning.message).partition(": ")[2]


@pytest.mark.parametrize(
    ("header", "factor", "suspected"), [("displacement", 1e-3, "m"), ("contraction", 1.0, "%")]
)
def test_other_units_are_suspected(
    table: Write, header: str, factor: float, suspected: str
) -> None:
    with pytest.warns(DataWarning, match=rf"{header}.* in {suspected}\?"):
        read_one(table(**{header: [factor * x for x in POSITION]}))


def test_pressures_of_hundreds_of_bar_are_not_believed(table: Write) -> None:
    path = table(pressure=[100 * p for p in PRESSURE])
    with pytest.raises(DataError, match="--unit pressure=kPa"):
        mckibben.read(path)
    assert read_one(path, units={"pressure": "kPa"})["pressure"] == pytest.approx(PRESSURE)


@pytest.mark.parametrize(
    ("per_bar", "fitting"), [(1e5, "Pa"), (100.0, "kPa or --unit pressure=psi"), (1e9, "mPa")]
)
def test_the_remedy_names_units_that_fit(table: Write, per_bar: float, fitting: str) -> None:
    path = table(pressure=[per_bar * p for p in PRESSURE])
    with pytest.raises(DataError) as refused:
        mckibben.read(path)
    assert refused.value.remedy.endswith(f"--unit pressure={fitting}")


def test_given_units_go_before_the_header(table: Write) -> None:
    recording = read_one(table(pressure_bar=PRESSURE), units={"pressure": "psi"})
    assert recording["pressure"] == pytest.approx(0.0689475729 * np.array(PRESSURE))


@pytest.mark.parametrize(
    ("header", "units", "named"),
    [("force [kg]", {}, "'kg'"), ("pressure", {"pressure": "stone"}, "'stone'")],
)
def test_wrong_units(table: Write, header: str, units: dict[str, str], named: str) -> None:
    with pytest.raises(DataError, match=named):
        mckibben.read(table(**{header: PRESSURE}), units=units)


def test_gauge_pressure_is_noted_and_no_offset_removed(table: Write) -> None:
    recording = read_one(table(**{"p (barg)": PRESSURE}))
    assert recording["pressure"].tolist() == PRESSURE
    assert recording.meta["pressure_reference"] == {"pressure": "gauge"}


def test_other_channels_keep_units_that_the_package_has_none_for(table: Write) -> None:
    recording = read_one(
        table(**{"flow (l/min)": PRESSURE, "gain (foo)": PRESSURE, "speed (cm/s)": PRESSURE})
    )
    assert dict(recording.units) == {"flow": "l/min", "gain": "foo", "velocity": "mm/s"}
    assert recording["flow"].tolist() == PRESSURE


# Missing samples -----------------------------------------------------------------------------


@pytest.mark.parametrize("cell", ["", "NaN", "inf", "-inf", "NA"])
def test_a_missing_sample_stops_by_default(table: Write, cell: str) -> None:
    cells = [*PRESSURE[:7], cell, *PRESSURE[8:]]
    with pytest.raises(DataError, match=r"1 of 40 .*--gaps interpolate") as caught:
        mckibben.read(table(pressure_bar=cells, force_N=POSITION))
    assert (caught.value.channel, caught.value.row) == ("pressure", 9)


def test_missing_samples_of_a_channel_not_asked_for(table: Write) -> None:
    path = table(pressure_bar=PRESSURE, force_N=blank(POSITION, 3))
    with pytest.warns(DataWarning, match="'force'.*: 1"):
        assert list(read_one(path, channels=["pressure"]).channels) == ["pressure"]


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


def test_a_short_or_constant_recording_is_one_where_nothing_is_learned(table: Write) -> None:
    path = table(pressure_bar=[2.0] * 3, time_s=[0.0, 0.1, 0.2])
    with pytest.raises(DataError, match="10"):
        mckibben.read(path, channels=["pressure"])
    recording = read_one(path, channels=["pressure"], informative=False)
    assert recording["pressure"].tolist() == [2.0] * 3
