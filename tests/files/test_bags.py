"""Bags of ROS 1 and ROS 2, written by another program's library."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files.folders import roles
from tests.files.rosbags_made import BEGAN, FAST, SLOW, Kind, N, angle, pressure, write

KINDS: tuple[Kind, ...] = ("bag", "mcap", "db3")
ASKED: dict[str, Any] = {
    "columns": {"pressure": "/rig/pressure/data", "angle": "/joint_states/position/elbow"},
    "units": {"pressure": "bar", "angle": "rad"},
    "channels": ["pressure", "angle"],
}


def one(path: Path, **options: Any) -> Recording:
    (recording,) = mckibben.read(path, **options)
    return recording


def file_of(path: Path, kind: Kind) -> Path:
    """Return the file in a bag's folder."""
    return next(path.glob(f"*.{kind}")) if path.is_dir() else path


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_topics_are_put_on_the_slowest_clock(tmp_path: Path, kind: Kind, packed: bool) -> None:
    if packed and kind == "db3":
        pytest.skip("is packed as a whole file, which is no database then")
    path = write(tmp_path / "run", kind, packed=packed)
    with pytest.warns(DataWarning, match=r"pressure 100, angle 40.*'angle'"):
        recording = one(path, **ASKED)
    assert recording.sample_time == pytest.approx(SLOW * 1e-9)
    t = recording.time
    assert recording["angle"] == pytest.approx(angle(t), abs=1e-12)
    between = np.interp(t, np.arange(N) * FAST * 1e-9, pressure(np.arange(N) * FAST * 1e-9))
    assert recording["pressure"] == pytest.approx(between, abs=1e-12)
    assert recording["joint_states_effort_shoulder"].tolist() == [2.0] * recording.n_samples
    assert recording["state_mode"].tolist() == [float(k % 3) for k in range(recording.n_samples)]
    assert recording["state_strain_2"] == pytest.approx(3 * t, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_units_that_types_and_names_tell(tmp_path: Path, kind: Kind) -> None:
    path = write(tmp_path / "run", kind)
    asked = ["pressure"]  # which two topics and a field say
    with pytest.raises(DataError, match="/rig/pressure") as caught:
        mckibben.read(path, channels=asked)
    assert caught.value.channel == "pressure"
    with pytest.warns(DataWarning):
        everything = one(path)
    assert everything["state_pressure"] == pytest.approx(pressure(everything.time))
    assert everything.units["state_pressure"] == "bar"
    air = one(path, columns={"pressure": "/air/fluid_pressure"}, channels=["pressure"])
    assert air["pressure"] == pytest.approx(6 + 1e-5 * air.time)
    assert air.units["hand_wrench_force_z"] == "N"
    state = one(path, columns={"pressure": "/state/pressure_kPa"}, channels=["pressure"])
    assert state["pressure"] == pytest.approx(pressure(state.time))


def test_times_are_those_of_the_header(tmp_path: Path) -> None:
    path = write(tmp_path / "run", "mcap", late=3_000_000)
    with pytest.warns(DataWarning):
        recording = one(path, **ASKED)
    # the angle is stamped, the pressure is not: it seems 3 ms late, as it was recorded
    t = recording.time + 0.003
    assert recording["angle"] == pytest.approx(angle(t), abs=1e-9)
    assert recording["pressure"] == pytest.approx(pressure(recording.time), abs=2e-3)


def test_a_rate_may_be_asked_for(tmp_path: Path) -> None:
    path = write(tmp_path / "run", "bag")
    with pytest.warns(DataWarning, match="200"):
        recording = one(path, rate=200, **ASKED)
    assert recording.sample_time == 0.005
    assert recording["angle"] == pytest.approx(angle(recording.time), abs=5e-3)


def test_a_file_and_its_folder_are_one(tmp_path: Path) -> None:
    path = write(tmp_path / "run", "mcap")
    with pytest.warns(DataWarning):
        assert one(path, **ASKED) == one(file_of(path, "mcap"), **ASKED)
    assert roles(tmp_path) == {"train": [path]}


def test_a_bag_in_several_files(tmp_path: Path) -> None:
    whole, cut = write(tmp_path / "whole", "db3"), write(tmp_path / "cut", "db3")
    first = file_of(cut, "db3")
    second = first.with_name("cut_1.db3")
    shutil.copy(first, second)
    for path, sign in ((first, ">="), (second, "<")):
        with closing(sqlite3.connect(path)) as base:
            base.execute(f"DELETE FROM messages WHERE timestamp {sign} ?", [BEGAN + N * FAST // 2])
            base.commit()
    with pytest.warns(DataWarning):
        found, expected = one(cut, **ASKED), one(whole, **ASKED)
    assert found["angle"] == pytest.approx(expected["angle"], abs=1e-9)
    assert found.time == pytest.approx(expected.time, abs=1e-6)


def test_definitions_of_the_standard_are_known_without_the_file(tmp_path: Path) -> None:
    path = write(tmp_path / "run", "db3")
    with closing(sqlite3.connect(file_of(path, "db3"))) as base:
        base.execute("DROP TABLE message_definitions")
        base.commit()
    with (
        pytest.warns(DataWarning, match="angle 40"),
        pytest.warns(DataWarning, match="/state .*'rig_msgs/msg/State'"),
    ):
        recording = one(path, **ASKED)
    assert recording["angle"] == pytest.approx(angle(recording.time), abs=1e-12)


# What cannot be read ------------------------------------------------------------------------------


def bag_of(path: Path, put: Callable[[Any, Any], None]) -> Path:
    """Write a bag of ROS 2 by a function of its writer and types, and return its file."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        put(writer, store)
    return next(path.glob("*.mcap"))


def floats(topic: str, times: list[int], values: list[float]) -> Callable[[Any, Any], None]:
    """Return a function that writes numbers at times [ns]."""

    def put(writer: Any, store: Any) -> None:
        kind = "std_msgs/msg/Float64"
        sent = writer.add_connection(topic, kind, typestore=store)
        for when, value in zip(times, values, strict=True):
            writer.write(sent, when, store.serialize_cdr(store.types[kind](value), kind))

    return put


def test_samples_missing_and_times_repeated(tmp_path: Path) -> None:
    times = [k * 10**7 for k in range(50)]
    values = [1.0 + k for k in range(50)]
    nan = [*values[:7], float("nan"), *values[8:]]
    path = bag_of(tmp_path / "nan", floats("/pressure_bar", times, nan))
    with pytest.raises(DataError, match="1 of 50") as caught:
        mckibben.read(path)
    assert (caught.value.channel, caught.value.row) == ("pressure", 8)
    path = bag_of(tmp_path / "again", floats("/pressure_bar", [*times[:7], *times[6:-1]], values))
    with pytest.raises(DataError, match=r"0\.06 s to 0\.06 s") as caught:
        mckibben.read(path)
    assert (caught.value.channel, caught.value.row) == ("pressure", 8)


def test_joints_are_told_by_name_in_whatever_order(tmp_path: Path) -> None:
    def put(writer: Any, store: Any) -> None:
        kind = "sensor_msgs/msg/JointState"
        sent = writer.add_connection("/arm", kind, typestore=store)
        stamp = store.types["builtin_interfaces/msg/Time"](0, 0)
        header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        none = np.zeros(0)
        for k in range(50):
            joints = {"a": 1.0 + k, "b": -1.0 - k}
            names = sorted(joints, reverse=bool(k % 2))
            position = np.array([joints[name] for name in names])
            state = store.types[kind](header, names, position, none, none)
            writer.write(sent, k * 10**7, store.serialize_cdr(state, kind))

    recording = one(bag_of(tmp_path / "run", put))
    assert recording.sample_time == 0.01  # by when it was recorded, as no stamp was set
    assert recording["arm_position_a"].tolist() == [1.0 + k for k in range(50)]
    assert recording["arm_position_b"].tolist() == [-1.0 - k for k in range(50)]


def test_topics_with_no_time_in_common(tmp_path: Path) -> None:
    def put(writer: Any, store: Any) -> None:
        times = [k * 10**7 for k in range(50)]
        floats("/pressure_bar", times, [1.0 + k for k in range(50)])(writer, store)
        later = [10**10 + when for when in times]
        floats("/force_N", later, [1.0 + k for k in range(50)])(writer, store)

    with pytest.raises(DataError, match=r"pressure from 0 to 0.49 s; force from 10"):
        mckibben.read(bag_of(tmp_path / "run", put))


def test_no_numbers(tmp_path: Path) -> None:
    def put(writer: Any, store: Any) -> None:
        kind = "std_msgs/msg/String"
        sent = writer.add_connection("/words", kind, typestore=store)
        writer.write(sent, 1, store.serialize_cdr(store.types[kind]("up"), kind))

    with pytest.raises(DataError, match="/words"):
        mckibben.read(bag_of(tmp_path / "run", put))


def test_a_folder_without_files(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    with pytest.raises(DataError, match=r"\.db3 or \.mcap"):
        mckibben.read(tmp_path)
