"""What is written is read back equal, to the last bit."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mckibben
from mckibben import DataError, Recording
from tests.files.made import one, place, put, refused
from tests.refusals import mentions

finite = st.floats(allow_nan=False, allow_infinity=False)
known = ["pressure", "displacement", "displacement_model", "u1_V", "x", "t", "#1", "a,b"]
words = st.text(min_size=1, max_size=8).filter(lambda s: s.isprintable() and s.strip())
names = (st.sampled_from(known) | words).filter(lambda s: s != "time")
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
    samples = st.lists(finite, min_size=n, max_size=n).map(np.array)
    channels = draw(st.dictionaries(names, samples, min_size=1, max_size=4))
    units = {
        name: draw(st.sampled_from(["", "cm", "V", "l/min"]))
        for name in channels
        if mckibben.recording.standard_unit(name) is None
    }
    return Recording(
        channels,
        sample_time=draw(st.none() | st.floats(1e-9, 1e9)),
        units=units,
        start_time=draw(st.floats(-1e9, 1e9)),
        meta=draw(st.dictionaries(st.text(max_size=6), json_values, max_size=3)),
    )


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(recording=recordings())
def test_read_gives_back_what_write_took(recording: Recording, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    mckibben.write(recording, path)
    (back,) = mckibben.read(path)  # without a warning
    assert back == recording
    assert {k: v.tobytes() for k, v in back.channels.items()} == {
        k: v.tobytes() for k, v in recording.channels.items()
    }
    assert not list(tmp_path.glob("*.part"))


K: Any = np.arange(50.0)
RECORDING = Recording(
    {"pressure": np.sin(K / 7) + 1, "displacement_model": np.cos(K / 5), "y": K},
    sample_time=1 / 30,
    units={"y": "cm"},
    start_time=0.1,
    meta={"rig": "bench 2", "load_N": 12.5, "noted in": "run\udcff.txt"},
)
UNITS = {"pressure": "bar", "displacement_model": "mm", "y": "cm"}


def test_csv_is_plain_to_other_programs(tmp_path: Path) -> None:
    mckibben.write(RECORDING, tmp_path / "a.csv")
    frame = pd.read_csv(tmp_path / "a.csv")
    assert list(frame) == ["time", *UNITS]
    assert frame["time"][0] == 0.1
    assert np.array_equal(frame["pressure"], RECORDING["pressure"])
    about = json.loads((tmp_path / "a.csv-metadata.json").read_text())
    assert (about["format"], about["units"]) == ("mckibben-recording", UNITS)


OTHERS = ["", "{", "[]", "null", "[" * 100_000, "9" * 5000, {"format": "other"}]
CHANGED: list[Any] = [
    *({"sha256": "0" * 64}, {"units": {"pressure": "bar"}}, {"units": UNITS | {"y": "mm"}}),
    *({"units": UNITS | {"force": "N"}}, {"units": dict(reversed(UNITS.items()))}),
    {"units": {"pressure\x1b[31m": "bar", "displacement_model": "mm", "y": "cm"}},
    *({"sample_time": step} for step in (1e-320, 0.0, None, 1 / 31, 1 / 30 + 1e-15)),
    *({"start_time": 0.2}, {"meta": {"rig": "bench 2"}}, {"meta": {}}, {"more": 1}),
    *({"version": version} for version in (0, 1, 3, True)),
]


@pytest.mark.parametrize("other", OTHERS, ids=lambda other: str(other)[:40])
def test_a_description_that_is_not_by_this_package_is_ignored_with_a_note(
    tmp_path: Path, other: Any
) -> None:
    path, beside = tmp_path / "a.csv", tmp_path / "a.csv-metadata.json"
    mckibben.write(RECORDING, path)
    about = json.loads(beside.read_text(encoding="utf-8"))
    beside.write_text(other if isinstance(other, str) else json.dumps(about | other))
    back = one(path, units={"time": "s", **UNITS})
    assert back.notes
    assert back.sample_time == pytest.approx(1 / 30)
    assert (back.meta["file"], "rig" in back.meta) == (str(path), False)
    assert np.array_equal(back["pressure"], RECORDING["pressure"])


def put_beside(path: Path, **other: Any) -> None:
    """Change a description."""
    beside = path.with_name(f"{path.name}-metadata.json")
    beside.write_text(json.dumps(json.loads(beside.read_text(encoding="utf-8")) | other))


@pytest.mark.parametrize("other", CHANGED, ids=lambda other: str(other)[:40])
def test_a_description_never_overrules_its_samples(tmp_path: Path, other: Any) -> None:
    path = tmp_path / "a.csv"
    mckibben.write(RECORDING, path)
    put_beside(path, **other)
    error = refused(path)
    assert error.file == path
    assert ("newer" in error.problem) == (other == {"version": 3})
    assert mentions(error.remedy, "a.csv-metadata.json")
    path.with_name("a.csv-metadata.json").unlink()
    assert one(path, units=UNITS).sample_time == pytest.approx(1 / 30)


def test_the_description_of_another_recording_is_refused(tmp_path: Path) -> None:
    for name, gain in (("a", 1.0), ("b", 2.0)):
        doubled = RECORDING.with_channels(pressure=gain * RECORDING["pressure"])
        mckibben.write(doubled, tmp_path / f"{name}.csv")
    (tmp_path / "b.csv-metadata.json").replace(tmp_path / "a.csv-metadata.json")
    assert refused(tmp_path / "a.csv").file == tmp_path / "a.csv"


@pytest.mark.parametrize(
    "other", [{}, {"sample_time": 1 / 31}, {"sample_time": 1 / 30 + 1e-12}, {"start_time": 0.2}]
)
def test_of_version_1_the_times_are_checked(tmp_path: Path, other: Any) -> None:
    path = tmp_path / "a.csv"
    mckibben.write(RECORDING, path)
    samples = hashlib.sha256(path.read_bytes()).hexdigest()
    put_beside(path, version=1, sha256=samples, **other)
    if other:
        assert refused(path).file == path
    else:
        assert one(path) == RECORDING


@pytest.mark.parametrize(
    ("header", "options", "channels", "noted"),
    [
        ("u1_V,u2_V,y1_cm,q2", {}, ["voltage_1", "voltage_2", "displacement_1", "q2"], "'y1_cm'"),
        ("input_V,output_deg", {}, ["voltage", "angle"], "'input_V'"),
        ("input_V,output_deg", {"channels": ["input"]}, ["input", "angle"], "'output_deg'"),
        ("input_V,output_deg", {"units": {"input": "mV"}}, ["input", "angle"], "'output_deg'"),
    ],
)
def test_columns_without_known_names_are_taken_by_their_units(
    tmp_path: Path, header: str, options: Any, channels: list[str], noted: str
) -> None:
    columns = [K % (m + 3) for m in range(header.count(",") + 1)]
    recording = one(put(tmp_path / "arm.csv", f"time_s,{header}", K / 10, *columns), **options)
    assert list(recording.channels) == channels
    (note,) = recording.notes
    assert noted in note


def test_own_files_follow_columns_units_rate_and_channels(tmp_path: Path) -> None:
    path = tmp_path / "sim.csv"
    mckibben.write(
        Recording({"pressure": K, "pressure_model": 2 * K, "y": K}, units={"y": "cm"}), path
    )
    first = one(path, columns={"pressure": "pressure_model"}, rate=10)
    assert (first.sample_time, list(first.channels)) == (0.1, ["pressure", "y"])
    assert np.array_equal(first["pressure"], 2 * K)
    second = one(path, columns={"displacement": "y"})
    assert np.allclose(second["displacement"], 10 * K)
    assert place(path, units={"pressure": "kPa"}) == ("pressure", None)
    assert place(path, channels=["force"]) == ("force", None)


@pytest.mark.parametrize("name", ["a.mat", "a.tsv", "a", "no/a.csv"])
def test_other_endings_and_missing_folders_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(DataError) as caught:
        mckibben.write(RECORDING, tmp_path / name)
    assert caught.value.file in (tmp_path / name, (tmp_path / name).parent)
    assert not list(tmp_path.iterdir())


ONES = np.ones(10)
UNWRITABLE = [{1, 2}, float("nan"), "x" * 2**22]
BAD = [Recording({name: ONES}) for name in ("a\nb", " ")]
BAD += [Recording({"x": ONES}, meta={"a": value}) for value in UNWRITABLE]
BAD += [Recording({"x": ONES}, units={"x": "\x1b[2J"})]


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: str(bad)[:60])
def test_what_cannot_be_read_back_is_not_written_and_nothing_is_lost(
    tmp_path: Path, bad: Recording
) -> None:
    path = tmp_path / "a.csv"
    mckibben.write(RECORDING, path)
    with pytest.raises(DataError):
        mckibben.write(bad, path)
    assert mckibben.read(path) == [RECORDING]
