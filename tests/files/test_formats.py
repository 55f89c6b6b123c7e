"""Binary formats, written here by the libraries that other programs use."""

import datetime
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording

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


@pytest.mark.parametrize("version", ["4", "5"])
@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("column", ["row", "column"])
def test_mat_vectors(
    tmp_path: Path, version: Literal["4", "5"], compressed: bool, column: Literal["row", "column"]
) -> None:
    from scipy.io import savemat

    savemat(
        tmp_path / "a.mat",
        {"t": T, "p": P, "x_pos": np.arange(3.0), "disp": X, "note": "run 3", "Fs": 50.0},
        format=version,
        do_compression=compressed and version == "5",
        oned_as=column,
    )
    (recording,) = mckibben.read(tmp_path / "a.mat", **GIVEN)
    check(recording)
    assert "x_pos" in recording.meta["ignored_columns"]


def test_mat_struct(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"run": {"time_s": T, "raw": {"p_kPa": P, "pos_cm": X}, "fs": 50}})
    (recording,) = mckibben.read(tmp_path / "a.mat")
    check(recording)


def test_mat_7_3(tmp_path: Path) -> None:
    import h5py

    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, samples in {"t": T, "p": P, "disp": X}.items():
            file.create_dataset(f"run/{name}", data=samples.reshape(1, -1))
            file[f"run/{name}"].attrs["MATLAB_class"] = np.bytes_("double")
        text = file.create_dataset("note", data=np.zeros((1, 40), dtype=np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_dataset("#refs#/a", data=K)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    (recording,) = mckibben.read(path, **GIVEN)
    check(recording)
    assert list(recording.channels) == ["displacement", "pressure"]


@pytest.mark.parametrize("ending", [".h5", ".hdf5"])
@pytest.mark.parametrize("attribute", ["unit", "units"])
def test_hdf5(tmp_path: Path, ending: str, attribute: str) -> None:
    import h5py

    path = tmp_path / f"a{ending}"
    with h5py.File(path, "w") as file:
        file.attrs["rig"] = "bench 2"
        file.attrs["load_N"] = 12.5
        file.attrs["matrix"] = np.eye(2)
        for name, (samples, unit) in {
            "time": (T * 1e3, "ms"),
            "rig/pressure": (P, "kPa"),
            "rig/position": (X, b"cm"),
        }.items():
            file[name] = samples
            file[name].attrs[attribute] = unit
        file["other"] = np.arange(7.0)
        file["image"] = np.zeros((4, 40))
        file["words"] = np.array(["up"] * 40, dtype="S2")
    (recording,) = mckibben.read(path)
    check(recording)
    assert recording.meta["rig"] == "bench 2"
    assert recording.meta["load_N"] == 12.5
    assert recording.meta["ignored_columns"] == ["other"]


def test_hdf5_columns_may_be_given_by_name(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["ch0"] = P
        file["ch1"] = X
    (recording,) = mckibben.read(
        tmp_path / "a.h5",
        columns={"pressure": "ch0", "displacement": "ch1"},
        units={"pressure": "kPa", "displacement": "cm"},
        rate=50,
    )
    check(recording)


def write_tdms(path: Path, groups: list[str], increment: float | None = 0.02) -> None:
    from nptdms import ChannelObject, RootObject, TdmsWriter

    root = RootObject({"operator": "jane", "started": datetime.datetime(2026, 1, 31)})
    with TdmsWriter(path) as writer:
        for group in groups:
            shared = (
                {} if increment is None else {"wf_increment": increment, "wf_start_offset": 1.0}
            )
            writer.write_segment(
                [
                    root,
                    ChannelObject(group, "Druck", P, {"unit_string": "kPa", **shared}),
                    ChannelObject(group, "Weg", X, {"unit_string": "cm", **shared}),
                    ChannelObject(group, "slow", np.arange(4.0)),
                ]
            )


def test_tdms(tmp_path: Path) -> None:
    write_tdms(tmp_path / "a.tdms", ["run"])
    (recording,) = mckibben.read(tmp_path / "a.tdms")
    check(recording)
    assert recording.start_time == 1.0
    assert recording.meta["operator"] == "jane"
    assert recording.meta["ignored_columns"] == ["slow"]
    assert recording.name == "a"


def test_tdms_without_time_base(tmp_path: Path) -> None:
    write_tdms(tmp_path / "a.tdms", ["run"], increment=None)
    assert mckibben.read(tmp_path / "a.tdms")[0].sample_time is None
    check(mckibben.read(tmp_path / "a.tdms", rate=50)[0])


def test_every_group_of_tdms_is_a_recording(tmp_path: Path) -> None:
    write_tdms(tmp_path / "a.tdms", ["up", "down"])
    recordings = mckibben.read(tmp_path / "a.tdms")
    assert [recording.name for recording in recordings] == ["a[up]", "a[down]"]
    for recording in recordings:
        check(recording)


def test_foreign_parquet(tmp_path: Path) -> None:
    import pandas as pd

    frame = pd.DataFrame(
        {"Zeit (ms)": (1000 * T).astype(int), "Druck [kPa]": P, "Weg_cm": X, "branch": "up"}
    )
    frame.to_parquet(tmp_path / "a.parquet")
    (recording,) = mckibben.read(tmp_path / "a.parquet")
    check(recording)
    assert recording.meta["ignored_columns"] == ["branch"]


def test_parquet_with_instants_and_nulls(tmp_path: Path) -> None:
    import pandas as pd

    frame = pd.DataFrame(
        {
            "timestamp": pd.Timestamp("2026-01-31") + pd.to_timedelta(T, unit="s"),
            "Druck [kPa]": P,
            "Weg_cm": X,
            "flag": pd.array([1, None] * 20, dtype="Int64"),
        }
    )
    frame.to_parquet(tmp_path / "a.parquet")
    with pytest.warns(DataWarning, match="'flag' is left out"):
        (recording,) = mckibben.read(tmp_path / "a.parquet", channels=["pressure", "displacement"])
    check(recording)


@pytest.mark.parametrize(
    ("module", "name", "remedy"),
    [("h5py", "a.h5", r"mckibben\[hdf5\]"), ("nptdms", "a.tdms", r"mckibben\[tdms\]")],
)
def test_missing_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, name: str, remedy: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).write_bytes(b"\x89HDF\r\n\x1a\n" if module == "h5py" else b"TDSm")
    with pytest.raises(DataError, match=f"not installed. Remedy: pip install '{remedy}'"):
        mckibben.read(tmp_path / name)
