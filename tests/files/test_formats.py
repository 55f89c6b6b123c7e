"""Binary formats, written here by the libraries that other programs use."""

from __future__ import annotations

import datetime
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat, savemat

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.arrays import Array

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


def test_mat_struct(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"run": {"time_s": T, "raw": {"p_kPa": P, "pos_cm": X}, "fs": 50}})
    (recording,) = mckibben.read(tmp_path / "a.mat")
    check(recording)


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


def test_nothing_is_assumed_of_the_columns_of_a_matrix(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write(path, data=np.column_stack([T, P, X]))
    with pytest.raises(DataError) as refused:
        mckibben.read(path, channels=["pressure", "displacement"])
    assert refused.value.channel == "pressure"
    assert "data[1], data[2], data[3]" in refused.value.remedy
    assert "--column time=data[1]" in refused.value.remedy
    with pytest.warns(DataWarning, match=r"--column time=data\[1\]"):
        (recording,) = mckibben.read(path)
    assert list(recording.channels) == ["data_1", "data_2", "data_3"]
    assert recording.sample_time is None
    with pytest.raises(DataError, match=r"data\[1\], data\[2\]"):
        mckibben.read(path, columns={"pressure": "data"})


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


def test_the_name_of_a_matrix_may_say_unit_and_channel(tmp_path: Path) -> None:
    write(tmp_path / "a.mat", data=np.ones((5, 2)), t=T, p_kPa=np.column_stack([P, 2 * P]))
    (recording,) = mckibben.read(tmp_path / "a.mat", units={"time": "s"})
    assert list(recording.channels) == ["pressure_1", "pressure_2"]
    assert recording["pressure_2"] == pytest.approx(P / 50)


def test_mat_7_3(tmp_path: Path) -> None:
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


@pytest.mark.parametrize("name", ["old.mat", "struct.mat", "a.h5"])
@pytest.mark.parametrize(
    "scalars",
    [{"Fs": 50.0}, {"dt": 0.02}, {"SampleRate": 50}, {"fs": 50, "Ts": 0.02}],
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
        ({"fs": 0.0}, "fs = 0"),
        ({"Ts": -0.02}, "Ts = -0.02"),
        ({"fs": np.nan}, "fs = nan"),
        ({"dt": np.inf, "fs": 50.0}, "fs = 50"),
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


def test_a_scalar_goes_with_a_matrix(tmp_path: Path) -> None:
    write(tmp_path / "a.mat", data=np.column_stack([P, X]), fs=50.0)
    columns = {"pressure": "data[1]", "displacement": "data[2]"}
    units = {"pressure": "kPa", "displacement": "cm"}
    with pytest.warns(DataWarning, match="fs = 50 is taken"):
        (recording,) = mckibben.read(tmp_path / "a.mat", columns=columns, units=units)
    check(recording)


@pytest.mark.parametrize("ending", [".h5", ".hdf5"])
@pytest.mark.parametrize("attribute", ["unit", "units"])
def test_hdf5(tmp_path: Path, ending: str, attribute: str) -> None:
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


def write_tdms(path: Path, groups: list[str], *, timed: bool = True) -> None:
    from nptdms import ChannelObject, RootObject, TdmsWriter

    root = RootObject({"operator": "jane", "started": datetime.datetime(2026, 1, 31)})
    with TdmsWriter(path) as writer:
        for group in groups:
            shared = {"wf_increment": 0.02, "wf_start_offset": 1.0} if timed else {}
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
    write_tdms(tmp_path / "b.tdms", ["run"], timed=False)
    assert mckibben.read(tmp_path / "b.tdms")[0].sample_time is None
    (given,) = mckibben.read(tmp_path / "b.tdms", rate=50)
    check(given)
    assert given.start_time == 0.0


def test_every_group_of_tdms_is_a_recording(tmp_path: Path) -> None:
    write_tdms(tmp_path / "a.tdms", ["up", "down"])
    recordings = mckibben.read(tmp_path / "a.tdms")
    assert [recording.name for recording in recordings] == ["a[up]", "a[down]"]
    for recording in recordings:
        check(recording)


def test_foreign_parquet(tmp_path: Path) -> None:
    frame = pd.DataFrame(
        {"Zeit (ms)": (1000 * T).astype(int), "Druck [kPa]": P, "Weg_cm": X, "branch": "up"}
    )
    frame.to_parquet(tmp_path / "a.parquet")
    (recording,) = mckibben.read(tmp_path / "a.parquet")
    check(recording)
    assert recording.meta["ignored_columns"] == ["branch"]


def test_parquet_with_instants_and_nulls(tmp_path: Path) -> None:
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


def test_times_in_words_are_read_from_parquet(tmp_path: Path) -> None:
    times = [f"2026-01-31T12:00:{k / 50:06.3f}" for k in range(40)]
    frame = pd.DataFrame({"time": times, "p_kPa": P, "Weg_cm": X, "branch": ["up", None] * 20})
    frame.to_parquet(tmp_path / "a.parquet")
    (recording,) = mckibben.read(tmp_path / "a.parquet")
    check(recording)
    assert recording.meta["ignored_columns"] == ["branch"]


def test_vectors_of_matlab_files_are_those_that_scipy_reads(tmp_path: Path) -> None:
    numbers = np.arange(12)
    kinds = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?")
    content: dict[str, Any] = {f"v{kind.strip('?')}": numbers.astype(kind) for kind in kinds}
    content |= {"matrix": np.eye(3), "complex": numbers * 1j, "words": ["up", "down"]}
    older = {"v": numbers.astype("f4"), "matrix": np.eye(3), "words": ["up", "down"], "w": numbers}
    savemat(tmp_path / "4.mat", older | {"complex": numbers * 1j}, format="4")
    (recording,) = mckibben.read(tmp_path / "4.mat")
    assert list(recording.channels) == ["v", "w"]
    assert all(np.array_equal(recording[name], numbers) for name in "vw")
    content |= {
        "cell": np.array([numbers, "a"], dtype=object),
        "deep": {"er": {"p": numbers * 0.5}},
    }
    for packed, column in ((False, "row"), (True, "column")):
        path = tmp_path / f"{packed}.mat"
        savemat(path, content, do_compression=packed, oned_as=column)  # type: ignore[arg-type]
        (recording,) = mckibben.read(path, units={"pressure": "bar"})
        known = loadmat(path, squeeze_me=True)
        for kind in kinds:
            name = f"v{kind.strip('?')}"
            assert np.array_equal(recording[name], known[name])
        assert np.array_equal(recording["pressure"], numbers * 0.5)
        assert len(recording.channels) == len(kinds) + 1


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
        file.create_dataset("c", (20,), [("a", "f8"), ("b", "S5000")])
    (recording,) = mckibben.read(tmp_path / "a.h5")
    assert list(recording.channels) == ["again"]


def test_names_and_texts_that_steer_a_terminal_are_written_out(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x\x1b[2J"] = np.arange(40.0)
        file.attrs["rig"] = "\x1b[31mred"
    (recording,) = mckibben.read(tmp_path / "a.h5")
    assert all(map(str.isprintable, recording.channels))
    assert recording.meta["rig"] == "\\x1b[31mred"


@pytest.mark.parametrize(
    ("module", "name", "content", "extra"),
    [
        ("h5py", "a.h5", b"\x89HDF\r\n\x1a\n", "mckibben[hdf5]"),
        ("nptdms", "a.tdms", b"TDSm", "mckibben[tdms]"),
        ("openpyxl", "a.xlsx", b"PK\x03\x04", "mckibben[xlsx]"),
        ("rosbags", "a.bag", b"#ROSBAG V2.0\n", "mckibben[ros]"),
    ],
)
def test_a_missing_library_is_named_by_its_extra(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    module: str,
    name: str,
    content: bytes,
    extra: str,
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError) as refused:
        mckibben.read(tmp_path / name)
    assert extra in refused.value.remedy
