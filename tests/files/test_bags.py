"""Bags of ROS 1 and ROS 2, written by the library of another program."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import mckibben
from mckibben import DataError, Recording
from mckibben.files.folders import roles

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.DataWarning")

KINDS = ("bag", "mcap", "db3")
N, FAST, SLOW, LATE = 100, 10_000_000, 25_000_000, 3_000_000
"""Messages of the pressure; time between them and between others, and how late all are recorded [ns]."""

Kind = Literal["bag", "mcap", "db3"]
Messages = Mapping[str, Sequence[tuple[int, Mapping[str, Any]]]]

TYPES = {
    "/rig/pressure_bar": "std_msgs/msg/Float64",
    "/force_N": "std_msgs/msg/Float64",
    "/air": "sensor_msgs/msg/FluidPressure",
    "/arm": "sensor_msgs/msg/JointState",
    "/words": "std_msgs/msg/String",
}


def bag(path: Path, kind: Kind, messages: Messages, packed: bool = False) -> Path:
    """Write messages, each at a time [ns], and return the file, or the folder of ROS 2."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_JAZZY)
    writer: Any
    if kind == "bag":
        path = path.with_suffix(".bag")
        writer = rosbag1.Writer(path)
        if packed:
            writer.set_compression(rosbag1.Writer.CompressionFormat.BZ2)
    else:
        plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
        if packed:
            modes = rosbag2.CompressionMode, rosbag2.CompressionFormat
            writer.set_compression(modes[0].STORAGE, modes[1].ZSTD)

    def header(stamp: int) -> Any:
        extra = {"seq": 0} if kind == "bag" else {}
        time = store.types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
        return store.types["std_msgs/msg/Header"](stamp=time, frame_id="", **extra)

    serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
    with writer:
        for topic, sent in messages.items():
            name = TYPES[topic]
            connection = writer.add_connection(topic, name, typestore=store)
            for when, fields in sent:
                stamped = {"header": header(fields["header"])} if "header" in fields else {}
                message = store.types[name](**{**fields, **stamped})
                writer.write(connection, when, serialize(message, name))
    return path


def numbers(times: Sequence[int], values: Sequence[float]) -> list[tuple[int, dict[str, Any]]]:
    return [(when, {"data": value}) for when, value in zip(times, values, strict=True)]


def pressure(t: Any) -> Any:
    return 2 + np.sin(9 * t)


def angle(t: Any) -> Any:
    return 0.5 * np.cos(9 * t)


def of_a_robot(began: int = 1_700_000_000 * 10**9) -> dict[str, Any]:
    """Return messages of a pressure without stamps, and of slower stamped joints in changing order."""
    fast, slow = np.arange(N) * FAST, np.arange(0, N * FAST, SLOW)
    joints = []
    for k, when in enumerate(slow.tolist()):
        position = {"a": angle(when * 1e-9), "b": 2 * angle(when * 1e-9)}
        names = sorted(position, reverse=bool(k % 2))
        fields = {
            "header": began + when,
            "name": names,
            "position": np.array([position[name] for name in names]),
            "velocity": np.zeros(0),
            "effort": np.zeros(0),
        }
        joints.append((began + when + LATE, fields))
    air = [
        (began + LATE + when, {"header": began + when, "fluid_pressure": 6e5, "variance": 0.0})
        for when in slow.tolist()
    ]
    sent = numbers((began + LATE + fast).tolist(), pressure(fast * 1e-9).tolist())
    return {
        "/rig/pressure_bar": sent,
        "/arm": joints,
        "/air": air,
        "/words": [(began, {"data": ""})],
    }


ASKED: dict[str, Any] = {
    "columns": {"pressure": "/rig/pressure_bar/data", "angle": "/arm/position/a"},
    "units": {"angle": "rad"},
    "channels": ["pressure", "angle"],
}


def one(path: Path, **options: Any) -> Recording:
    (recording,) = mckibben.read(path, **options)
    return recording


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_topics_are_put_on_the_slowest_clock_by_their_stamps(
    tmp_path: Path, kind: Kind, packed: bool
) -> None:
    if packed and kind == "db3":
        pytest.skip("is packed as a whole file, which is no database then")
    path = bag(tmp_path / "run", kind, of_a_robot(), packed)
    recording = one(path, **ASKED)
    assert recording.sample_time == pytest.approx(SLOW * 1e-9)
    t = recording.time  # since the first message, which is one of words
    assert recording["angle"] == pytest.approx(angle(t), abs=1e-9)
    assert recording["arm_position_b"] == pytest.approx(2 * angle(t), abs=1e-9)
    # the pressure has no stamps: it seems as late as it was recorded
    assert recording["pressure"] == pytest.approx(pressure(t - LATE * 1e-9), abs=2e-3)
    air = one(path, columns={"pressure": "/air/fluid_pressure"})
    assert air["pressure"] == pytest.approx(6.0)  # in Pa, as the type of its messages says
    assert roles(tmp_path) == {"train": [path]}


def test_a_bag_in_several_files(tmp_path: Path) -> None:
    began = 1_700_000_000 * 10**9
    whole, cut = (bag(tmp_path / name, "db3", of_a_robot(began)) for name in ("whole", "cut"))
    (first,) = cut.glob("*.db3")
    second = first.with_name("cut_1.db3")
    shutil.copy(first, second)
    for path, sign in ((first, ">="), (second, "<")):
        with closing(sqlite3.connect(path)) as base:
            base.execute(f"DELETE FROM messages WHERE timestamp {sign} ?", [began + N * FAST // 2])
            base.commit()
    found, expected = one(cut, **ASKED), one(whole, **ASKED)
    assert found["angle"] == pytest.approx(expected["angle"], abs=1e-5)
    assert found.time == pytest.approx(expected.time, abs=1e-6)


TIMES = [k * FAST for k in range(50)]
VALUES = [1.0 + k for k in range(50)]


@pytest.mark.parametrize(
    ("messages", "channel", "row"),
    [
        ({"/rig/pressure_bar": numbers(TIMES, [*VALUES[:7], np.nan, *VALUES[8:]])}, "pressure", 8),
        ({"/rig/pressure_bar": numbers([*TIMES[:7], *TIMES[6:-1]], VALUES)}, "pressure", 8),
        (
            {
                "/rig/pressure_bar": numbers(TIMES, VALUES),
                "/force_N": numbers([10**10 + when for when in TIMES], VALUES),
            },
            "pressure",
            None,
        ),
        ({"/words": [(1, {"data": "up"})]}, None, None),
    ],
    ids=["a sample that is missing", "a time that is repeated", "no common time", "no numbers"],
)
def test_what_cannot_be_read(
    tmp_path: Path, messages: Messages, channel: str | None, row: int | None
) -> None:
    path = bag(tmp_path / "run", "mcap", messages)
    with pytest.raises(DataError) as caught:
        mckibben.read(path)
    assert (caught.value.channel, caught.value.row) == (channel, row)
