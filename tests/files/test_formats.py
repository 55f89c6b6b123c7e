"""Binary formats, written here by the libraries that other programs use."""

import datetime
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

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


MATRIX: dict[str, Any] = GIVEN | {
    "columns": {"time": "data[1]", "pressure": "data[2]", "displacement": "data[3]"}
}


def write_matrix(path: Path, matrix: Array, **others: Array) -> None:
    import h5py
    from scipy.io import savemat

    variables = {"data": matrix, **others}
    if path.suffix == ".mat":
        savemat(path, variables, format="4" if path.stem == "old" else "5")
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
    write_matrix(tmp_path / name, matrix.T if transposed else matrix)
    (recording,) = mckibben.read(tmp_path / name, channels=["pressure", "displacement"], **MATRIX)
    check(recording)
    assert list(recording.channels) == ["pressure", "displacement"]


def test_nothing_is_assumed_of_the_columns_of_a_matrix(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write_matrix(path, np.column_stack([T, P, X]))
    with pytest.raises(DataError) as refused:
        mckibben.read(path, channels=["pressure", "displacement"])
    assert refused.value.remedy == (
        "name its column with --column pressure=COLUMN, one of data[1], data[2], data[3]; "
        "data[1] rises evenly, as time does: --column time=data[1]"
    )
    with pytest.warns(DataWarning, match=r"no column of times is named.*--column time=data\[1\]"):
        (recording,) = mckibben.read(path)
    assert list(recording.channels) == ["data_1", "data_2", "data_3"]
    assert recording.sample_time is None
    with pytest.raises(DataError, match=r"named 'data'. Remedy: name one of data\[1\], data\[2\]"):
        mckibben.read(path, columns={"pressure": "data"})
    path = tmp_path / "b.mat"
    write_matrix(path, np.column_stack([P, X]))
    with pytest.warns(DataWarning, match=r"one of data\[1\], data\[2\]$"):
        mckibben.read(path)


def test_a_matrix_goes_with_vectors_of_its_length(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write_matrix(path, np.column_stack([P, X]), t=T, gains=T[:3], table=np.ones((20, 2)))
    (recording,) = mckibben.read(
        path, **GIVEN, columns={"pressure": "data[1]", "displacement": "data[2]"}
    )
    check(recording)
    assert recording.meta["ignored_columns"] == ["gains", "table[1]", "table[2]"]


@pytest.mark.parametrize("shape", [(40, 40), (40, 5), (65, 1000), (40, 2, 2)])
def test_other_matrices_are_no_channels(tmp_path: Path, shape: tuple[int, ...]) -> None:
    for name in ("a.mat", "a.h5"):
        write_matrix(tmp_path / name, np.ones(shape))
        with pytest.raises(DataError, match="no vectors of numbers"):
            mckibben.read(tmp_path / name)


def test_the_name_of_a_matrix_may_say_unit_and_channel(tmp_path: Path) -> None:
    write_matrix(tmp_path / "a.mat", np.ones((5, 2)), t=T, p_kPa=np.column_stack([P, 2 * P]))
    (recording,) = mckibben.read(tmp_path / "a.mat", units={"time": "s"})
    assert list(recording.channels) == ["pressure_1", "pressure_2"]
    assert recording["pressure_2"] == pytest.approx(P / 50)


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


def write_scalars(path: Path, scalars: dict[str, float], **vectors: Array) -> None:
    import h5py
    from scipy.io import savemat

    variables = {"p_kPa": P, "disp_cm": X, **vectors, **scalars}
    if path.suffix == ".mat":
        savemat(path, variables if path.stem == "old" else {"run": variables}, format="5")
        return
    with h5py.File(path, "w") as file:
        for name, values in variables.items():
            file[f"run/{name}"] = values


@pytest.mark.parametrize("name", ["old.mat", "new.mat", "a.h5"])
@pytest.mark.parametrize(
    "scalars",
    [{"Fs": 50.0}, {"dt": 0.02}, {"SampleRate": 50}, {"fs": 50, "Ts": 0.02}],
    ids=lambda scalars: "+".join(scalars),
)
def test_a_scalar_tells_the_sample_time(
    tmp_path: Path, name: str, scalars: dict[str, float]
) -> None:
    write_scalars(tmp_path / name, scalars)
    with pytest.warns(DataWarning, match=r"there are no times.*0\.02 s between samples"):
        (recording,) = mckibben.read(tmp_path / name)
    check(recording)
    assert any("there are no times" in note for note in recording.notes)
    assert mckibben.read(tmp_path / name, rate=25)[0].sample_time == 0.04


@pytest.mark.parametrize("name", ["old.mat", "a.h5"])
@pytest.mark.parametrize(
    ("scalars", "problem"),
    [
        ({"fs": 50.0, "dt": 0.01}, "contradict each other"),
        ({"fs": 0.0}, "fs = 0: this cannot be"),
        ({"Ts": -0.02}, "Ts = -0.02: this cannot be"),
        ({"fs": np.nan}, "fs = nan: this cannot be"),
        ({"dt": np.inf, "fs": 50.0}, "these cannot be"),
    ],
)
def test_scalars_that_cannot_be_are_refused_where_they_count(
    tmp_path: Path, name: str, scalars: dict[str, float], problem: str
) -> None:
    write_scalars(tmp_path / name, scalars)
    with pytest.raises(DataError, match=f"{problem}.*Remedy: say .* with --rate"):
        mckibben.read(tmp_path / name)
    check(mckibben.read(tmp_path / name, rate=50)[0])
    write_scalars(tmp_path / name, scalars, time_s=T)
    check(mckibben.read(tmp_path / name)[0])


def test_a_scalar_goes_with_a_matrix(tmp_path: Path) -> None:
    write_matrix(tmp_path / "a.mat", np.column_stack([P, X]), fs=np.array(50.0))
    columns = {"pressure": "data[1]", "displacement": "data[2]"}
    units = {"pressure": "kPa", "displacement": "cm"}
    with pytest.warns(DataWarning, match="fs = 50 is taken"):
        (recording,) = mckibben.read(tmp_path / "a.mat", columns=columns, units=units)
    check(recording)


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
