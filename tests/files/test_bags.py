"""Bags of ROS 1 and ROS 2, written by RosBags."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from mckibben import DataError
from mckibben.files.sources import roles
from tests.files.made import columns, one, refused, several, table

KINDS = ("bag", "mcap", "db3")
BEGAN, STEP, LATE = 1_700_000_000_123_456_789, 10_000_001, 3_000_000
"""First message, time between two, and how long after its stamp one is recorded [ns]."""
PRESSURE = (2 + np.sin(np.arange(40) / 3)).tolist()

New = Callable[..., Any]
Messages = Mapping[str, Sequence[tuple[int, Any]]]
Content = Callable[[New], Messages]


def bag(path: Path, kind: str, content: Content, packed: str = "") -> Path:
    """Write messages, each at a time [ns], and return the file, or the folder of ROS 2."""
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

    def new(name: str, *fields: Any) -> Any:
        made: Any = store.types[name.replace("/", "/msg/")]
        first = [0] if "seq" in made.__dataclass_fields__ else []  # of headers of ROS 1
        return made(*first, *fields)

    serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
    with writer:
        for topic, sent in content(new).items():
            name = sent[0][1].__msgtype__
            connection = writer.add_connection(topic, name, typestore=store)
            for when, message in sent:
                writer.write(connection, when, serialize(message, name))
    return path


def numbers(new: New, values: Sequence[Any], kind: str = "Float64") -> Any:
    return [(BEGAN + k * STEP, new(f"std_msgs/{kind}", value)) for k, value in enumerate(values)]


def time(new: New, at: int) -> Any:
    return new("builtin_interfaces/Time", *divmod(at, 10**9))


def stamped(new: New) -> Messages:
    """Return messages with stamps, of joints whose order changes and, recorded later, of air."""
    arm, air = [], []
    for k in range(20):
        names = ["a", "b"][:: -1 if k % 2 else 1]
        angles = np.array([{"a": 0.1, "b": 0.2}[name] * k for name in names])
        at = BEGAN + 2 * k * STEP
        header = new("std_msgs/Header", time(new, at), "")
        joints = new("sensor_msgs/JointState", header, names, angles, angles[:0], angles)
        arm.append((at + LATE, joints))
    for k in range(12):
        at = BEGAN + k * STEP
        header = new("std_msgs/Header", time(new, at - LATE), "")
        air.append((at, new("sensor_msgs/FluidPressure", header, 6e5, 0.0)))
    return {"/arm": arm, "/air": air}


def words(new: New) -> Messages:
    return {"/words": numbers(new, ["up"], kind="String")}


def mixed(new: New) -> Messages:
    layout = new("std_msgs/MultiArrayLayout", [], 0)
    return {
        **stamped(new),
        **words(new),
        "/rig/pressure_bar": numbers(new, PRESSURE),
        "/count": numbers(new, [k % 256 for k in range(30)], kind="UInt8"),
        "/picture": [(BEGAN, new("std_msgs/Float64MultiArray", layout, np.ones(65)))],
        "/near": [(BEGAN, new("diagnostic_msgs/DiagnosticStatus", 2, "", "", "", []))],
        "/clock": [(BEGAN, new("rosgraph_msgs/Clock", time(new, BEGAN)))],
    }


def samples(path: Path) -> dict[str, tuple[list[float], list[float]]]:
    """Return times and samples by header."""
    return {
        header: (np.asarray(column.times).tolist(), np.asarray(column.values).tolist())
        for header, column in columns(path).items()
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
    path = bag(tmp_path / "run", kind, mixed, packed)
    path = path.rename(path.with_stem("50% #1?"))  # which are signs in addresses
    found = samples(path)
    assert found["/rig/pressure_bar/data"] == (seconds(40), PRESSURE)
    assert found["/count/data"] == (seconds(30), list(range(30)))
    for joint, scale in (("a", 0.1), ("b", 0.2)):
        expected = seconds(20, 2 * STEP, LATE), [scale * k for k in range(20)]
        assert found[f"/arm/position/{joint}"] == found[f"/arm/effort/{joint}"] == expected
    assert [each for each in found if "/near" in each] == ["/near/level"]  # constants are no fields
    assert {"/words", "/picture/data", "/clock/clock"} <= set(table(path).unread)
    if kind != "bag" and not packed:
        (alone,) = (each for each in path.iterdir() if each.suffix == f".{kind}")
        assert samples(alone) == found
    recording = one(path, columns={"pressure": "/air/fluid_pressure"})
    assert recording["pressure"] == pytest.approx(6.0)  # in Pa, as the type of its messages has it
    assert recording.meta["time_source"] == "recording times"  # as some have no stamps
    assert roles(tmp_path) == {"train": [path]}


@pytest.mark.parametrize("kind", KINDS)
def test_stamps_are_the_times_where_all_topics_have_them(tmp_path: Path, kind: str) -> None:
    path = bag(tmp_path / "run", kind, lambda new: {**stamped(new), **words(new)})
    assert table(path).meta == {"time_source": "header stamps"}
    found = samples(path)
    assert found["/air/fluid_pressure"][0] == seconds(12)
    assert found["/arm/position/a"][0] == seconds(20, 2 * STEP, LATE)  # the air's came first


def change(path: Path, *statements: str) -> Path:
    """Change a database, and return it."""
    with closing(sqlite3.connect(path)) as base:
        for statement in statements:
            base.execute(statement)
        base.commit()
    return path


def test_a_bag_cut_into_files_is_the_whole_one(tmp_path: Path) -> None:
    whole, cut = (bag(tmp_path / name, "db3", mixed) for name in ("whole", "cut"))
    first, second = cut / "cut.db3", cut / "cut_1.db3"
    shutil.copy(first, second)
    about = (cut / "metadata.yaml").read_text()
    (cut / "metadata.yaml").write_text(about.replace("- cut.db3", "- cut.db3\n  - cut_1.db3"))
    for path, sign in ((first, ">="), (second, "<")):
        change(path, f"DELETE FROM messages WHERE timestamp {sign} {BEGAN + 11 * STEP}")
    packed = bag(tmp_path / "packed", "db3", mixed, "FILE")
    assert samples(cut) == samples(packed) == samples(whole)


def database(folder: Path, *statements: str) -> Path:
    """Return the database of a bag with a pressure and a count, changed."""

    def content(new: New) -> Messages:
        counts = numbers(new, [*range(40)], kind="UInt8")
        return {"/rig/pressure_bar": numbers(new, PRESSURE), "/count": counts}

    return change(bag(folder / "run", "db3", content) / "run.db3", *statements)


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
    path = database(tmp_path, *statements)
    found = samples(path)
    assert found.pop("/rig/pressure_bar/data") == (seconds(40), PRESSURE)
    assert bool(found) is not bool(reason)
    assert reason in table(path).unread.get("/count", "")


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
        assert several(path)
    except DataError as error:
        assert error.file == path  # noqa: PT017
    assert not ran.exists()


def test_a_bag_without_numbers_is_refused(tmp_path: Path) -> None:
    path = bag(tmp_path / "run", "mcap", words)
    assert refused(path).file == path
