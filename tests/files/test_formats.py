"""Binary formats, written here by the libraries that other programs use."""

from __future__ import annotations

import datetime
import pickle
import struct
from collections.abc import Callable, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from nptdms import TdmsFile
from scipy.io import savemat
from scipy.sparse import csc_array

import mckibben
from mckibben import DataWarning, Recording
from mckibben.arrays import Array
from tests.files.made import columns, one, refused, table, tdms
from tests.refusals import mentions

K = np.arange(40.0)
P = 100 * (1 + np.sin(K / 6))
X = 2 * np.sin(K / 6 - 0.5)
T = K / 50
BOTH = np.column_stack([P, X])


def check(recording: Recording) -> None:
    """Compare with the pressure of ``P`` in kPa and the displacement of ``X`` in cm."""
    assert recording.sample_time == 0.02
    assert recording["pressure"] == pytest.approx(P / 100)
    assert recording["displacement"] == pytest.approx(10 * X)
    assert recording.units["displacement"] == "mm"


# Matrices and scalars --------------------------------------------------------------------------

GIVEN: dict[str, Any] = {"units": {"time": "s", "pressure": "kPa", "displacement": "cm"}}
FILES = ["old.mat", "new.mat", "struct.mat", "a.h5"]


def write(path: Path, **variables: Array | float) -> Path:
    """Write variables as MATLAB of several versions does, or as HDF5 in a group."""
    if path.suffix == ".mat":
        content = {"run": variables} if path.stem == "struct" else variables
        savemat(path, content, format="4" if path.stem == "old" else "5")
    else:
        with h5py.File(path, "w") as file:
            for name, values in variables.items():
                file[f"run/{name}"] = values
    return path


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("transposed", [False, True])
def test_columns_of_a_matrix_are_named_by_number(
    tmp_path: Path, name: str, transposed: bool
) -> None:
    matrix = np.column_stack([T, BOTH])
    path = write(tmp_path / name, data=matrix.T if transposed else matrix)
    named = {"time": "data[1]", "pressure": "data[2]", "displacement": "data[3]"}
    recording = one(path, columns=named, **GIVEN)
    check(recording)
    assert list(recording.channels) == ["pressure", "displacement"]
    assert "data[1]" in str(refused(path, columns={"pressure": "data"}))


def test_a_matrix_goes_with_vectors_of_its_length(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mat", data=BOTH, t=T, gains=T[:3], table=np.ones((20, 2)))
    recording = one(path, **GIVEN, columns={"pressure": "data[1]", "displacement": "data[2]"})
    check(recording)
    assert recording.meta["ignored_columns"] == ["gains", "table[1]", "table[2]"]


@pytest.mark.parametrize("shape", [(40, 40), (40, 5), (65, 1000), (40, 2, 2)])
@pytest.mark.parametrize("name", ["a.mat", "a.h5"])
def test_other_matrices_are_no_channels(tmp_path: Path, name: str, shape: tuple[int, ...]) -> None:
    path = write(tmp_path / name, data=np.ones(shape))
    assert refused(path).file == path


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize(
    "scalars",
    [{"dt": 0.02}, {"SampleRate": 50}, {"fs": 50, "Ts": 0.02}],
    ids=lambda scalars: "+".join(scalars),
)
def test_a_scalar_is_the_sample_time(tmp_path: Path, name: str, scalars: dict[str, float]) -> None:
    path = write(tmp_path / name, p_kPa=P, disp_cm=X, **scalars)
    with pytest.warns(DataWarning) as caught:
        (recording,) = mckibben.read(path)
    check(recording)
    assert len(recording.notes) == len(caught) == 1
    assert mentions(recording.notes[0], 0.02)
    assert one(path, rate=25).sample_time == 0.04


@pytest.mark.parametrize("name", ["old.mat", "a.h5"])
@pytest.mark.parametrize("scalars", [{"fs": 50.0, "dt": 0.01}, {"Ts": -0.02}, {"fs": np.nan}])
def test_impossible_scalars_are_refused_where_they_count(
    tmp_path: Path, name: str, scalars: dict[str, float]
) -> None:
    path = write(tmp_path / name, p_kPa=P, disp_cm=X, **scalars)
    error = refused(path)
    last, value = [*scalars.items()][-1]
    assert f"{last} = {value}" in error.problem
    assert "`rate`" in error.remedy
    check(one(path, rate=50))
    check(one(write(path, p_kPa=P, disp_cm=X, time_s=T, **scalars)))


# TDMS ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("step", "late_us"), [(0.02, 0), (0.05, 0), (0.02, 30_000)], ids=["alike", "slower", "later"]
)
def test_channels_of_tdms_have_the_clocks_that_the_file_states(
    tmp_path: Path, step: float, late_us: int
) -> None:
    began = np.datetime64("2026-01-31T12:00:00.123456")
    clock = {"wf_start_offset": 0.5, "wf_increment": 0.02, "wf_start_time": began}
    other = clock | {"wf_increment": step, "wf_start_time": began + np.timedelta64(late_us, "us")}
    path = tdms(
        tmp_path / "a.tdms",
        pressure=(P, {"unit_string": "kPa", **clock}),
        displacement=(X, {"unit_string": "cm", **other}),
        force=(P[:0], {}),
        valve=(np.array(["up", "down"]), {}),
    )
    recording = one(path)
    assert recording.meta["ignored_columns"] == ["force", "valve"]
    exact = np.interp(recording.time, 0.5 + 0.02 * K, P) / 100
    assert recording["pressure"] == pytest.approx(exact)
    if (step, late_us) == (0.02, 0):
        assert recording.start_time == 0.5
        check(recording)
        return
    for name, column in columns(path).items():  # as nptdms has them
        track = TdmsFile.read(path)["run"][name].time_track(absolute_time=True) - began
        assert column.times == pytest.approx(track.astype("m8[ns]").astype(float) * 1e-9, abs=1e-9)


def test_a_channel_of_tdms_without_a_clock_is_left_out_where_others_differ(tmp_path: Path) -> None:
    clocks = {"pressure": {"wf_increment": 0.02}, "force": {"wf_increment": 0.05}, "angle": {}}
    path = tdms(tmp_path / "a.tdms", **{name: (P, clock) for name, clock in clocks.items()})
    assert list(columns(path)) == ["pressure", "force"]
    assert list(table(path).unread) == ["angle"]


# Spreadsheets ----------------------------------------------------------------------------------

NAMES: list[list[Any]] = [["time_s", "pressure_kPa", "displacement_cm"]]
SOUND: list[list[Any]] = [*map(list, zip(T, P, X, strict=True))]


def book(path: Path, **sheets: Sequence[Sequence[Any]]) -> Path:
    made = openpyxl.Workbook(write_only=True)
    for name, rows in sheets.items():
        sheet = made.create_sheet(name)
        for row in rows:
            sheet.append(row)
    made.save(path)
    return path


@pytest.mark.parametrize(
    "instant",
    [
        lambda k: datetime.datetime(2026, 1, 31, 12) + datetime.timedelta(milliseconds=20 * k),
        lambda k: (datetime.datetime(2026, 1, 31, 12) + datetime.timedelta(seconds=k / 50)).time(),
        lambda k: datetime.timedelta(milliseconds=20 * k),
        lambda k: f"31.01.2026 12:00:{k / 50:06.3f}",
    ],
)
def test_dates_are_times(tmp_path: Path, instant: Any) -> None:
    rows = [["time", "p_kPa", "Weg_cm"], *([instant(k), P[k], X[k]] for k in range(40))]
    check(one(book(tmp_path / "a.xlsx", Data=rows)))


@pytest.mark.parametrize(
    "above",
    [
        [["operator", "A", "run", 3]],
        [["Load (kg)", 5], ["Date", datetime.datetime(2026, 1, 31)], []],
        [["a bench", None, "of nobody"], ["pressure", "in", "steps"], ["pressure"], []],
    ],
)
@pytest.mark.parametrize("units", [None, ["[s]", "(kPa)", None], [None, "kPa"]])
def test_titles_are_passed_over_units_read_and_other_sheets_listed(
    tmp_path: Path, above: list[list[Any]], units: list[Any] | None
) -> None:
    names = NAMES if units is None else [["t", "p", "Weg [cm]"], units]
    rows = [*above, *names, *SOUND]
    recording = one(book(tmp_path / "a.xlsx", Notes=[["pressure"]], Run=rows))
    check(recording)
    assert recording.meta["ignored_columns"] == ["Notes"]


@pytest.mark.parametrize("wanted", [None, "Run", "Table"])
def test_the_sheet_with_most_rows_of_numbers_is_read_or_the_one_named(
    tmp_path: Path, wanted: str | None
) -> None:
    days = [[datetime.datetime(2026, 1, 1 + k // 3), "what was done", "by A"] for k in range(90)]
    table: list[list[Any]] = [["V", "bar"], *([k / 10, k] for k in range(20))]
    path = book(tmp_path / "a.xlsx", Diary=days, Table=table, Run=[*NAMES, *SOUND])
    toml = tmp_path / "channels.toml"
    for described in (None, "Run", "Diary"):
        toml.write_text("" if described is None else f'sheet = "{described}"\n')
        if wanted is None and described == "Diary":
            assert refused(path).file == path
            continue
        recording = one(path, sheet=wanted)
        others = {"Diary", "Table", "Run"} - {wanted or "Run"}
        assert set(recording.meta["ignored_columns"]) == others
        if wanted == "Table":
            assert recording["pressure"].tolist() == [*range(20)]
        else:
            check(recording)
    error = refused(path, sheet="Results")
    assert error.parameter == "sheet"
    assert "Diary, Table, Run" in error.remedy
    (tmp_path / "a.csv").write_text("time_s,p_bar\n" + "".join(f"{t},{p}\n" for t, p, _ in SOUND))
    assert refused(tmp_path / "a.csv", sheet="Run").parameter == "sheet"


def test_sheets_with_the_same_columns_are_recordings(tmp_path: Path) -> None:
    other = [[t, p / 2, x] for t, p, x in SOUND[:-10]]
    path = book(tmp_path / "a.xlsx", First=[*NAMES, *SOUND], Second=NAMES + other)
    first, second = mckibben.read(path)
    check(first)
    assert len(second) == len(other)
    assert {one.meta["name"] for one in (first, second)} == {"a[First]", "a[Second]"}
    check(one(path, sheet="First"))


def test_structs_alike_with_times_of_their_own_are_recordings(tmp_path: Path) -> None:
    runs = [{"name": f"run{k}", "t_s": T, "p_kPa": P / k, "Weg_cm": X} for k in (1, 2, 3)]
    savemat(tmp_path / "a.mat", {"runs": runs})
    first, *others = mckibben.read(tmp_path / "a.mat")
    check(first)
    assert [one.meta["name"] for one in others] == ["a[run2]", "a[run3]"]
    assert others[0]["pressure"].max() == pytest.approx(first["pressure"].max() / 2)


@pytest.mark.parametrize(
    "text",
    ["{:.4f}".format, "{:.4f} kPa".format, lambda value: f"{value:.4f}".replace(".", ","),
     lambda value: f"{value:.6E}".replace("E", "D"), lambda value: f"{value:.1f}".replace(".", ",")],
)  # fmt: skip
def test_numbers_that_are_text_are_read(tmp_path: Path, text: Callable[[float], str]) -> None:
    rows = [[t, text(p), x] for t, p, x in SOUND]
    recording = one(book(tmp_path / "a.xlsx", Run=[*NAMES, *rows]))
    assert recording["pressure"] == pytest.approx(P / 100, abs=6e-4)


@pytest.mark.parametrize("cell", ["1,5", "1.234", "1'000", "off"])
@pytest.mark.parametrize("row", [1, 20])
def test_text_that_may_be_several_numbers_is_refused(tmp_path: Path, cell: str, row: int) -> None:
    rows = [*NAMES, *map(list, SOUND)]
    rows[10][1] = str(P[9])  # which is a number
    check(one(book(tmp_path / "a.xlsx", Data=rows)))
    rows[row][1] = cell
    error = refused(book(tmp_path / "a.xlsx", Data=rows))
    assert (error.channel, error.row) == ("pressure", row + 1)
    assert cell in error.problem


# Trees of groups and structs -------------------------------------------------------------------


def structs(names: str, *rows: tuple[Any, ...]) -> Any:
    """Return a struct array."""
    made = np.zeros((1, len(rows)), [(name, "O") for name in names.split()])
    for i, row in enumerate(rows):
        made[0, i] = row
    return made


def cell(*elements: Any) -> Any:
    """Return a cell array."""
    made = np.empty(len(elements), dtype=object)
    made[:] = elements
    return made


def write_73(path: Path, tree: dict[str, Any]) -> None:
    """Write a tree as MATLAB 7.3 does: text as numbers; struct arrays and cells as references."""

    def store(group: Any, name: str, value: Any) -> Any:
        if isinstance(value, dict):
            made, kind = group.create_group(name), "struct"
            for inner, each in value.items():
                store(made, inner, each)
        elif isinstance(value, str):
            letters = np.frombuffer(value.encode("utf-16-le"), "<u2")
            made, kind = group.create_dataset(name, data=letters.reshape(-1, 1)), "char"
        elif np.asarray(value).dtype.names:
            made, kind = group.create_group(name), "struct"
            for inner in value.dtype.names:
                refer(made, inner, value[inner].reshape(-1))
        elif value.dtype == object:
            made, kind = refer(group, name, value), "cell"
        else:
            made, kind = group.create_dataset(name, data=np.atleast_2d(value).T), "double"
        made.attrs["MATLAB_class"] = np.bytes_(kind)
        return made

    def refer(group: Any, name: str, values: Any) -> Any:
        made = group.create_dataset(name, (len(values), 1), h5py.ref_dtype)
        for i, value in enumerate(values):
            made[i, 0] = store(referred, f"{len(referred)}", value).ref
        return made

    with h5py.File(path, "w", userblock_size=512) as file:
        referred = file.create_group("#refs#")
        for name, value in tree.items():
            store(file, name, value)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes()[512:])


VERSIONS: dict[str, Callable[[Path, dict[str, Any]], None]] = {"5": savemat, "7.3": write_73}
CONVENTIONS: dict[str, dict[str, Any]] = {
    "structs": {"run": {"time_s": T, "signals": {"p_kPa": P, "disp_cm": X}}},
    "ControlDesk": {"exp1": {
        "X": {"Name": "time", "Unit": "s", "Data": T},
        "Y": structs("Name Unit Data", ("pressure", "kPa", P), ("displacement", "cm", X))}},
    "one X of many": {"e": {
        "X": structs("Name Data", ("time", T)),
        "Y": structs("Name Unit Data", ("p", "kPa", P), ("pos", "cm", X))}},
    "a struct a signal": {
        "pressure": {"t": T, "y": P, "unit": "kPa"},
        "displacement": {"t": T, "y": X, "unit": "cm"}},
    "Simulink": {"out": {
        "time": T, "blockName": "model/log",
        "signals": structs("values label", (P[:, None], "p [kPa]"), (X[:, None], "pos [cm]"))}},
    "Simulink's matrix": {"out": {
        "time": T, "signals": {"values": BOTH, "label": cell("p_kPa", "pos_cm")}}},
    "units": {"t": T, "p": P, "pos": X, "units": {"p": "kPa", "pos": "cm"}},
    "a struct of units": {"run": {"t": T, "p": P, "pos": X}, "einheit": {"p": "kPa", "pos": "cm"}},
    "a struct a unit": {
        "run": {"t": T, "p": P, "pos": X},
        "kanaele": {"p": {"unit": "kPa"}, "pos": {"unit": "cm", "range": np.arange(2.0)}}},
    "time series": {
        name: {"Time": 1000 * T, "TimeInfo": {"Units": "ms"}, "Data": each, "DataInfo": {"Units": unit}}
        for name, each, unit in (("p", P, "kPa"), ("pos", X, "cm"))},
    "names": {"t": T, "data": BOTH, "names": cell("p", "pos"), "units": cell("kPa", "cm")},
    "cells": {"t": T, "log": cell({"p_kPa": P}, {"pos_cm": X})},
    "a struct a sample": {"s": structs("t p_kPa pos_cm", *map(tuple, np.column_stack([T, BOTH])))},
}  # fmt: skip


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("version", VERSIONS)
def test_signals_are_found_where_programs_put_them(
    tmp_path: Path, convention: str, version: str
) -> None:
    VERSIONS[version](tmp_path / "a.mat", CONVENTIONS[convention])
    recording = one(tmp_path / "a.mat", channels=["pressure", "displacement"])
    check(recording)
    assert set(recording.channels) == {"pressure", "displacement"}
    assert not table(tmp_path / "a.mat").unread


def test_a_column_is_found_by_its_place(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", CONVENTIONS["ControlDesk"])
    places = {"pressure": "exp1.Y(1).Data", "displacement": "exp1.Y(2).Data"}
    check(one(tmp_path / "a.mat", columns=places))


@pytest.mark.parametrize("version", VERSIONS)
def test_vectors_have_the_times_nearest_to_them(tmp_path: Path, version: str) -> None:
    path, slow = tmp_path / "a.mat", np.arange(30.0)
    tree = {
        "pressure": {"t": T, "y": P},
        "displacement": {"t_ms": 100 * slow, "y": slow**2},
        "other": np.ones(40),
    }
    VERSIONS[version](path, tree)
    found = columns(path)
    assert sorted(found) == ["displacement.y", "pressure.y"]
    assert found["pressure.y"].times == pytest.approx(T)
    assert found["displacement.y"].times == pytest.approx(slow / 10)
    assert list(table(path).unread) == ["other"]  # without times, where others have their own


def test_a_name_that_several_groups_have_is_used_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, each in {"one/p_kPa": P, "one/q7": P, "two/p_kPa": 2 * P, "two/q7": X}.items():
            file[name] = each
        file["disp_cm"] = X
    assert "'one/p_kPa' and 'two/p_kPa'" in refused(path).problem
    recording = one(path, rate=50, columns={"pressure": "two/p_kPa"})
    assert recording["pressure"] == pytest.approx(P / 50)
    assert {"one_q7", "two_q7"} < set(recording.channels)


def opaque(name: bytes, kind: bytes) -> bytes:
    """Return a variable of version 5 that is an object, as tables and time series are."""

    def element(code: int, content: bytes) -> bytes:
        return struct.pack("<II", code, len(content)) + content + b"\0" * (-len(content) % 8)

    numbers = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 1, 1))
    numbers += element(1, b"") + element(6, b"\0\0\0\0")
    head = element(6, struct.pack("<II", 17, 0)) + element(1, name) + element(1, b"MCOS")
    return element(14, head + element(1, kind) + element(14, numbers))


def test_what_holds_numbers_and_is_not_read_is_listed(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    other: dict[str, Any] = {"z": P * 1j, "m": np.ones((9, 9)), "sp": csc_array(np.eye(3))}
    other |= {"log": np.array([["t", "p"], [1.0, 2.0]], dtype=object), "words": ["up", "down"]}
    reasons = {
        "run.z": "complex", "run.m": "9 x 9", "run.sp": "sparse", "run.log{1}": "text and numbers",
        "run.log{2}": "text and numbers", "run.words": "text", "tab": "class table",
    }  # fmt: skip
    savemat(path, {"p": P, "fast": np.ones(90), "run": other})
    path.write_bytes(path.read_bytes() + opaque(b"tab", b"table"))
    unread = table(path).unread
    assert unread.keys() == reasons.keys()
    assert all(reasons[name] in unread[name] for name in reasons)
    savemat(path, {"run": other})
    assert "run.z" in refused(path).problem


def test_complex_numbers_without_an_imaginary_part_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"p": P, "x": X})
    content = bytearray(path.read_bytes())
    content[128 + 17] |= 8  # the flag of the first variable
    path.write_bytes(content)
    assert refused(path).file == path


@pytest.mark.parametrize("change", [{16: 15}, {16: 4, 28: 1}, {12: 16}], ids=str)
def test_arrays_in_which_scipy_would_read_on_are_refused(
    tmp_path: Path, change: dict[int, int]
) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"run": {"c": cell(np.empty((0, 1), object), X), "p_kPa": P}})
    assert one(path)["pressure"] == pytest.approx(P / 100)
    content = bytearray(path.read_bytes())
    empty = content.index(struct.pack("<IIIII", 14, 40, 6, 8, 1))  # class, size of the shape, flags
    for at, value in change.items():
        content[empty + at] = value
    path.write_bytes(content)
    assert refused(path).file == path


def test_variables_of_one_name_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"p": P})
    path.write_bytes(path.read_bytes() + path.read_bytes()[128:])
    assert refused(path).file == path


# HDF5 and Parquet ------------------------------------------------------------------------------


def test_fields_of_a_table_in_hdf5_are_columns(tmp_path: Path) -> None:
    kind = [("t", "f8"), ("p_kPa", ">f4"), ("mark", "S3"), ("values_block_0", "f8", 2)]
    rows = np.zeros(40, kind)
    rows["t"], rows["p_kPa"], rows["values_block_0"] = T, P, BOTH
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log"] = rows
        file["disp_cm"] = X
        file["names"] = ["a", "b"]
        file["log"].attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(["p", "pos"]))
    recording = one(tmp_path / "a.h5", channels=["pressure", "displacement"])
    assert recording["pressure"] == pytest.approx(P / 100, rel=1e-6)
    assert recording["displacement"] == pytest.approx(10 * X)
    found = columns(tmp_path / "a.h5")
    headers = ["disp_cm", "t", "p_kPa", "values_block_0[1]", "values_block_0[2]", "mark"]
    assert list(found) == headers
    assert found["values_block_0[2]"].values == pytest.approx(X)


def test_links_of_hdf5_do_not_lead_out_of_a_file_nor_round_in_it(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = K
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["b"] = K**2
        file["again"] = file["b"]
        file["round"] = file["/"]
        file["out"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "a")
        file["soft"] = h5py.SoftLink("/out")
        for name, kind in (("r", h5py.ref_dtype), ("v", h5py.vlen_dtype("f8"))):
            file.create_dataset(name, (20,), kind)
    recording = one(tmp_path / "a.h5")
    assert recording["again"].tolist() == (K**2).tolist()
    assert list(recording.channels) == ["again"]
    assert sorted(recording.meta["ignored_columns"]) == ["out", "r", "v"]


def test_packed_numbers_of_hdf5_are_not_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["displacement_mm"] = np.rint((X + 3) / 0.002).astype("i2")
        file["displacement_mm"].attrs.update(scale_factor=0.002, add_offset=-3.0)
        file["pressure_kPa"] = P
    assert list(table(tmp_path / "a.h5").unread) == ["displacement_mm"]


def test_columns_of_parquet_are_those_that_pandas_reads(tmp_path: Path) -> None:
    kinds = ("f8", "f4", "i1", "i2", "i4", "i8", "u1", "u2", "u4")
    frame = pd.DataFrame({kind: np.arange(12).astype(kind) for kind in kinds})
    frame["maybe"] = pd.array([True, False, None] * 4, dtype="boolean")
    frame["few"] = pd.array([1, 2, None] * 4, dtype="Int64")
    frame["price"] = pd.Series([Decimal("1.5")] * 12, dtype=object)
    numbers = [*map(str, frame)]
    frame["when"] = pd.date_range("2024-01-01", periods=12, freq="20ms")
    frame["word"] = pd.Categorical(["up", None, "down"] * 4)
    frame["list"] = pd.Series([[1.0]] * 12, dtype=object)
    frame.to_parquet(tmp_path / "a.parquet")
    found = columns(tmp_path / "a.parquet")
    for name in numbers:
        known = pd.read_parquet(tmp_path / "a.parquet")[name].astype("Float64")
        expected = known.to_numpy(np.float64, na_value=np.nan)
        np.testing.assert_array_equal(found[name].values, expected)
    assert found["when"].values == pytest.approx(np.arange(12) / 50)
    assert found["word"].texts == ["up", "", "down"] * 4
    assert list(table(tmp_path / "a.parquet").unread) == ["list"]


CALLS: list[str] = []


class Trap:
    """Calls a function where it is unpickled."""

    def __reduce__(self) -> Any:
        return CALLS.append, ("called",)


def test_pickles_in_files_are_not_loaded(tmp_path: Path) -> None:
    trap = pickle.dumps(Trap())
    marks = {
        b"ARROW:extension:name": b"arrow.py_extension_type",
        b"ARROW:extension:metadata": trap,
    }
    schema = pa.schema([pa.field("p_kPa", pa.float64(), metadata=marks)])
    pq.write_table(pa.table([P], schema=schema), tmp_path / "a.parquet")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["p_kPa"] = P
        for item in (file, file["p_kPa"]):
            item.attrs["units"] = np.bytes_(trap)
    for name in ("a.parquet", "a.h5"):
        assert columns(tmp_path / name)["p_kPa"].values == pytest.approx(P)
    assert not CALLS
