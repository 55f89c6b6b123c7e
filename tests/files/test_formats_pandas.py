"""Frames in HDF5, laid out here as pandas 3 and PyTables 3.11 lay them out."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from tests.files.made import columns, one, refused, table

K = np.arange(40)
T = K / 50
P = 100 + 50 * np.sin(K / 6)
X = 2 * np.cos(K / 6)
US = 20_000 * K + 1_767_225_600_000_000
COLUMNS: dict[str, Any] = {"圧力_kPa": P, "pos_cm": X, "count": K}
INDICES: dict[str, tuple[Any, str, str | None]] = {
    "counted": (K, "integer", None),
    "named": (T, "float", "time_s"),
    "dates": (US, "datetime64[us]", "when"),
    "durations": (1000 * (US - US[0]), "timedelta64[ns]", None),
    "old dates": (1000 * US, "datetime64", None),
}

CALLS: list[str] = []


class Trap:
    """Calls a function where it is unpickled."""

    def __reduce__(self) -> Any:
        return CALLS.append, ("called",)


def pickled(value: object) -> np.bytes_:
    """Return an attribute as PyTables pickles it."""
    return np.bytes_(pickle.dumps(value, 0))


def blocks(group: h5py.Group, index: Sequence[Any], named: Mapping[str, Any]) -> None:
    """Write the format "fixed": a block for each type, with the names of its columns."""
    values, kind, name = index
    group.attrs.update(pandas_type=np.bytes_("frame"), nblocks=2, encoding=np.bytes_("UTF-8"))
    group["axis0"] = np.array([each.encode() for each in named])
    group["axis1"] = values
    group["axis1"].attrs.update(kind=np.bytes_(kind), transposed=np.uint8(1))
    group["axis1"].attrs["name"] = pickled(None) if name is None else np.bytes_(name)
    for at, letter in enumerate("fi"):
        some = {each: x for each, x in named.items() if x.dtype.kind == letter}
        group[f"block{at}_items"] = np.array([each.encode() for each in some])
        group[f"block{at}_values"] = np.column_stack([*some.values()])
        group[f"block{at}_values"].attrs["transposed"] = np.uint8(1)


def compound(
    group: h5py.Group, index: Sequence[Any], named: Mapping[str, Any], names: Any = None
) -> None:
    """Write the format "table": a field for each type, with the names pickled in an attribute."""
    values, kind, name = index
    info = {1: {"names": [None], "type": "Index"}, "index": {"index_name": name} if name else {}}
    group.attrs.update(pandas_type=np.bytes_("frame_table"), info=pickled(info))
    fields = [("index", values.dtype), ("values_block_0", "f8", (2,)), ("count", "i8")]
    rows = np.zeros(len(values), [*fields, ("words", "S4", (2,))])
    rows["index"], rows["count"] = values, named["count"]
    rows["values_block_0"] = np.column_stack([named["圧力_kPa"], named["pos_cm"]])
    rows["words"] = [b"up", b"left"]
    group["table"] = rows
    kinds = {"values_block_0": ["圧力_kPa", "pos_cm"] if names is None else names}
    for field, each in {**kinds, "count": ["count"], "words": ["one", "two"]}.items():
        group["table"].attrs[f"{field}_kind"] = pickled(each)
    group["table"].attrs.update(index_kind=np.bytes_(kind), CLASS=np.bytes_("TABLE"))
    group.create_group("_i_table/index")["sortedLR"] = np.arange(4096.0)
    group["_i_table"].attrs["CLASS"] = np.bytes_("TINDEX")


@pytest.mark.parametrize("put", [blocks, compound])
@pytest.mark.parametrize("index", INDICES)
def test_columns_of_a_frame_have_their_names_and_its_index_is_the_time(
    tmp_path: Path, put: Any, index: str
) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        put(file.create_group("run"), INDICES[index], COLUMNS)
    recording = one(path)
    assert recording["pressure"] == pytest.approx(P / 100)
    assert recording["displacement"] == pytest.approx(10 * X)
    assert recording["count"].tolist() == K.tolist()
    assert recording.sample_time == (None if index == "counted" else pytest.approx(0.02))
    assert list(recording.channels) == ["pressure", "displacement", "count"]
    if put is compound:
        assert columns(path)["two"].texts == ["left"] * 40


def test_blocks_of_instants_and_of_pickles(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        blocks(file.create_group("run"), INDICES["counted"], COLUMNS)
        file["run/block2_items"] = np.array([b"when"])
        file["run/block2_values"] = US.reshape(1, -1)  # as it was before blocks were transposed
        file["run/block2_values"].attrs["value_type"] = np.bytes_("datetime64[us]")
        file["run/block3_items"] = np.array([b"mark"])
        objects = file.create_dataset("run/block3_values", (1,), h5py.vlen_dtype("u1"))
        objects[0] = np.frombuffer(pickle.dumps(Trap()), "u1")
    assert columns(path)["when"].values == pytest.approx(T)
    assert list(table(path).unread) == ["run/mark"]
    assert "to_csv" in table(path).unread["run/mark"]
    assert not CALLS


@pytest.mark.parametrize("names", [[Trap()], Trap(), {"a": "b"}, [("a", "b"), ("a", "c")]])
def test_names_in_a_pickle_of_anything_but_texts_are_not_read(tmp_path: Path, names: Any) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        compound(file.create_group("run"), INDICES["named"], COLUMNS, names)
    assert "to_csv" in table(path).unread["run/values_block_0"]
    assert list(one(path).channels) == ["count"]
    assert not CALLS


def test_a_series_is_one_column(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("p")
        group.attrs.update(pandas_type=np.bytes_("series"), name=np.bytes_("p_kPa"))
        group["index"], group["values"] = T, P
        group["index"].attrs.update(name=np.bytes_("t"), kind=np.bytes_("float"))
    recording = one(path)
    assert recording["pressure"] == pytest.approx(P / 100)
    assert recording.sample_time == pytest.approx(0.02)


def test_columns_of_one_name_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        compound(file.create_group("run"), INDICES["named"], COLUMNS, ["count", "pos_cm"])
    assert "count" in refused(path).problem
