"""Types of ROS 2's messages that carry a muscle's numbers, and what their numbers are in.

`std_msgs` says nothing of units: its numbers are this package's (bar, mm, N, s, rad). Those of
`sensor_msgs` are in pascals, metres and radians, as their definitions say (REP 103).
"""

from __future__ import annotations

from dataclasses import dataclass

from mckibben.errors import DataError

_HEADER = f"""
{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

_LAYOUT = f"""
{"=" * 80}
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
{"=" * 80}
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""


@dataclass(frozen=True)
class Kind:
    """A type of message.

    Parameters
    ----------
    package, name : str
        Of the type.
    definition : str
        As ROS 2 writes it into recordings, with the types within.
    units : mapping of str to float
        Units of the package that it carries, with what they are multiplied by; none for all as they are.
    single : bool
        Whether it carries one number.
    """

    package: str
    name: str
    definition: str
    units: tuple[tuple[str, float], ...] = ()
    single: bool = False

    @property
    def ros(self) -> str:
        """Its name in ROS 2."""
        return f"{self.package}/msg/{self.name}"

    @property
    def dds(self) -> str:
        """Its name in DDS, as every implementation of ROS 2's middleware says it."""
        return f"{self.package}::msg::dds_::{self.name}_"

    def factor(self, unit: str) -> float:
        """Return what numbers of a unit are multiplied by in a message.

        Raises
        ------
        DataError
            If it does not carry that unit.
        """
        if not self.units:
            return 1.0
        found = dict(self.units).get(unit)
        if found is None:
            carried = ", ".join(unit for unit, _ in self.units)
            raise DataError(
                f"{self.package}/{self.name} carries {carried}, not {unit or 'a number without unit'}",
                remedy="use Float64 or Float64MultiArray, which carry any",
            )
        return found


KINDS = {
    kind.name: kind
    for kind in (
        Kind("std_msgs", "Float64", "float64 data\n", single=True),
        Kind(
            "std_msgs",
            "Float64MultiArray",
            f"std_msgs/MultiArrayLayout layout\nfloat64[] data{_LAYOUT}",
        ),
        Kind(
            "sensor_msgs",
            "FluidPressure",
            f"std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance{_HEADER}",
            (("bar", 1e5),),
            single=True,
        ),
        Kind(
            "sensor_msgs",
            "JointState",
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
            f"float64[] effort{_HEADER}",
            (("mm", 1e-3), ("rad", 1.0)),
        ),
    )
}
"""By their names without the package."""


def kind_named(name: str) -> Kind:
    """Return a type by its name, ``Float64``, ``std_msgs/Float64`` or ``std_msgs/msg/Float64``.

    Raises
    ------
    DataError
        If it is none of those known here.
    """
    for kind in KINDS.values():
        if name in (kind.name, f"{kind.package}/{kind.name}", kind.ros):
            return kind
    raise DataError(f"{name!r} is no type known here", remedy=f"use one of {', '.join(KINDS)}")


def topic_named(name: str) -> str:
    """Return the name of a topic in DDS: with ``rt/`` before it.

    Raises
    ------
    DataError
        If ROS 2 has no topic of that name.
    """
    words = name.removeprefix("/").split("/")
    sound = (
        all(word.isascii() and word.isidentifier() and "__" not in word for word in words)
        and len(name) < 200
    )
    if not sound:
        raise DataError(
            f"{name!r} is no topic of ROS 2",
            remedy="give words of letters, digits and underscores, with / between, as /arm/reference",
        )
    return "rt/" + "/".join(words)
