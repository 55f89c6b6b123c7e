"""What is written is read back equal, to the last bit."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mckibben
from mckibben import DataError, DataWarning, Recording

ENDINGS = (".csv", ".tsv", ".parquet")
finite = st.floats(allow_nan=False, allow_infinity=False)
names = (
    st.sampled_from(
        ["pressure", "displacement", "displacement_model", "u1_V", "x", "t", "#1", "a,b"]
    )
    | st.text(min_size=1, max_size=8).filter(lambda s: s.isprintable() and s.strip())
).filter(lambda s: s != "time")
json_values: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | finite | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=5,
)


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    n = draw(st.integers(10, 30))
    channels = draw(
        st.dictionaries(names, st.lists(finite, min_size=n, max_size=n), min_size=1, max_size=4)
    )
    units = {
        name: draw(st.sampled_from(["", "cm", "V", "l/min"]))
        for name in channels
        if mckibben.recording.standard_unit(name) is None
    }
    return Recording(
        {name: np.array(samples) for name, samples in channels.items()},
        sample_time=draw(st.none() | st.floats(1e-9, 1e9)),
        units=units,
        start_time=draw(st.floats(-1e9, 1e9)),
        meta=draw(st.dictionaries(st.text(max_size=6), json_values, max_size=3)),
    )


@pytest.mark.parametrize("ending", ENDINGS)
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(recording=recordings())
def test_read_gives_back_what_write_took(recording: Recording, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"run{ending}"
    mckibben.write(recording, path)
    (back,) = mckibben.read(path)
    assert back == recording
    assert {k: v.tobytes() for k, v in back.channels.items()} == {
        k: v.tobytes() for k, v in recording.channels.items()
    }
    assert not list(tmp_path.glob("*.part"))


UNITS = {"time": "s", "pressure": "bar", "displacement_model": "mm"}


@pytest.fixture
def recording() -> Recording:
    k = np.arange(50)
    return Recording(
        {"pressure": np.sin(k / 7) + 1, "displacement_model": np.cos(k / 5)},
        sample_time=1 / 30,
        start_time=0.1,
        meta={"rig": "bench 2", "load_N": 12.5},
    )


def test_csv_is_plain_to_other_programs(recording: Recording, tmp_path: Path) -> None:
    import pandas as pd

    mckibben.write(recording, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().startswith("time,pressure,displacement_model\n0.1,")
    frame = pd.read_csv(tmp_path / "a.csv")
    assert np.array_equal(frame["pressure"], recording["pressure"])
    described = json.loads((tmp_path / "a.csv-metadata.json").read_text())
    assert described["format"] == "mckibben-recording"
    assert described["units"] == {"pressure": "bar", "displacement_model": "mm"}


OTHERS = [
    *("", "{", "[]", "null", "[" * 100_000, "9" * 5000),
    *({"format": "other"}, {"sha256": "0" * 64}, {"units": {"pressure": "bar"}}),
    {"units": {"pressure": "bar", "displacement_model": "mm", "force": "N"}},
    {"units": {"displacement_model": "mm", "pressure": "bar"}},
    {"units": {"pressure\x1b[31m": "bar", "displacement_model": "mm"}},
    *({"sample_time": None}, {"sample_time": 1e-320}, {"sample_time": 0.0}),
]


@pytest.mark.parametrize("other", OTHERS, ids=lambda other: str(other)[:40])
def test_a_description_that_is_broken_or_of_another_file_is_ignored_with_a_note(
    recording: Recording, tmp_path: Path, other: Any
) -> None:
    path, beside = tmp_path / "a.csv", tmp_path / "a.csv-metadata.json"
    mckibben.write(recording, path)
    about = json.loads(beside.read_text(encoding="utf-8"))
    beside.write_text(other if isinstance(other, str) else json.dumps(about | other))
    with pytest.warns(DataWarning, match=r"a\.csv"):
        (back,) = mckibben.read(path, units=UNITS)
    assert back.sample_time == pytest.approx(1 / 30)
    assert (back.meta["file"], "rig" in back.meta) == (str(path), False)
    assert np.array_equal(back["pressure"], recording["pressure"])


def test_columns_of_no_telling_name_are_taken_by_their_units(tmp_path: Path) -> None:
    path = tmp_path / "arm.csv"
    rows = "\n".join(f"{k * 0.1},{k},{k % 3},{k * 2},{k % 5}" for k in range(20))
    path.write_text(f"time_s,u1_V,u2_V,y1_cm,q2\n{rows}")
    with pytest.warns(DataWarning, match="'u1_V'.*voltage_1.*'y1_cm'"):
        (recording,) = mckibben.read(path)
    assert list(recording.channels) == ["voltage_1", "voltage_2", "displacement_1", "q2"]
    assert recording["displacement_1"][1] == 20.0
    assert len(recording.notes) == 1


@pytest.mark.parametrize("said", [{"channels": ["input"]}, {"units": {"input": "mV"}}])
def test_what_is_spoken_of_by_its_own_name_keeps_it(tmp_path: Path, said: Any) -> None:
    path = tmp_path / "wing.csv"
    path.write_text("input_V,output_deg\n" + "\n".join(f"{k % 5},{k % 3}" for k in range(20)))
    with pytest.warns(DataWarning, match="'output_deg'"):
        assert list(mckibben.read(path, **said)[0].channels) == ["input", "angle"]
    with pytest.warns(DataWarning, match="'input_V'.*'output_deg'"):
        assert list(mckibben.read(path)[0].channels) == ["voltage", "angle"]


def test_own_files_follow_columns_units_rate_and_channels(tmp_path: Path) -> None:
    path = tmp_path / "sim.csv"
    k = np.arange(20, dtype=float)
    mckibben.write(
        Recording({"pressure": k, "pressure_model": 2 * k, "y": k}, units={"y": "cm"}), path
    )
    (one,) = mckibben.read(path, columns={"pressure": "pressure_model"}, rate=10)
    assert one.sample_time == 0.1
    assert np.array_equal(one["pressure"], 2 * k)
    assert list(one.channels) == ["pressure", "y"]
    (two,) = mckibben.read(path, columns={"displacement": "y"}, units={"pressure": "kPa"})
    assert np.allclose(two["displacement"], 10 * k)
    assert np.allclose(two["pressure"], k / 100)
    with pytest.raises(DataError) as caught:
        mckibben.read(path, channels=["force"])
    assert caught.value.channel == "force"


@pytest.mark.parametrize("name", ["a.mat", "a.xlsx", "a", "no/a.csv", "no/a.tsv", "no/a.parquet"])
def test_other_endings_and_missing_folders_are_refused(
    recording: Recording, tmp_path: Path, name: str
) -> None:
    with pytest.raises(DataError) as caught:
        mckibben.write(recording, tmp_path / name)
    assert caught.value.file in (tmp_path / name, (tmp_path / name).parent)
    assert not list(tmp_path.iterdir())


ONES = np.ones(10)
BAD = [Recording({name: ONES}) for name in ("time", "a\nb", " ")]
BAD += [Recording({"x": ONES}, meta={"a": value}) for value in ({1, 2}, float("nan"))]
BAD += [Recording({"x": ONES}, units={"x": "\x1b[2J"})]


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("bad", BAD, ids=str)
def test_what_cannot_be_read_back_is_not_written_and_nothing_is_lost(
    recording: Recording, tmp_path: Path, bad: Recording, ending: str
) -> None:
    path = tmp_path / f"a{ending}"
    mckibben.write(recording, path)
    with pytest.raises(DataError):
        mckibben.write(bad, path)
    assert mckibben.read(path) == [recording]
