"""The binary inputs of `tests/golden/rooms/files.py`, written by the formats' own libraries."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from tests.golden.write_files import FILES, PRESSURE, STEP, TIME, TRAVEL, K, N

BEGAN = 1_700_000_000_000_000_000
"""When bags begin [ns]."""

STATE = """std_msgs/Header header
float64 pressure_kPa
uint8 mode
float32[3] strain
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


def binary() -> None:
    """Write all."""
    matlab()
    hdf5()
    columnar()
    spreadsheets()
    tdms()
    for kind in ("bag", "mcap", "db3"):
        bag(kind)


def matlab() -> None:
    """Versions 4, 5 and 7.3: vectors, structs, matrices, rates."""
    import h5py
    import scipy.io as sio

    vectors = {
        "t": TIME[:, None],
        "pressure_kPa": 100 * PRESSURE[:, None],
        "displacement_mm": TRAVEL,
    }
    sio.savemat(FILES / "v4.mat", {**vectors, "displacement_mm": TRAVEL[:, None]}, format="4")
    sio.savemat(FILES / "v5.mat", vectors, do_compression=True)
    sio.savemat(
        FILES / "single.mat",
        {"pressure_bar": PRESSURE.astype(np.float32), "count": K.astype(np.uint16), "Fs": 50.0},
    )
    run = {"time_s": TIME, "signals": {"pressure_bar": PRESSURE, "force_N": 20 * TRAVEL}}
    sio.savemat(FILES / "struct.mat", {"run": run, "operator": "A. Nobody"})
    sio.savemat(FILES / "matrix.mat", {"data": np.column_stack([TIME, PRESSURE, TRAVEL])})
    sio.savemat(FILES / "wide-matrix.mat", {"data": np.vstack([PRESSURE, TRAVEL]), "dt": STEP})
    sio.savemat(FILES / "two-rates.mat", {"p_bar": PRESSURE, "d_mm": TRAVEL, "fs": 50.0, "dt": 0.1})
    sio.savemat(FILES / "lengths.mat", {"p_bar": PRESSURE, "d_mm": TRAVEL, "force_N": TRAVEL[:17]})
    path = FILES / "v73.mat"
    with h5py.File(path, "w", userblock_size=512) as tree:
        for name, values in (("t_ms", 1e3 * TIME), ("p_bar", PRESSURE), ("l_cm", 30 - TRAVEL / 10)):
            data = tree.create_dataset(name, data=values[None], compression="gzip")
            data.attrs["MATLAB_class"] = np.bytes_("double")
    head = (
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Thu Jan 01 00:00:00 2026 HDF5 schema"
    )
    content = path.read_bytes()
    path.write_bytes(head.ljust(124) + b"\x00\x02IM" + content[128:])


def hdf5() -> None:
    """Groups, units in attributes, filters, a matrix, a sample time."""
    import h5py

    with h5py.File(FILES / "groups.h5", "w") as tree:
        tree.attrs["rig"] = "bench 3"
        tree["daq/time"] = 1e3 * TIME
        tree["daq/time"].attrs["units"] = "ms"
        tree.create_dataset("daq/pressure", data=PRESSURE / 10, compression="gzip", shuffle=True)
        tree["daq/pressure"].attrs["units"] = "MPa"
        tree.create_dataset("motion/displacement", data=TRAVEL, chunks=(16,), fletcher32=True)
        tree["motion/displacement"].attrs["unit"] = "mm"
        tree["name"] = "run 7"
    with h5py.File(FILES / "matrix.hdf5", "w") as tree:
        tree["log"] = np.column_stack([PRESSURE, TRAVEL, 10 * TRAVEL])
        tree["sample_time"] = 0.005
    with h5py.File(FILES / "elsewhere.h5", "w") as tree:
        tree["pressure"] = PRESSURE
        tree.create_dataset("force", N, "f8", external=[("other.bin", 0, 8 * N)])


def columnar() -> None:
    """Parquet as other programs write it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    begin = datetime(2026, 1, 31, 12)
    when = [begin + timedelta(milliseconds=20 * int(k)) for k in K]
    columns: dict[str, Any] = {
        "timestamp": pa.array(when, pa.timestamp("us")),
        "pressure_kPa": 100 * PRESSURE,
        "displacement_mm": pa.array(TRAVEL.astype(np.float32)),
        "valve": pa.array([bool(k % 2) for k in K]),
        "note": ["ok"] * N,
    }
    pq.write_table(pa.table(columns), FILES / "dates.parquet")
    holes = [None if k == 5 else float(v) for k, v in enumerate(TRAVEL)]
    columns = {"t_ms": (20 * K).astype(np.int64), "p_bar": PRESSURE, "d_mm": pa.array(holes)}
    pq.write_table(pa.table(columns), FILES / "nulls.parquet", compression="snappy")


def spreadsheets() -> None:
    """A table below titles, dates, and one of several sheets."""
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(["Pressure bench 3"])
    sheet.append(["operator: A"])
    sheet.append([])
    sheet.append(["Time (ms)", "Druck (kPa)", "Weg (mm)"])
    for row in zip(1e3 * TIME, 100 * PRESSURE, TRAVEL, strict=True):
        sheet.append([float(value) for value in row])
    book.save(FILES / "titles.xlsx")
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(["timestamp", "pressure [bar]", "displacement [mm]"])
    begin = datetime(2026, 1, 31, 12)
    for k in range(N):
        sheet.append([begin + timedelta(milliseconds=20 * k), float(PRESSURE[k]), float(TRAVEL[k])])
    book.save(FILES / "dates.xlsx")
    (FILES / "sheets").mkdir(exist_ok=True)
    book = openpyxl.Workbook()
    first = book.active
    assert first is not None
    first.title = "Calibration"
    second = book.create_sheet("Run 2")
    for k in range(N):
        first.append([float(K[k]), float(k * k)])
    second.append(["t_s", "p_bar", "d_mm"])
    for row in zip(TIME, PRESSURE, TRAVEL, strict=True):
        second.append([float(value) for value in row])
    book.save(FILES / "sheets/book.xlsx")
    (FILES / "sheets/channels.toml").write_text('[[files]]\nmatch = "*.xlsx"\nsheet = "Run 2"\n')
    book.save(FILES / "first-sheet.xlsx")


def tdms() -> None:
    """A waveform in one group, and two groups of which one has times as a channel."""
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    def channel(group: str, name: str, values: Any, unit: str, step: float | None) -> Any:
        wave = {} if step is None else {"wf_increment": step, "wf_start_offset": 0.5}
        return ChannelObject(group, name, values, {"unit_string": unit, **wave})

    with TdmsWriter(FILES / "waveform.tdms") as file:
        file.write_segment(
            [
                RootObject({"operator": "A. Nobody"}),
                GroupObject("daq", {"muscle": "DMSP-10", "load_kg": 0.2}),
                channel("daq", "pressure", 100 * PRESSURE, "kPa", STEP),
                channel("daq", "displacement", TRAVEL.astype(np.float32), "mm", STEP),
            ]
        )
    with TdmsWriter(FILES / "groups.tdms") as file:
        file.write_segment(
            [
                channel("run 1", "pressure", PRESSURE, "bar", STEP),
                channel("run 1", "displacement", TRAVEL, "mm", STEP),
                channel("run 2", "time", TIME, "s", None),
                channel("run 2", "pressure", PRESSURE / 2, "bar", None),
                channel("run 2", "displacement", TRAVEL / 2, "mm", None),
            ]
        )


def bag(kind: str) -> Path:
    """A bag of ROS 1 or 2: a fast topic, slow ones with stamps, words."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_JAZZY)
    state = "rig_msgs/msg/State"
    store.register({state: get_types_from_msg(STATE, state)[state]})
    writer: Any
    if kind == "bag":
        from rosbags.rosbag1 import Writer as Writer1

        path = FILES / "ros1.bag"
        writer = Writer1(path)
    else:
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2

        path = FILES / f"ros2-{kind}"
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
    with writer:
        topics = {
            "/rig/pressure": "std_msgs/msg/Float64",
            "/joint_states": "sensor_msgs/msg/JointState",
            "/state": state,
            "/words": "std_msgs/msg/String",
        }
        sent = {t: writer.add_connection(t, of, typestore=store) for t, of in topics.items()}
        serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr

        def put(topic: str, when: int, **fields: Any) -> None:
            message = store.types[topics[topic]](**fields)
            writer.write(sent[topic], BEGAN + when, serialize(message, topics[topic]))

        def header(when: int) -> Any:
            extra = {"seq": when} if kind == "bag" else {}
            stamp = store.types["builtin_interfaces/msg/Time"](*divmod(BEGAN + when, 10**9))
            return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="arm", **extra)

        for k in range(N):
            when = 10_000_000 * k
            put("/rig/pressure", when, data=float(PRESSURE[k]))
            if k % 2:
                continue
            put("/words", when, data="up")
            put(
                "/joint_states",
                when,
                header=header(when),
                name=["elbow", "shoulder"],
                position=np.array([TRAVEL[k] / 10, TRAVEL[k] / 20]),
                velocity=np.zeros(0),
                effort=np.array([1.0, 2.0]),
            )
            put(
                "/state",
                when + 3_000_000,
                header=header(when),
                pressure_kPa=90 * float(PRESSURE[k]),
                mode=k // 4 % 3,
                strain=np.array([k, 2 * k, 3 * k], dtype=np.float32),
            )
    return path
