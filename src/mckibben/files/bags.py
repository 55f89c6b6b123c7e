"""Bags of ROS 1 (.bag) and ROS 2 (.mcap, .db3, or a folder): numeric fields of their topics.

RosBags makes Python of the definitions of messages in a file, and runs it; its grammars of definitions
let nothing but names and numbers into that.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import partial
from io import BufferedReader
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from mckibben.errors import DataError
from mckibben.files.headers import channel_of, is_standard, is_time, parse
from mckibben.files.notices import listed
from mckibben.files.table import WIDEST, Column, Table
from mckibben.system.extras import demand
from mckibben.system.validation import reason

_UNITS = {
    "sensor_msgs/msg/FluidPressure": {"fluid_pressure": "Pa abs"},
    "sensor_msgs/msg/Temperature": {"temperature": "degC"},
    "sensor_msgs/msg/Range": {"range": "m"},
    "geometry_msgs/msg/Wrench": {f"force/{axis}": "N" for axis in "xyz"},
    "geometry_msgs/msg/WrenchStamped": {f"wrench/force/{axis}": "N" for axis in "xyz"},
}
"""Units that a type of message demands, by field."""

_SECTION = re.compile(r"={80}\n(?:IDL: .*\n)?")
"""What separates the definitions in IDL of several types."""


@dataclass
class _Topic:
    """The messages of one type on one topic.

    ``recorded`` and ``stamps`` are when each message was recorded and the stamp in its header or 0 [ns];
    ``columns`` are, by field, the messages that have it and its values.
    """

    name: str
    kind: str
    decode: Callable[[bytes], Any]
    recorded: list[int] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    columns: dict[str, tuple[list[int], list[float]]] = field(default_factory=dict)
    unread: dict[str, str] = field(default_factory=dict)

    def take(self, when: int, raw: bytes) -> None:
        """Add a message recorded at a time [ns]."""
        message = self.decode(raw)
        stamp: Any = getattr(getattr(message, "header", None), "stamp", None)
        self.stamps.append(stamp.sec * 10**9 + stamp.nanosec if _is_instant(stamp) else 0)
        for path, value in _numbers(f"/{self.name.strip('/')}", message):
            if isinstance(value, str):
                self.unread[path] = value
            else:
                at, values = self.columns.setdefault(path, ([], []))
                at.append(len(self.recorded))
                values.append(value)
        self.recorded.append(when)

    def timed(self, began: int, by_stamp: bool) -> Iterator[Column]:
        """Yield the columns of its fields."""
        # differences of whole numbers: floats of seconds since 1970 are 0.2 us apart
        instants = np.array(self.stamps if by_stamp else self.recorded, dtype=np.int64)
        times = (instants - began) / 1e9
        for header, (at, values) in self.columns.items():
            path = header.removeprefix(f"/{self.name.strip('/')}/")
            unit, word = _UNITS.get(self.kind, {}).get(path), path.rpartition("/")[2]
            if word in ("data", "value") or unit == "Pa abs":
                word = self.name.rpartition("/")[2]
            alias = "pressure" if unit == "Pa abs" else _indexed(header)
            if is_standard(word) and not is_time(word):
                alias = word
            samples, is_held = np.array(values, dtype=np.float64), not isinstance(values[0], float)
            yield Column(header, samples, unit, alias=alias, times=times[at], held=is_held)


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the numeric topics of a bag, which is opened again by its path."""
    return folder(path)


def folder(path: Path) -> list[Table]:
    """Read the numeric topics of a bag that may be a folder of ROS 2."""
    demand("rosbags", "ros", "bags of ROS", file=path)
    reader = _reader(path)
    try:
        reader.open()
    except Exception as error:
        raise DataError(
            f"it is damaged or unfinished, or not a bag ({reason(error)})",
            file=path,
            remedy="mend it with rosbag reindex, ros2 bag reindex or mcap recover, or record it again",
        ) from None
    with closing(reader):
        topics, unread = _topics(reader)
    if not topics:
        raise DataError(
            f"no topic in it has numbers that can be read; its topics are {listed([*unread], 10)}",
            file=path,
            remedy="record topics of numbers, with the definitions of their messages",
        )
    by_stamp = all(min(topic.stamps) > 0 for topic in topics)
    began = min(min(topic.stamps if by_stamp else topic.recorded) for topic in topics)
    columns = [column for topic in topics for column in topic.timed(began, by_stamp)]
    channels = [channel_of(parse(column.label)) for column in columns]
    for i, column in enumerate(columns):  # the caller has to choose among several of one channel
        if channels.count(channels[i]) > 1:
            columns[i] = replace(column, alias=_indexed(column.header))
    source = "header stamps" if by_stamp else "recording times"
    return [Table(tuple(columns), meta={"time_source": source}, unread=unread)]


def _reader(path: Path) -> Any:
    """Return the reader of a bag, not opened yet."""
    from rosbags import rosbag1, rosbag2
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    def database(at: Path) -> Sqlite3Reader:
        """Return the reader of a database; for SQLite, # % ? are escaped in its address."""
        return Sqlite3Reader(Path(quote(str(at), safe="/\\:")))

    readers: dict[str, Any] = {**rosbag2.Reader.STORAGE_PLUGINS, ".bag": rosbag1.Reader}
    if path.is_dir():
        reader = readers["dir"](path)
        reader.STORAGE_PLUGINS = {**reader.STORAGE_PLUGINS, "sqlite3": database}
        return reader
    return (readers | {".db3": database})[path.suffix.casefold()](path)


def _topics(reader: Any) -> tuple[list[_Topic], dict[str, str]]:
    """Return the numeric topics in the order of their first messages, and those not read."""
    topics: dict[tuple[str, ...], _Topic] = {}
    unread: dict[str, str] = {}
    for connection in reader.connections:
        try:
            topic = _Topic(connection.topic, connection.msgtype, _decoder(connection))
            topics.setdefault(_key(connection), topic)
        except Exception as error:  # the library raises anything at what it cannot read
            unread[connection.topic] = reason(error)
    readable = [known for known in reader.connections if _key(known) in topics]
    for connection, when, raw in reader.messages(readable) if readable else ():
        topic = topics[_key(connection)]
        if topic.name not in unread:
            try:
                topic.take(when, raw)
            except Exception as error:
                unread[topic.name] = f"message {len(topic.recorded) + 1}: {reason(error)}"
    read_topics = [topic for topic in topics.values() if topic.name not in unread]
    for topic in read_topics:
        none = "no numbers in it" if topic.recorded else "no messages that belong to it"
        unread |= topic.unread or ({} if topic.columns else {topic.name: none})
    numbers = [topic for topic in read_topics if topic.columns]
    return sorted(numbers, key=lambda topic: topic.recorded[0]), unread


def _key(connection: Any) -> tuple[str, ...]:
    return connection.topic, connection.msgtype, connection.msgdef.data


def _decoder(connection: Any) -> Callable[[bytes], Any]:
    """Return the decoder of messages, by the definition in the file, or that of ROS 2 Jazzy."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    kind, (form, text) = connection.msgtype, connection.msgdef
    encoding = getattr(connection.ext, "serialization_format", "ros1")
    if encoding not in ("ros1", "cdr"):
        raise ValueError(f"its messages are in {encoding}")
    store = get_typestore(Stores.EMPTY if text else Stores.ROS2_JAZZY)
    if form.name == "MSG":
        store.register(get_types_from_msg(text, kind))
    for section in filter(str.strip, _SECTION.split(text) if form.name == "IDL" else ()):
        store.register(get_types_from_idl(section))
    store.get_msgdef(kind)  # or KeyError
    decode = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    return partial(decode, typename=kind)


def _numbers(path: str, value: Any, names: Sequence[str] = ()) -> Iterator[tuple[str, float | str]]:
    """Yield the positions of the numbers in a message, with their values, or the reason for none.

    Elements of arrays are called by the names in the message, as those of joints, if they are as many.
    """
    if isinstance(value, (bool, int, float)):
        yield path, value
    elif isinstance(value, (list, np.ndarray)):
        if len(value) > WIDEST and not isinstance(value[0], str):
            yield path, f"an array of {len(value)}"
            return
        is_named = len(names) == len(value)
        for k, item in enumerate(value.tolist() if isinstance(value, np.ndarray) else value):
            yield from _numbers(f"{path}/{names[k]}" if is_named else f"{path}[{k}]", item)
    elif _is_instant(value):
        yield path, "a time"
    elif not isinstance(value, str):
        name = getattr(value, "name", None)
        names = name if isinstance(name, list) and len(set(name)) == len(name) else []
        for member in fields(value):  # constants, and the byte of an empty message, have defaults
            if member.default is MISSING and member.name != "header":
                yield from _numbers(f"{path}/{member.name}", getattr(value, member.name), names)


def _is_instant(value: Any) -> bool:
    return getattr(value, "__msgtype__", "").startswith("builtin_interfaces/msg/")


def _indexed(header: str) -> str:
    """Return a header without brackets, which mark units elsewhere."""
    return header.replace("[", "/").replace("]", "")
