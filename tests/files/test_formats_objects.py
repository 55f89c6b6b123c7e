"""Objects of MATLAB, written by mat-io as MATLAB writes them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest

from mckibben import DataWarning
from mckibben.files import objects
from mckibben.files.tree import Unread
from tests.files.made import columns, one, refused, table
from tests.refusals import mentions

matio = pytest.importorskip("matio")
utils = pytest.importorskip("matio.utils")

K = np.arange(40.0)
T = K / 50
P = 100 * (1 + np.sin(K / 6))
X = 2 * np.cos(K / 6)
VERSIONS = ["v7", "v7.3"]


def save(path: Path, version: str, compressed: bool = True, **variables: Any) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that MATLAB has no durations in nanoseconds
        matio.save_to_mat(str(path), variables, version=version, do_compression=compressed)
    return path


def frame(times: Any = None, **columns: Any) -> pd.DataFrame:
    found = pd.DataFrame(columns or {"p_kPa": P, "pos_cm": X})
    return found if times is None else found.set_index(pd.Index(times, name="Time"))


def series(data: Any, unit: str, times: Any = (), **regular: float) -> Any:
    """Return a time series with the properties that MATLAB saves."""
    about = {"Units": "seconds", **{name: np.array([[value]]) for name, value in regular.items()}}
    info = utils.MatlabOpaque(properties=about, classname="tsdata.timemetadata")
    unit_of = utils.MatlabOpaque(properties={"Units": unit}, classname="tsdata.datametadata")
    times = np.array(times, np.float64).reshape(-1, 1)
    named = {"Name": "", "TimeInfo": info, "DataInfo": unit_of, "Data_": data, "Time_": times}
    return utils.MatlabOpaque(properties=named, classname="timeseries")


DATES = np.datetime64("2026-01-31T12:00:00", "ns") + (1e9 * T).round().astype("m8[ns]")
CONTENTS: dict[str, dict[str, Any]] = {
    "table": {"run": frame(t_s=T, p_kPa=P, pos_cm=X, mark=["up", "down"] * 20)},
    "timetable": {"run": frame((1e9 * T).round().astype("m8[ns]"))},
    "timetable with dates": {"run": frame(DATES)},
    "table in a struct": {"exp": {"run": frame(t_s=T, p_kPa=P, pos_cm=X), "id": 7.0}},
    "dates beside vectors": {"when": DATES, "p_kPa": P, "pos_cm": X},
    "durations beside": {"t": (1e9 * T).round().astype("m8[ns]"), "p_kPa": P, "pos_cm": X},
}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("content", CONTENTS)
def test_objects_are_read_as_their_columns(tmp_path: Path, content: str, version: str) -> None:
    recording = one(save(tmp_path / "a.mat", version, **CONTENTS[content]))
    assert recording.sample_time == pytest.approx(0.02)
    assert recording["pressure"] == pytest.approx(P / 100)
    assert recording["displacement"] == pytest.approx(10 * X)


@pytest.mark.parametrize("version", VERSIONS)
def test_timetables_share_the_beginning_of_their_dates(tmp_path: Path, version: str) -> None:
    late = DATES[:30] + np.timedelta64(8, "ms")
    path = save(
        tmp_path / "a.mat", version, one=frame(DATES, p_kPa=P), two=frame(late, pos_cm=X[:30])
    )
    found = columns(path)
    assert found["p_kPa"].times == pytest.approx(T)
    assert found["pos_cm"].times == pytest.approx(T[:30] + 0.008)


def test_units_of_a_table_are_those_of_its_variables() -> None:
    made = frame(t=T, p=P, pos=X)
    made.attrs["VariableUnits"] = ["s", "kPa", "cm"]
    found: Any = objects.node(made)
    assert [found[f"{name}Info"]["unit"] for name in made] == ["s", "kPa", "cm"]
    made["pos_2"] = X  # as the second column of one variable is called
    assert isinstance(objects.node(made), Unread)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_time_series_has_its_times_or_counts_them(tmp_path: Path, version: str) -> None:
    regular = series(P.reshape(-1, 1), "kPa", Start_=0.5, Increment_=0.02, Length=40.0)
    stated = series(X.reshape(1, 1, -1), "cm", 0.5 + T)
    path = save(tmp_path / "a.mat", version, pressure=regular, out={"pos": stated})
    recording = one(path)
    assert recording["pressure"] == pytest.approx(P / 100)
    assert recording["displacement"] == pytest.approx(10 * X)
    assert recording.start_time == pytest.approx(0.5)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("kind", "value", "line"),
    [
        ("table", frame(t_s=T, p_kPa=P), "writetable(run, 'run.csv')"),
        ("timetable", frame(DATES), "writetimetable(run, 'run.csv')"),
        ("datetime", DATES, "posixtime(run)"),
    ],
)
def test_without_the_library_the_line_that_makes_data_of_an_object_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, value: Any, line: str, version: str
) -> None:
    path = save(tmp_path / "a.mat", version, run=value, t_s=T, p_kPa=P)
    monkeypatch.setattr(objects, "find_spec", lambda name: None)
    reason = table(path).unread["run"]
    assert kind in reason
    assert line in reason
    assert "mckibben[matlab]" in reason
    assert set(columns(path)) == {"t_s", "p_kPa"}


@pytest.mark.parametrize("version", VERSIONS)
def test_objects_of_other_classes_are_listed(tmp_path: Path, version: str) -> None:
    other = utils.MatlabOpaque(properties={"gain": np.array([[2.0]])}, classname="Rig")
    path = save(tmp_path / "a.mat", version, rig={"one": other}, t_s=T, p_kPa=P)
    assert set(columns(path)) == {"t_s", "p_kPa"}
    assert "struct(rig.one)" in table(path).unread["rig.one"]


def test_objects_with_invalid_elements_or_elsewhere_are_not_decoded(tmp_path: Path) -> None:
    path = save(tmp_path / "a.mat", "v7", compressed=False, run=frame(t_s=T), t_s=T, p_kPa=P)
    data = path.read_bytes()
    start = int.from_bytes(data[116:124], "little")
    inside = data.index(T.tobytes(), start) - 8  # the samples in the object
    path.write_bytes(data[:inside] + b"\x08" + data[inside + 1 :])
    assert refused(path).file == path
    path.write_bytes(data[:116] + (start + 8).to_bytes(8, "little") + data[124:])
    assert mentions(table(path).unread["run"], "table")
    version = data.index(b"data\0", start) - 40  # of the names in objects
    path.write_bytes(data[:version] + b"\x7f" + data[version + 1 :])
    with pytest.warns(DataWarning, match="decoded"):
        assert mentions(table(path).unread["run"], "table")


def test_a_file_that_leads_to_another_is_not_decoded(tmp_path: Path) -> None:
    path = save(tmp_path / "a.mat", "v7.3", run=frame(DATES), t_s=T, p_kPa=P)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["secret"] = K
    with h5py.File(path, "r+") as file:
        file["#refs#/out"] = h5py.ExternalLink(str(tmp_path / "b.h5"), "secret")
    assert mentions(table(path).unread["run"], "timetable")
