"""Bytes of messages, names and recordings, beside rosbags and the mcap library."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import DataWarning, read
from mckibben.errors import DataError
from mckibben.ros.kinds import KINDS, kind_named, topic_named
from mckibben.ros.recording import Recorder

pytest.importorskip("cyclonedds")
typesys = pytest.importorskip("rosbags.typesys")

from mckibben.ros.messages import CLASSES, good, message, numbers, serialized  # noqa: E402

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
FINITE = st.floats(allow_nan=False)


@given(st.lists(FINITE, min_size=1, max_size=5), st.integers(0, 2**31 * 10**9 - 1))
def test_bytes_are_those_of_ros(values: list[float], when: int) -> None:
    for kind in KINDS.values():
        ours = values[:1] if kind.single else values
        names = [f"joint_{k}" for k in range(len(ours))]
        data = serialized(message(kind, ours, names, when))
        theirs = STORE.deserialize_cdr(data, kind.ros)
        assert bytes(STORE.serialize_cdr(theirs, kind.ros)) == data
        match kind.name:
            case "FluidPressure":
                assert theirs.fluid_pressure == ours[0]
            case "JointState":
                np.testing.assert_array_equal(theirs.position, ours)
                assert theirs.name == names
            case _:
                np.testing.assert_array_equal(np.atleast_1d(theirs.data), ours)
        if hasattr(theirs, "header"):
            stamp = theirs.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == when
        assert numbers(kind, CLASSES[kind.name].deserialize(data)) == ours
        found = typesys.get_types_from_msg(kind.definition, kind.ros)
        for name, (_, fields) in found.items():
            assert fields == STORE.fielddefs[name][1], name
        assert CLASSES[kind.name].__idl_typename__ == kind.dds


def test_names_and_units_are_those_of_ros() -> None:
    assert kind_named("std_msgs/Float64").dds == "std_msgs::msg::dds_::Float64_"
    assert kind_named("sensor_msgs/msg/JointState") is KINDS["JointState"]
    assert topic_named("/arm/reference") == topic_named("arm/reference") == "rt/arm/reference"
    for wrong in ("", "/", "a//b", "a b", "1a", "a/", "ä", "a__b", "a" * 300, "a\n", "../a"):
        with pytest.raises(DataError):
            topic_named(wrong)
    with pytest.raises(DataError, match="Float32"):
        kind_named("Float32")
    assert KINDS["FluidPressure"].factor("bar") == 1e5
    assert KINDS["JointState"].factor("mm") == 1e-3
    assert KINDS["Float64"].factor("mm") == 1.0
    with pytest.raises(DataError, match="mm"):
        KINDS["FluidPressure"].factor("mm")


def test_numbers_that_are_none_are_not_good() -> None:
    assert good([1.0, 2.0], 2)
    assert not good([1.0], 2)
    assert not good([1.0, math.nan], 2)
    assert not good([1.0, math.inf], 2)


def test_a_recording_is_read_back_here_and_by_others(tmp_path: Path) -> None:
    """Half a second: a pressure [Pa] at 100 a second, and two angles at 50."""
    path = tmp_path / "run.mcap"
    with Recorder(path) as recorder:
        fluid, joint = KINDS["FluidPressure"], KINDS["JointState"]
        topics = recorder.topic("rig/pressure", fluid), recorder.topic("/joint_states", joint)
        for k in range(50):
            when = 1_700_000_000_000_000_000 + 10_000_000 * k
            recorder.write(topics[0], when, serialized(message(fluid, [1e5 * k], [], when)))
            if k % 2 == 0:
                sent = message(joint, [0.1 * k, -0.1 * k], ["elbow", "wrist"], when)
                recorder.write(topics[1], when, serialized(sent))
    with pytest.warns(DataWarning, match="pressure 100"):
        (ours,) = read(path, rate=50, units={"joint_states_position_elbow": "rad"})
    assert ours.units["pressure"] == "bar"
    np.testing.assert_allclose(ours["pressure"][:20], np.arange(0, 40, 2), atol=1e-9)
    reader = pytest.importorskip("mcap.reader")
    found: dict[str, list[Any]] = {"/rig/pressure": [], "/joint_states": []}
    with path.open("rb") as file:
        for schema, channel, each in reader.make_reader(file).iter_messages():
            assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
            found[channel.topic].append(
                (each.log_time, STORE.deserialize_cdr(each.data, schema.name))
            )
    times = np.diff([when for when, _ in found["/rig/pressure"]])
    assert set(times) == {10_000_000}
    pressures = [sent.fluid_pressure for _, sent in found["/rig/pressure"]]
    assert pressures == [1e5 * k for k in range(50)]
    angles = [sent.position[0] for _, sent in found["/joint_states"]]
    assert angles == [0.1 * k for k in range(0, 50, 2)]
