"""Binary formats, written here by the libraries that other programs use."""

from __future__ import annotations

import json
import pickle
import struct
from decimal import Decimal
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from scipy.io import savemat
from scipy.sparse import csc_array

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.arrays import Array
from mckibben.files.formats import tables

K = np.arange(40.0)
P = 100 * (1 + np.sin(K / 6))
X = 2 * np.cos(K / 6)
T = K / 50


def check(recording: Recording) -> None:
    assert recording.sample_time == 0.02
    assert recording["pressure"] == pytest.approx(P / 100)
    assert recording["displacement"] == pytest.approx(10 * X)
    assert recording.units["displacement"] == "mm"


GIVEN: dict[str, Any] = {"units": {"time": "s", "pressure": "kPa", "displacement": "cm"}}


MATRIX: dict[str, Any] = GIVEN | {
    "columns": {"time": "data[1]", "pressure": "data[2]", "displacement": "data[3]"}
}


def write(path: Path, **variables: Array | float) -> None:
    """Write variables as MATLAB of several versions does, or as HDF5 in a group."""
    if path.suffix == ".mat":
        content = {"run": variables} if path.stem == "struct" else variables
        savemat(path, content, format="4" if path.stem == "old" else "5")
        return
    with h5py.File(path, "w") as file:
        for name, values in variables.items():
            file[f"run/{name}"] = values


@pytest.mark.parametrize("name", ["old.mat", "new.mat", "a.h5"])
@pytest.mark.parametrize("transposed", [False, True])
def test_columns_of_a_matrix_are_named_by_number(
    tmp_path: Path, name: str, transposed: bool
) -> None:
    matrix = np.column_stack([T, P, X])
    write(tmp_path / name, data=matrix.T if transposed else matrix)
    (recording,) = mckibben.read(tmp_path / name, channels=["pressure", "displacement"], **MATRIX)
    check(recording)
    assert list(recording.channels) == ["pressure", "displacement"]
    with pytest.raises(DataError, match=r"data\[1\]"):  # the columns that can be named
        mckibben.read(tmp_path / name, columns={"pressure": "data"})


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_a_matrix_goes_with_vectors_of_its_length(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write(path, data=np.column_stack([P, X]), t=T, gains=T[:3], table=np.ones((20, 2)))
    (recording,) = mckibben.read(
        path, **GIVEN, columns={"pressure": "data[1]", "displacement": "data[2]"}
    )
    check(recording)
    assert recording.meta["ignored_columns"] == ["gains", "table[1]", "table[2]"]


@pytest.mark.parametrize("shape", [(40, 40), (40, 5), (65, 1000), (40, 2, 2)])
def test_other_matrices_are_no_channels(tmp_path: Path, shape: tuple[int, ...]) -> None:
    for name in ("a.mat", "a.h5"):
        write(tmp_path / name, data=np.ones(shape))
        with pytest.raises(DataError) as refused:
            mckibben.read(tmp_path / name)
        assert refused.value.file == tmp_path / name


@pytest.mark.parametrize("name", ["old.mat", "struct.mat", "a.h5"])
@pytest.mark.parametrize(
    "scalars",
    [{"dt": 0.02}, {"SampleRate": 50}, {"fs": 50, "Ts": 0.02}],
    ids=lambda scalars: "+".join(scalars),
)
def test_a_scalar_tells_the_sample_time(
    tmp_path: Path, name: str, scalars: dict[str, float]
) -> None:
    write(tmp_path / name, p_kPa=P, disp_cm=X, **scalars)
    with pytest.warns(DataWarning, match=r"0\.02 s") as caught:
        (recording,) = mckibben.read(tmp_path / name)
    check(recording)
    assert len(recording.notes) == len(caught) == 1
    assert mckibben.read(tmp_path / name, rate=25)[0].sample_time == 0.04


@pytest.mark.parametrize("name", ["old.mat", "a.h5"])
@pytest.mark.parametrize(
    ("scalars", "named"),
    [
        ({"fs": 50.0, "dt": 0.01}, "dt = 0.01"),
        ({"Ts": -0.02}, "Ts = -0.02"),
        ({"fs": np.nan}, "fs = nan"),
    ],
)
def test_scalars_that_cannot_be_are_refused_where_they_count(
    tmp_path: Path, name: str, scalars: dict[str, float], named: str
) -> None:
    write(tmp_path / name, p_kPa=P, disp_cm=X, **scalars)
    with pytest.raises(DataError, match=f"{named}.*--rate"):
        mckibben.read(tmp_path / name)
    check(mckibben.read(tmp_path / name, rate=50)[0])
    write(tmp_path / name, p_kPa=P, disp_cm=X, time_s=T, **scalars)
    check(mckibben.read(tmp_path / name)[0])


@pytest.mark.parametrize(
    ("step", "late_us"), [(0.02, 0), (0.05, 0), (0.02, 30_000)], ids=["alike", "slower", "later"]
)
def test_channels_of_tdms_have_the_clocks_that_the_file_states(
    tmp_path: Path, step: float, late_us: int
) -> None:
    began = np.datetime64("2026-01-31T12:00:00.123456")
    known = {"wf_start_offset": 0.5, "wf_increment": 0.02, "wf_start_time": began}
    other = known | {"wf_increment": step, "wf_start_time": began + np.timedelta64(late_us, "us")}
    kinds = np.array(["up", "down"])
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(
            [
                ChannelObject("run", "pressure", P, {"unit_string": "kPa", **known}),
                ChannelObject("run", "displacement", X, {"unit_string": "cm", **other}),
                ChannelObject("run", "force", P[:0]),
                ChannelObject("run", "valve", kinds),
            ]
        )
    (table,) = tables(tmp_path / "a.tdms")
    assert table.unread == {"force": "no samples", "valve": "text"}
    if (step, late_us) == (0.02, 0):
        assert (table.sample_time, table.start_time, table.has_clocks) == (0.02, 0.5, False)
        return
    tracks = {  # as nptdms has them
        channel.name: channel.time_track(absolute_time=True)
        for channel in TdmsFile.read(tmp_path / "a.tdms")["run"].channels()[:2]
    }
    for one in table.columns:
        since = (tracks[one.header] - began).astype("timedelta64[ns]").astype(float) * 1e-9
        assert one.times == pytest.approx(since, abs=1e-9)
    with pytest.warns(DataWarning, match=r"times of their own|valve \(text\)"):
        (recording,) = mckibben.read(tmp_path / "a.tdms")
    exact = np.interp(recording.time, 0.5 + 0.02 * K, P) / 100
    assert recording["pressure"] == pytest.approx(exact)


def test_a_channel_of_tdms_without_a_clock_is_left_out_where_others_differ(tmp_path: Path) -> None:
    steps = {"pressure": {"wf_increment": 0.02}, "force": {"wf_increment": 0.05}, "angle": {}}
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([ChannelObject("run", name, P, own) for name, own in steps.items()])
    (table,) = tables(tmp_path / "a.tdms")
    assert [one.header for one in table.columns] == ["pressure", "force"]
    assert list(table.unread) == ["angle"]


COLUMNS = {"time": T.tolist(), "p": P.tolist(), "displacement": X.tolist()}
RECORDS = [dict(zip(COLUMNS, row, strict=True)) for row in zip(*COLUMNS.values(), strict=True)]
UNITS = {"time": "s", "p": "kPa", "displacement": "cm"}
MEASURED = [
    {
        "time": one["time"],
        "s": {k: {"value": one[k], "unit": UNITS[k]} for k in ("p", "displacement")},
    }
    for one in RECORDS
]
EVENT = {"event": "heartbeat", "rssi": -61}


@pytest.mark.parametrize(
    ("content", "units"),
    [
        (COLUMNS, False),
        ({"columns": COLUMNS, "units": UNITS}, True),
        ({"meta": {"units": UNITS}, "data": COLUMNS}, True),
        (RECORDS, False),
        ([*MEASURED[:9], EVENT, *MEASURED[9:]], True),
        ({"p": COLUMNS["p"], "displacement": COLUMNS["displacement"], "fs": 50}, False),
    ],
    ids=["columns", "with units", "in meta", "records", "measured", "a rate"],
)
@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_json_of_columns(tmp_path: Path, content: Any, units: bool) -> None:
    path = tmp_path / "a.json"
    if isinstance(content, dict):
        path.write_text(json.dumps({**content, "load": 2.5, "note": "new"}))
    else:
        path = tmp_path / "a.jsonl"
        path.write_text("\n".join(map(json.dumps, content)) + "\n")
    given = {} if units else {"pressure": "kPa", "displacement": "cm"}
    (recording,) = mckibben.read(path, units=given)
    check(recording)
    if isinstance(content, dict):
        assert (recording.meta["load"], recording.meta["note"]) == (2.5, "new")
    (tmp_path / "run.csv").write_text("t_s,p_bar\n" + "".join(f"{k},{k}\n" for k in range(20)))
    assert [each.name for each in mckibben.read(tmp_path)] == ["run"]


def test_what_is_no_column_of_json_is_listed(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    changed = [{"value": 2.0, "unit": "bar" if k < 20 else "kPa"} for k in range(40)]
    records = [{**one, "q": q, "l": [[1], [2, 3]]} for one, q in zip(RECORDS, changed, strict=True)]
    path.write_text("\n".join(map(json.dumps, [*records, EVENT])))
    assert tables(path)[0].unread == {
        "q.value": "its unit changes",
        "l": "lists or objects within a list",
        "other records": "1 without time, p, displacement, q, l",
    }


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('{"format": "mckibben-model", "version": 1}', "of format .mckibben-model"),
        ('{"p": [1, 2], "p": [3, 4]}', "twice"),
        ('{"runs": {"a.csv": "train"}}', "no vectors"),
        ("[1, 2, 3]", "without columns"),
        ('{"columns": {"p": [1, 2]}, "units": {"pressure": "bar"}}', "'pressure'"),
        ('{"p": [1, 2, "off", 4]}', "'off' is not a number"),
        ('{"p": [1, 2', "damaged"),
    ],
)
def test_other_json_is_refused(tmp_path: Path, text: str, named: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(DataError, match=named):
        mckibben.read(tmp_path / "a.json")


# Trees of groups and structs -------------------------------------------------------------------

KINDS = ("<f8", ">f8", "<f4", "<i2", ">i4", "u1", "<u2", "i1", "<u4", "<i8")


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

    def put(group: Any, name: str, value: Any) -> Any:
        if isinstance(value, dict):
            made, kind = group.create_group(name), "struct"
            for inner, each in value.items():
                put(made, inner, each)
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
            made[i, 0] = put(kept, f"{len(kept)}", value).ref
        return made

    with h5py.File(path, "w", userblock_size=512) as file:
        kept = file.create_group("#refs#")
        for name, value in tree.items():
            put(file, name, value)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes()[512:])


BOTH = np.column_stack([P, X])
CONVENTIONS: dict[str, dict[str, Any]] = {
    "structs": {"run": {"time_s": T, "signals": {"p_kPa": P, "disp_cm": X}}},
    "ControlDesk": {
        "exp1": {
            "X": {"Name": "time", "Unit": "s", "Data": T},
            "Y": structs("Name Unit Data", ("pressure", "kPa", P), ("displacement", "cm", X)),
        }
    },
    "one X of many": {
        "e": {
            "X": structs("Name Data", ("time", T)),
            "Y": structs("Name Unit Data", ("p", "kPa", P), ("pos", "cm", X)),
        }
    },
    "a struct a signal": {
        "pressure": {"t": T, "y": P, "unit": "kPa"},
        "displacement": {"t": T, "y": X, "unit": "cm"},
    },
    "Simulink": {
        "out": {
            "time": T,
            "signals": structs("values label", (P[:, None], "p [kPa]"), (X[:, None], "pos [cm]")),
            "blockName": "model/log",
        }
    },
    "Simulink's matrix": {
        "out": {"time": T, "signals": {"values": BOTH, "label": cell("p_kPa", "pos_cm")}}
    },
    "units": {"t": T, "p": P, "pos": X, "units": {"p": "kPa", "pos": "cm"}},
    "a struct of units": {"run": {"t": T, "p": P, "pos": X}, "einheit": {"p": "kPa", "pos": "cm"}},
    "a struct a unit": {
        "run": {"t": T, "p": P, "pos": X},
        "kanaele": {"p": {"unit": "kPa"}, "pos": {"unit": "cm", "range": np.arange(2.0)}},
    },
    "time series": {
        name: {
            "Time": 1000 * T,
            "TimeInfo": {"Units": "ms"},
            "Data": samples,
            "DataInfo": {"Units": unit},
        }
        for name, samples, unit in (("p", P, "kPa"), ("pos", X, "cm"))
    },
    "names": {"t": T, "data": BOTH, "names": cell("p", "pos"), "units": cell("kPa", "cm")},
    "cells": {"t": T, "log": cell({"p_kPa": P}, {"pos_cm": X})},
    "a struct a sample": {"s": structs("t p_kPa pos_cm", *map(tuple, np.column_stack([T, BOTH])))},
}


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("version", ["5", "7.3"])
def test_signals_are_found_where_programs_put_them(
    tmp_path: Path, convention: str, version: str
) -> None:
    path, tree = tmp_path / "a.mat", CONVENTIONS[convention]
    if version == "5":
        savemat(path, tree)
    else:
        write_73(path, tree)
    (recording,) = mckibben.read(path, channels=["pressure", "displacement"])
    check(recording)
    assert set(recording.channels) == {"pressure", "displacement"}
    assert not tables(path)[0].unread


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_vectors_have_the_times_nearest_to_them(tmp_path: Path, version: str) -> None:
    path = tmp_path / "a.mat"
    slow = np.arange(30.0)
    tree = {
        "pressure": {"t": T, "y": P},
        "displacement": {"t_ms": 100 * slow, "y": slow**2},
        "other": np.ones(40),
    }
    (savemat if version == "5" else write_73)(path, tree)
    (table,) = tables(path)
    columns = {column.header: column for column in table.columns}
    assert sorted(columns) == ["displacement.y", "pressure.y"]
    assert columns["pressure.y"].times == pytest.approx(T)
    assert columns["displacement.y"].times == pytest.approx(slow / 10)
    assert table.unread == {"other": "it has no times, and others have their own"}


def test_a_name_that_several_groups_have_is_told_by_its_place(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, each in {"one/p_kPa": P, "one/q7": P, "two/p_kPa": 2 * P, "two/q7": X}.items():
            file[name] = each
        file["disp_cm"] = X
    with pytest.raises(DataError, match="'one/p_kPa' and 'two/p_kPa'"):
        mckibben.read(path)
    (recording,) = mckibben.read(path, rate=50, columns={"pressure": "two/p_kPa"})
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
    savemat(path, {"p": P, "fast": np.ones(90), "run": other})
    path.write_bytes(path.read_bytes() + opaque(b"tab", b"table"))
    (table,) = tables(path)
    assert table.unread == {
        "run.z": "complex numbers",
        "run.m": "an array of 9 x 9",
        "run.sp": "a sparse matrix",
        "run.log{1}": "a cell of text and numbers",
        "run.log{2}": "a cell of text and numbers",
        "run.words": "text",
        "tab": "an object of class table",
    }
    path.write_bytes(path.read_bytes() + opaque(b"ts", b"timeseries"))
    assert tables(path)[0].unread["ts"] == "an object of class timeseries, and 1 more object(s)"
    savemat(path, {"run": other})
    with pytest.raises(DataError, match=r"run\.z \(complex numbers\)"):
        mckibben.read(path)


def test_variables_of_one_name_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"p": P})
    path.write_bytes(path.read_bytes() + path.read_bytes()[128:])
    with pytest.raises(DataError, match="one name"):
        mckibben.read(path)


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_fields_of_a_table_in_hdf5_are_columns(tmp_path: Path) -> None:
    rows = np.zeros(
        40, [("t", "f8"), ("p_kPa", ">f4"), ("mark", "S3"), ("values_block_0", "f8", 2)]
    )
    rows["t"], rows["p_kPa"], rows["values_block_0"] = T, P, BOTH
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log"] = rows
        file["disp_cm"] = X
        file["names"] = ["a", "b"]
        file["log"].attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(["p", "pos"]))
    (recording,) = mckibben.read(tmp_path / "a.h5", channels=["pressure", "displacement"])
    assert recording["pressure"] == pytest.approx(P / 100, rel=1e-6)
    assert recording["displacement"] == pytest.approx(10 * X)
    (table,) = tables(tmp_path / "a.h5")
    headers = ["disp_cm", "t", "p_kPa", "values_block_0[1]", "values_block_0[2]", "mark"]
    assert [column.header for column in table.columns] == headers
    assert np.array_equal(table.columns[4].values, X)  # type: ignore[arg-type]


def test_links_of_hdf5_do_not_lead_out_of_a_file_nor_round_in_it(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = np.arange(20.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["b"] = np.arange(20.0) ** 2
        file["again"] = file["b"]
        file["round"] = file["/"]
        file["out"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "a")
        file["soft"] = h5py.SoftLink("/out")
        for name, kind in (("r", h5py.ref_dtype), ("v", h5py.vlen_dtype("f8"))):
            file.create_dataset(name, (20,), kind)
    (table,) = tables(tmp_path / "a.h5")
    assert [column.header for column in table.columns] == ["again"]
    assert table.unread["out"] == "it is in another file"
    assert sorted(table.unread) == ["out", "r", "v"]


def test_columns_of_parquet_are_those_that_pandas_reads(tmp_path: Path) -> None:
    kinds = [kind.replace(">", "<") for kind in KINDS]
    frame = pd.DataFrame({f"v{i}": np.arange(12).astype(kind) for i, kind in enumerate(kinds)})
    frame["maybe"] = pd.array([True, False, None] * 4, dtype="boolean")
    frame["few"] = pd.array([1, 2, None] * 4, dtype="Int64")
    frame["price"] = pd.Series([Decimal("1.5")] * 12, dtype=object)
    frame["when"] = pd.date_range("2024-01-01", periods=12, freq="20ms")
    frame["word"] = pd.Categorical(["up", None, "down"] * 4)
    frame["list"] = pd.Series([[1.0]] * 12, dtype=object)
    frame.to_parquet(tmp_path / "a.parquet")
    (table,) = tables(tmp_path / "a.parquet")
    columns = {column.header: column for column in table.columns}
    known = pd.read_parquet(tmp_path / "a.parquet")
    for name in [*frame.columns[: len(KINDS)], "maybe", "few", "price"]:
        expected = known[name].astype("Float64").to_numpy(np.float64, na_value=np.nan)
        np.testing.assert_array_equal(columns[name].values, expected)
    assert columns["when"].values == pytest.approx(np.arange(12) / 50)
    assert columns["word"].texts == ["up", "", "down"] * 4
    assert list(table.unread) == ["list"]


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
        assert tables(tmp_path / name)[0].columns[0].values == pytest.approx(P)
    assert not CALLS


def test_packed_numbers_of_hdf5_are_unpacked(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        packed = file.create_dataset("displacement_mm", data=np.rint((X + 3) / 0.002).astype("i2"))
        packed.attrs.update(scale_factor=0.002, add_offset=-3.0)
        file["pressure_kPa"] = P
    (table,) = tables(tmp_path / "a.h5")
    assert table.columns[0].values == pytest.approx(X, abs=0.002)
