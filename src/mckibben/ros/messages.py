"""Messages themselves: from numbers, to numbers, and as the bytes that go over the wire."""

import math  # no future annotations: Cyclone DDS reads the types of fields
from dataclasses import dataclass
from typing import Any

from mckibben.ros.kinds import Kind
from mckibben.system.extras import demand

demand("cyclonedds", "dds", "topics of ROS 2")

from cyclonedds.idl import IdlStruct  # noqa: E402
from cyclonedds.idl.types import float64, int32, sequence, uint32  # noqa: E402


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):  # type: ignore[misc,call-arg]
    """Since 1970."""

    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):  # type: ignore[misc,call-arg]
    """When and where."""

    stamp: Time
    frame_id: str


@dataclass
class Dimension(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"):  # type: ignore[misc,call-arg]
    """Of an array."""

    label: str
    size: uint32
    stride: uint32


@dataclass
class Layout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):  # type: ignore[misc,call-arg]
    """Of an array."""

    dim: sequence[Dimension]
    data_offset: uint32


@dataclass
class Float64(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):  # type: ignore[misc,call-arg]
    """A number."""

    data: float64


@dataclass
class Float64MultiArray(IdlStruct, typename="std_msgs::msg::dds_::Float64MultiArray_"):  # type: ignore[misc,call-arg]
    """Numbers."""

    layout: Layout
    data: sequence[float64]


@dataclass
class FluidPressure(IdlStruct, typename="sensor_msgs::msg::dds_::FluidPressure_"):  # type: ignore[misc,call-arg]
    """A pressure [Pa]."""

    header: Header
    fluid_pressure: float64
    variance: float64


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):  # type: ignore[misc,call-arg]
    """Positions of joints [m or rad]."""

    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


CLASSES: dict[str, Any] = {
    each.__name__: each for each in (Float64, Float64MultiArray, FluidPressure, JointState)
}
"""By names of types."""


def message(kind: Kind, values: list[float], names: list[str], when: int) -> Any:
    """Return a message of numbers, in its own units, at a time [ns since 1970]."""
    head = Header(Time(*divmod(when, 10**9)), "")
    match kind.name:
        case "Float64":
            return Float64(*values)
        case "Float64MultiArray":
            return Float64MultiArray(Layout([], 0), values)
        case "FluidPressure":
            return FluidPressure(head, *values, 0.0)
        case _:
            return JointState(head, names, values, [], [])


def numbers(kind: Kind, found: Any) -> list[float]:
    """Return the numbers of a message."""
    match kind.name:
        case "FluidPressure":
            return [found.fluid_pressure]
        case "JointState":
            return list(found.position)
        case "Float64":
            return [found.data]
        case _:
            return list(found.data)


def good(values: list[float], size: int) -> bool:
    """Tell whether numbers are as many as are wanted, and finite."""
    return len(values) == size and all(map(math.isfinite, values))


def serialized(found: Any) -> bytes:
    """Return the bytes of a message: plain CDR, little-endian, as ROS 2 sends and records them."""
    return bytes(found.serialize(use_version_2=False))
