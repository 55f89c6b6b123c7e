"""Bags of ROS 1 and ROS 2, written by RosBags."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError
from mckibben.files import formats
from mckibben.files.sources import roles
from mckibben.files.table import Table

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.DataWarning")

KINDS = ("bag", "mcap", "db3")
BEGAN, STEP, LATE = 1_700_000_000_123_456_789, 10_000_001, 3_000_000
"""First message, time between two, and how long after its stamp one is recorded [ns]."""

TYPES = {
    "/rig/pressure_bar": "std_msgs/msg/Float64",
    "/force_N": "std_msgs/msg/Float64",
    "/count": "std_msgs/msg/UInt8",
    "/air": "sensor_msgs/msg/FluidPressure",
    "/arm": "sensor_msgs/msg/JointState",
    "/words": "std_msgs/msg/String",
    "/picture": "std_msgs/msg/Float64MultiArray",
    "/near": "diagnostic_msgs/msg/DiagnosticStatus",
    "/clock": "rosgraph_msgs/msg/Clock",
}
Messages = Mapping[str, Sequence[tuple[int, Mapping[str, Any]]]]


def bag(path: Path, kind: str, messages: Messages, packed: str = "") -> Path:
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
            mode = rosbag2.CompressionMode[packed]
            writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)

    def message(name: str, fields: Mapping[str, Any]) -> Any:
        made = dict(fields)
        for place in made.keys() & {"stamp", "clock"}:
            time = store.types["builtin_interfaces/msg/Time"](*divmod(made[place], 10**9))
            made[place] = time
        if "stamp" in made:
            time = made.pop("stamp")
            extra = {"seq": 0} if kind == "bag" else {}
            made["header"] = store.types["std_msgs/msg/Header"](stamp=time, frame_id="", **extra)
        if "layout" in made:
            made["layout"] = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        return store.types[name](**made)

    serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
    with writer:
        for topic, sent in messages.items():
            connection = writer.add_connection(topic, TYPES[topic], typestore=store)
            for when, fields in sent:
                raw = serialize(message(TYPES[topic], fields), TYPES[topic])
                writer.write(connection, when, raw)
    return path


def numbers(values: Sequence[float], began: int = BEGAN, step: int = STEP) -> list[Any]:
    return [(began + k * step, {"data": value}) for k, value in enumerate(values)]


def joints(n: int) -> list[Any]:
    """Return stamped joints whose order changes."""
    found = []
    for k in range(n):
        names = ["a", "b"][:: -1 if k % 2 else 1]
        position = np.array([{"a": 0.1, "b": 0.2}[name] * k for name in names])
        fields = {"name": names, "position": position, "velocity": position[:0], "effort": position}
        found.append((BEGAN + 2 * k * STEP + LATE, {"stamp": BEGAN + 2 * k * STEP, **fields}))
    return found


PRESSURE = (2 + np.sin(np.arange(40) / 3)).tolist()
AIR = {"fluid_pressure": 6e5, "variance": 0.0}
STAMPED: Messages = {
    "/arm": joints(20),
    "/air": [(BEGAN + k * STEP, {"stamp": BEGAN + k * STEP - LATE, **AIR}) for k in range(12)],
}
MIXED: Messages = {
    **STAMPED,
    "/rig/pressure_bar": numbers(PRESSURE),
    "/count": numbers([k % 256 for k in range(30)]),
    "/words": numbers(["up"]),  # type: ignore[list-item]
    "/picture": [(BEGAN, {"layout": None, "data": np.ones(65)})],
    "/near": [(BEGAN, {"level": 2, "name": "", "message": "", "hardware_id": "", "values": []})],
    "/clock": [(BEGAN, {"clock": BEGAN})],
}


def table(path: Path) -> Table:
    (found,) = formats.bag(path) if path.is_dir() else formats.tables(path)
    return found


def columns(found: Table) -> dict[str, tuple[list[float], list[float]]]:
    """Return times and samples by header."""
    return {
        column.header: (np.asarray(column.times).tolist(), np.asarray(column.values).tolist())
        for column in found.columns
    }


def seconds(n: int, step: int = STEP, start: int = 0) -> list[float]:
    return [(start + k * step) / 10**9 for k in range(n)]


@pytest.mark.parametrize(
    ("kind", "packed"),
    [*((kind, "") for kind in KINDS), ("bag", "BZ2"), ("mcap", "STORAGE"), ("db3", "MESSAGE")],
)
def test_columns_are_what_was_written_each_at_its_times(
    tmp_path: Path, kind: str, packed: str
) -> None:
    path = bag(tmp_path / "run", kind, MIXED, packed)
    path = path.rename(path.with_stem("50% #1?"))  # which are signs in addresses
    one = table(path)
    found = columns(one)
    assert found["/rig/pressure_bar/data"] == (seconds(40), PRESSURE)
    assert found["/count/data"] == (seconds(30), list(range(30)))
    for joint, scale in (("a", 0.1), ("b", 0.2)):
        expected = seconds(20, 2 * STEP, LATE), [scale * k for k in range(20)]
        assert found[f"/arm/position/{joint}"] == found[f"/arm/effort/{joint}"] == expected
    assert [each for each in found if "/near" in each] == ["/near/level"]  # constants are no fields
    assert one.meta == {"time_source": "recording times"}  # as the pressure has no stamps
    reasons = {"/words": "no numbers", "/picture/data": "array of 65", "/clock/clock": "a time"}
    assert all(reason in one.unread[place] for place, reason in reasons.items())
    assert {column.header: column.held for column in one.columns}["/count/data"]
    if kind != "bag" and not packed:
        (alone,) = (each for each in path.iterdir() if each.suffix == f".{kind}")
        assert columns(table(alone)) == found
    (recording,) = mckibben.read(path, columns={"pressure": "/air/fluid_pressure"})
    assert recording["pressure"] == pytest.approx(6.0)  # in Pa, as the type of its messages has it
    assert roles(tmp_path) == {"train": [path]}


@pytest.mark.parametrize("kind", KINDS)
def test_stamps_are_the_times_where_all_topics_have_them(tmp_path: Path, kind: str) -> None:
    found = table(bag(tmp_path / "run", kind, {**STAMPED, "/words": MIXED["/words"]}))
    assert found.meta == {"time_source": "header stamps"}
    times = {name: times for name, (times, _) in columns(found).items()}
    assert times["/air/fluid_pressure"] == seconds(12)
    assert times["/arm/position/a"] == seconds(20, 2 * STEP, LATE)  # the air's came first


def test_a_bag_cut_into_files_is_the_whole_one(tmp_path: Path) -> None:
    whole, cut = (bag(tmp_path / name, "db3", MIXED) for name in ("whole", "cut"))
    first = cut / "cut.db3"
    second = cut / "cut_1.db3"
    shutil.copy(first, second)
    about = (cut / "metadata.yaml").read_text()
    (cut / "metadata.yaml").write_text(about.replace("- cut.db3", "- cut.db3\n  - cut_1.db3"))
    for path, sign in ((first, ">="), (second, "<")):
        change(path, f"DELETE FROM messages WHERE timestamp {sign} {BEGAN + 11 * STEP}")
    assert columns(table(cut)) == columns(table(whole))
    packed = bag(tmp_path / "packed", "db3", MIXED, "FILE")
    asked = {"angle": "/arm/position/a"}
    (one,), (other,) = (mckibben.read(path, columns=asked) for path in (whole, packed))
    assert np.array_equal(one["angle"], other["angle"])


def change(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path)) as base:
        for statement in statements:
            base.execute(statement)
        base.commit()


def database(folder: Path, *statements: str) -> Path:
    """Return the database of a bag with a pressure and a count, changed."""
    messages = {"/rig/pressure_bar": numbers(PRESSURE), "/count": numbers(list(range(40)))}
    path = bag(folder / "run", "db3", messages) / "run.db3"
    change(path, *statements)
    return path


IDL = "module std_msgs { module msg { struct Float64 { double data; }; }; };"
DEFINED = (
    "UPDATE message_definitions SET encoding = '{}', encoded_message_definition = '{}' "
    "WHERE topic_type = 'std_msgs/msg/{}'"
)
OF_COUNT = "WHERE name = '/count'"


@pytest.mark.parametrize(
    ("statements", "reason"),
    [
        (["UPDATE schema SET schema_version = 3", "DROP TABLE message_definitions"], ""),
        ([DEFINED.format("ros2idl", IDL, "Float64")], ""),
        (["UPDATE messages SET data = x'00010000' WHERE id = 77"], "message 37"),
        ([f"UPDATE topics SET serialization_format = 'json' {OF_COUNT}"], "json"),
        ([DEFINED.format("ros2msg", "Other data", "UInt8")], "Other"),
        ([f"UPDATE topics SET type = 'rig/msg/Unknown' {OF_COUNT}"], "Unknown"),
    ],
    ids=["no definitions", "IDL", "a message cut off", "JSON", "no such part", "no such type"],
)
def test_a_topic_is_read_or_listed_with_the_reason(
    tmp_path: Path, statements: list[str], reason: str
) -> None:
    one = table(database(tmp_path, *statements))
    found = columns(one)
    assert found.pop("/rig/pressure_bar/data") == (seconds(40), PRESSURE)
    assert bool(found) is not bool(reason)
    assert reason in one.unread.get("/count", "")


ATTACKS = [
    ("rig/msg/A\"\"\"\n    {code}\n    \"\"\"", "float64 data"),
    ("rig/msg/A", "float64 data\nstring X='\"\"\"); {code} #'"),
    ("rig/msg/A", "float64 data = {code}"),
    ("rig/msg/A", "float64[{code}] data"),
    ("rig/msg/A", "float64 data\nfloat64 x: {code}"),
    ("rig/msg/A\nfloat64 data\n{line}\nMSG: rig/msg/B(object):\n  {code}\nclass C", "float64 data"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "text"), ATTACKS)
def test_code_in_definitions_is_never_run(tmp_path: Path, kind: str, text: str) -> None:
    ran = tmp_path / "ran"
    code = f"__import__('pathlib').Path('{ran}').touch()"
    kind, text = (each.format(code=code, line="=" * 80).replace("'", "''") for each in (kind, text))
    path = database(
        tmp_path,
        f"UPDATE topics SET type = '{kind}'",
        f"UPDATE message_definitions SET topic_type = '{kind}', encoded_message_definition = '{text}'",
    )
    try:
        assert mckibben.read(path)
    except DataError as error:
        assert error.file == path  # noqa: PT017
    assert not ran.exists()


@pytest.mark.parametrize(
    ("messages", "channel"),
    [
        (
            {
                "/rig/pressure_bar": numbers(PRESSURE),
                "/force_N": numbers(PRESSURE, BEGAN + 10**10),
            },
            "pressure",
        ),
        ({"/words": MIXED["/words"]}, None),
    ],
    ids=["no common time", "no numbers"],
)
def test_what_cannot_be_read(tmp_path: Path, messages: Messages, channel: str | None) -> None:
    path = bag(tmp_path / "run", "mcap", messages)
    with pytest.raises(DataError) as caught:
        mckibben.read(path)
    assert (caught.value.file, caught.value.channel) == (path, channel)
