"""Bags of ROS, written by RosBags as programs of robots write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np

N = 100
BEGAN = 1_700_000_000_000_000_000
FAST, SLOW = 10_000_000, 25_000_000
"""Time between messages [ns] of the pressure, and of all else."""

CUSTOM = """std_msgs/Header header
float64 pressure_kPa
uint8 mode
float32[3] strain
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""

Kind = Literal["bag", "mcap", "db3"]


def pressure(t: Any) -> Any:
    """Return the pressure [bar] at some times [s]."""
    return 2 + np.sin(9 * t)


def angle(t: Any) -> Any:
    """Return the angle [rad] at some times [s]."""
    return 0.5 * np.cos(9 * t)


def write(path: Path, kind: Kind, *, late: int = 0, packed: bool = False) -> Path:
    """Write a bag and return its path: a file, or a folder for those of ROS 2.

    Parameters
    ----------
    path : Path
        Without an ending.
    kind : str
    late : int
        How much later than their stamps messages were recorded [ns].
    packed : bool
        Whether chunks are.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_JAZZY)
    name = "rig_msgs/msg/State"
    store.register({name: get_types_from_msg(CUSTOM, name)[name]})
    writer: Any
    if kind == "bag":
        from rosbags.rosbag1 import Writer as Writer1

        path = path.with_suffix(".bag")
        writer = Writer1(path)
        if packed:
            writer.set_compression(Writer1.CompressionFormat.BZ2)
    else:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2

        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        if packed:
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        topics = {
            "/rig/pressure": "std_msgs/msg/Float64",
            "/joint_states": "sensor_msgs/msg/JointState",
            "/air": "sensor_msgs/msg/FluidPressure",
            "/hand": "geometry_msgs/msg/WrenchStamped",
            "/state": "rig_msgs/msg/State",
            "/words": "std_msgs/msg/String",
        }
        sent = {t: writer.add_connection(t, of, typestore=store) for t, of in topics.items()}
        serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr

        def put(topic: str, when: int, **fields: Any) -> None:
            kind_ = topics[topic]
            message = store.types[kind_](**fields)
            writer.write(sent[topic], BEGAN + when + late, serialize(message, kind_))

        def header(when: int) -> Any:
            stamp = divmod(BEGAN + when, 10**9)
            extra = {"seq": when // SLOW} if kind == "bag" else {}
            time = store.types["builtin_interfaces/msg/Time"](*stamp)
            return store.types["std_msgs/msg/Header"](stamp=time, frame_id="arm", **extra)

        vector = store.types["geometry_msgs/msg/Vector3"]
        nothing = np.zeros(0)
        for when in range(0, N * FAST, FAST):
            put("/rig/pressure", when, data=float(pressure(when * 1e-9)))
        for when in range(0, N * FAST, SLOW):
            t = when * 1e-9
            put("/words", when, data="up" * (when % 7))
            put(
                "/joint_states",
                when,
                header=header(when),
                name=["elbow", "shoulder"],
                position=np.array([angle(t), 2 * angle(t)]),
                velocity=nothing,
                effort=np.array([1.0, 2.0]),
            )
            put("/air", when, header=header(when), fluid_pressure=6e5 + t, variance=0.0)
            wrench = store.types["geometry_msgs/msg/Wrench"](
                force=vector(1.0, 2.0, 30 + t), torque=vector(0.0, 0.0, 0.0)
            )
            put("/hand", when, header=header(when), wrench=wrench)
            put(
                "/state",
                when,
                header=header(when),
                pressure_kPa=100 * pressure(t),
                mode=when // SLOW % 3,
                strain=np.array([t, 2 * t, 3 * t], dtype=np.float32),
            )
    return path
