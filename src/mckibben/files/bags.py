"""Bags of ROS 1 (.bag) and ROS 2 (.mcap, .db3, or a folder): the numbers in their topics.

RosBags makes Python of the definitions of messages in a file, and runs it; its grammars of definitions
let nothing but names and numbers into that.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import partial
from io import BufferedReader
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.headers import channel_of, parse, unit_of
from mckibben.files.notices import listed
from mckibben.files.table import WIDEST, Column, Table
from mckibben.system.extras import demand

_PLAIN = ("data", "value")
"""Names of fields that name no channel; there the topic's name does."""

_UNITS = {
    "sensor_msgs/msg/FluidPressure": {"fluid_pressure": "Pa"},
    "sensor_msgs/msg/Temperature": {"temperature": "degC"},
    "sensor_msgs/msg/Range": {"range": "m"},
    "geometry_msgs/msg/Wrench": {f"force/{axis}": "N" for axis in "xyz"},
    "geometry_msgs/msg/WrenchStamped": {f"wrench/force/{axis}": "N" for axis in "xyz"},
}
"""Units that a type of message demands, by field."""

_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_SECTION = re.compile(r"={80}\n(?:IDL: .*\n)?")
"""What separates the definitions in IDL of several types."""


@dataclass
class _Topic:
    """The messages of one type on one topic.

    Parameters
    ----------
    name, kind : str
        Of the topic, and of the type of its messages.
    decode : callable
        What makes a message of its bytes.
    recorded, stamps : list of int
        When each message was recorded, and the stamp in its header or 0 [ns].
    columns : dict of str to ([int], [float])
        By field: the messages that have it, counted from 0, and its values.
    unread : dict of str to str
        Other fields, and why they are no columns.
    """

    name: str
    kind: str
    decode: Callable[[bytes], Any]
    recorded: list[int] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    columns: dict[str, tuple[list[int], list[float]]] = field(default_factory=dict)
    unread: dict[str, str] = field(default_factory=dict)

    def take(self, when: int, raw: bytes) -> None:
        """Take a message that was recorded at a time [ns]."""
        message = self.decode(raw)
        stamp: Any = getattr(getattr(message, "header", None), "stamp", None)
        self.stamps.append(stamp.sec * 10**9 + stamp.nanosec if _is_time(stamp) else 0)
        for place, value in _fields(message):
            if isinstance(value, str):
                self.unread[place] = value
            else:
                at, values = self.columns.setdefault(place, ([], []))
                at.append(len(self.recorded))
                values.append(value)
        self.recorded.append(when)

    def header(self, place: str) -> str:
        """Return what the column of a field is called."""
        return f"/{self.name.strip('/')}/{place}"

    def column(self, place: str, times: Array) -> Column:
        """Return the column of a field; the times [s] are those of all messages."""
        at, values = self.columns[place]
        last, of_topic = place.rpartition("/")[2], self.name.rpartition("/")[2]
        unit = _UNITS.get(self.kind, {}).get(place)
        words = [of_topic if last in _PLAIN else last]
        if unit == "Pa":
            words = [of_topic, "pressure"]
        header = self.header(place)
        says = next((word for word in words if _is_standard(word)), _indexed(header))
        held = not isinstance(values[0], float)
        samples = np.array(values, dtype=np.float64)
        return Column(header, samples, unit, says=says, times=times[at], held=held)


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the topics of a bag that have numbers; it is opened once more, by its path."""
    return folder(path)


def folder(path: Path) -> list[Table]:
    """Read the topics that have numbers, of a bag that may be a folder of ROS 2."""
    demand("rosbags", "ros", "bags of ROS", file=path)
    reader = _reader(path)
    try:
        reader.open()
    except Exception as error:
        raise DataError(
            f"it is damaged or unfinished, or not a bag ({_reason(error)})",
            file=path,
            remedy="mend it with rosbag reindex, ros2 bag reindex or mcap recover, or record it again",
        ) from None
    try:
        topics, unread = _topics(reader)
    finally:
        reader.close()
    found = [topic for topic in topics if topic.columns]
    if not found:
        raise DataError(
            f"no topic in it has numbers that can be read; its topics are {listed([*unread], 10)}",
            file=path,
            remedy="record topics of numbers, with the definitions of their messages",
        )
    return [_table(found, unread)]


def _table(topics: list[_Topic], unread: Mapping[str, str]) -> Table:
    """Return the table of topics that have numbers: their times are all stamps, or all of recording."""
    by_stamp = all(min(topic.stamps) > 0 for topic in topics)
    clocks = [topic.stamps if by_stamp else topic.recorded for topic in topics]
    began = min(map(min, clocks))
    columns: list[Column] = []
    for topic, instants in zip(topics, clocks, strict=True):
        # differences of whole numbers: floats of seconds since 1970 are 0.2 us apart
        times = (np.array(instants, dtype=np.int64) - began) / 1e9
        columns += [topic.column(place, times) for place in topic.columns]
    channels = Counter(channel_of(parse(column.label)) for column in columns)
    distinct = (  # the caller has to choose among several of one channel
        column
        if channels[channel_of(parse(column.label))] == 1
        else replace(column, says=_indexed(column.header))
        for column in columns
    )
    source = "header stamps" if by_stamp else "recording times"
    return Table(tuple(distinct), meta={"time_source": source}, unread=unread)


def _reader(path: Path) -> Any:
    """Return the reader of a bag, not yet open."""
    from rosbags import rosbag1, rosbag2
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    def database(at: Path) -> Sqlite3Reader:
        """Return the reader of a database; for SQLite, # % ? are signs in its address."""
        return Sqlite3Reader(Path(quote(str(at), safe="/\\:")))

    ending = path.suffix.casefold()
    storages = rosbag2.Reader.STORAGE_PLUGINS
    if path.is_dir():
        found: Any = storages["dir"](path)
        found.STORAGE_PLUGINS = {**found.STORAGE_PLUGINS, "sqlite3": database}
        return found
    if ending == ".bag":
        return rosbag1.Reader(path)
    return database(path) if ending == ".db3" else storages[".mcap"](path)


def _topics(reader: Any) -> tuple[list[_Topic], dict[str, str]]:
    """Return the topics of an open bag in the order of their first messages, and what is not read."""
    known: dict[tuple[str, ...], _Topic] = {}
    topics: dict[tuple[str, ...], _Topic] = {}
    unread: dict[str, str] = {}
    readable = []
    for connection in reader.connections:
        name, kind, *_ = key = _key(connection)
        try:
            known[key] = known.get(key) or _Topic(name, kind, _decoder(connection))
            readable.append(connection)
        except Exception as error:  # the library raises anything at what it cannot read
            unread[name] = _reason(error)
    for connection, when, raw in reader.messages(readable) if readable else ():
        topic = topics.setdefault(_key(connection), known[_key(connection)])
        if topic.name in unread:
            continue
        try:
            topic.take(when, raw)
        except Exception as error:
            unread[topic.name] = f"message {len(topic.recorded) + 1}: {_reason(error)}"
    found = [topic for topic in topics.values() if topic.name not in unread]
    for topic in found:
        unread |= {topic.header(place): reason for place, reason in topic.unread.items()}
        if not topic.columns and not topic.unread:
            unread.setdefault(topic.name, "no numbers in it")
    for storage in (reader, *getattr(reader, "storages", ())):
        for connection in storage.connections:  # a folder may describe its files wrongly
            if _key(connection) not in topics:
                unread.setdefault(connection.topic, "no messages that belong to it")
    return found, unread


def _key(connection: Any) -> tuple[str, ...]:
    return connection.topic, connection.msgtype, connection.msgdef.data


def _decoder(connection: Any) -> Callable[[bytes], Any]:
    """Return what makes messages of bytes, by the definition in the file, or that of ROS 2 Jazzy."""
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
    try:
        store.get_msgdef(kind)
    except KeyError as error:
        raise ValueError(f"the type {error} is not defined in it") from None
    decode = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    return partial(decode, typename=kind)


def _fields(message: Any) -> Iterator[tuple[str, float | str]]:
    """Yield the places of the fields of a message, with their numbers, or why there are none.

    Elements of arrays are called by the names in the message, as those of joints, if they are as many.
    """
    found = getattr(message, "name", None)
    names = found if isinstance(found, list) and len(set(found)) == len(found) else []
    for name, value in _members(message):
        if name == "header":
            continue
        if isinstance(value, np.ndarray) and 0 < len(value) == len(names) <= WIDEST:
            for element, number in zip(names, value.tolist(), strict=True):
                yield f"{name}/{element}", number
        else:
            yield from _numbers(name, value)


def _numbers(place: str, value: Any) -> Iterator[tuple[str, float | str]]:
    if isinstance(value, (bool, int, float)):
        yield place, value
    elif isinstance(value, (list, np.ndarray)):
        if len(value) > WIDEST and not isinstance(value[0], str):
            yield place, f"an array of {len(value)}"
        else:
            for k, item in enumerate(value.tolist() if isinstance(value, np.ndarray) else value):
                yield from _numbers(f"{place}[{k}]", item)
    elif _is_time(value):
        yield place, "a time"
    elif not isinstance(value, str):
        for name, item in _members(value):
            yield from _numbers(f"{place}/{name}", item)


def _members(message: Any) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a message; constants, and the byte of an empty message, have defaults."""
    for member in fields(message):
        if member.default is MISSING:
            yield member.name, getattr(message, member.name)


def _is_time(value: Any) -> bool:
    return getattr(value, "__msgtype__", None) in _TIMES


def _is_standard(word: str) -> bool:
    channel = channel_of(parse(word))
    return channel != "time" and unit_of(channel) is not None


def _indexed(header: str) -> str:
    """Return a header without brackets, in which units stand elsewhere."""
    return header.replace("[", "/").replace("]", "")


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
