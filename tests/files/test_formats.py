"""Binary formats, written here by the libraries that other programs use."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from scipy.io import loadmat, savemat

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.arrays import Array
from mckibben.files import formats

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


@pytest.mark.parametrize("timed", [True, False])
def test_a_tdms_file_without_times_begins_at_nothing(tmp_path: Path, timed: bool) -> None:
    shared = {"wf_increment": 0.02, "wf_start_offset": 1.0} if timed else {}
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(
            [
                ChannelObject("run", "Druck", P, {"unit_string": "kPa", **shared}),
                ChannelObject("run", "Weg", X, {"unit_string": "cm", **shared}),
            ]
        )
    (recording,) = mckibben.read(tmp_path / "a.tdms", rate=50)
    check(recording)
    assert recording.start_time == (1.0 if timed else 0.0)
    assert mckibben.read(tmp_path / "a.tdms")[0].sample_time == (0.02 if timed else None)


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
    (table,) = formats.tables(tmp_path / "a.tdms")
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
    (table,) = formats.tables(tmp_path / "a.tdms")
    assert [one.header for one in table.columns] == ["pressure", "force"]
    assert list(table.unread) == ["angle"]


COLUMNS = {"time": T.tolist(), "p": P.tolist(), "displacement": X.tolist()}
RECORDS = [dict(zip(COLUMNS, row, strict=True)) for row in zip(*COLUMNS.values(), strict=True)]


@pytest.mark.parametrize(
    "content",
    [
        COLUMNS,
        {"columns": COLUMNS, "units": {"p": "kPa", "displacement": "cm"}, "load": 2.5},
        RECORDS,
        {"p": COLUMNS["p"], "displacement": COLUMNS["displacement"], "fs": 50},
    ],
    ids=["columns", "with units", "records", "a rate"],
)
@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_json_of_columns(tmp_path: Path, content: Any) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    units = {} if "units" in content else {"pressure": "kPa", "displacement": "cm"}
    (recording,) = mckibben.read(path, units=units)
    check(recording)
    assert recording.meta.get("load") == (2.5 if "load" in content else None)
    (tmp_path / "run.csv").write_text("t_s,p_bar\n" + "".join(f"{k},{k}\n" for k in range(20)))
    assert [each.name for each in mckibben.read(tmp_path)] == ["run"]


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


@pytest.mark.parametrize("compression", [None, "gzip"])
@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", "<f2", ">i2", "u1", "<i8", "?"])
def test_samples_in_chunks_are_those_that_h5py_reads(
    tmp_path: Path, kind: str, compression: str | None
) -> None:
    samples = (10 + 90 * np.sin(np.arange(100.0) / 9)).clip(0, 100).astype(kind)
    for shuffle, sums, shape in ((False, False, (100,)), (True, True, (100, 1))):
        path = tmp_path / f"{shuffle}.h5"
        packing: dict[str, Any] = {"compression": compression, "shuffle": shuffle}
        with h5py.File(path, "w") as file:
            chunks = (7, *shape[1:])
            data = file.create_dataset(
                "a", shape, kind, chunks=chunks, fillvalue=1, fletcher32=sums, **packing
            )
            data[20:] = samples.reshape(shape)[20:]  # two chunks are never written
            expected = data[()].reshape(-1).astype(np.float64)
        np.testing.assert_array_equal(mckibben.read(path)[0]["a"], expected)
