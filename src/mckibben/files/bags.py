"""Bags of ROS 1 (.bag), and of ROS 2 (.mcap, .db3): the numbers in their topics, each with its times.

RosBags reads the bags of ROS 1 and the definitions of messages. It is not used for more, since it makes
programs of the definitions in a file and runs them, and unpacks chunks to whatever they hold.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from io import BufferedReader
from pathlib import Path
from typing import Any

from mckibben.errors import DataError
from mckibben.files import mcap
from mckibben.files.limits import MOST_PARTS, Budget
from mckibben.files.notices import warn
from mckibben.files.table import Table
from mckibben.files.topics import Connection, Topic, table
from mckibben.files.unpacking import Unpacking
from mckibben.system.extras import demand

_LISTED = 10
_ZSTD = b"\x28\xb5\x2f\xfd"
_STEPS = 10_000_000
"""Of the machine of SQLite, between two looks at whether it goes on."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the topics of a bag that have numbers."""
    demand("rosbags", "ros", "bags of ROS", file=path)

    budget = Budget(file, path)
    kind = path.suffix.casefold()
    if kind == ".mcap":
        messages = mcap.messages(file, Unpacking(file))
    elif kind == ".bag":
        messages = _ros1(file, path)
    else:
        messages = _database(file, path)
    topics: dict[Connection, Topic] = {}
    seen: dict[int, tuple[Connection, Topic]] = {}  # by identity, which is quicker to look up
    began: int | None = None
    for connection, when, message in messages:
        known = seen.get(id(connection))
        if known is None:
            budget.parts(1)
            known = connection, topics.setdefault(connection, Topic(connection, budget))
            seen[id(connection)] = known
        topic = known[1]
        began = when if began is None else min(began, when)
        topic.take(when, message)
    left_out = [f"{one.topic} ({topic.problem})" for one, topic in topics.items() if topic.problem]
    if left_out:
        more = f" and {len(left_out) - _LISTED} more" if len(left_out) > _LISTED else ""
        warn(path, f"topics are left out: {'; '.join(left_out[:_LISTED])}{more}")
    columns = [
        column
        for topic in topics.values()
        if not topic.problem
        for column in topic.columns(began or 0)
    ]
    if not columns:
        said = ", ".join(one.topic for one in list(topics)[:_LISTED]) or "none"
        raise DataError(
            f"no topic in it has numbers that can be read; its topics are {said}",
            file=path,
            remedy="record topics of numbers, with the definitions of their messages",
        )
    return [table(columns, began or 0, [one.topic for one in topics if topics[one].problem])]


class _Lent:
    """A file that is open already, for RosBags, which opens and closes files by itself."""

    suffix = ".bag"

    def __init__(self, file: BufferedReader) -> None:
        self.read, self.seek, self.tell = file.read, file.seek, file.tell
        self.readline = file.readline

    def exists(self) -> bool:
        return True

    def open(self, mode: str) -> _Lent:
        return self

    def close(self) -> None:
        """Leave it open."""


def _ros1(file: BufferedReader, path: Path) -> Iterator[tuple[Connection, int, bytes]]:
    from rosbags.rosbag1 import Reader
    from rosbags.rosbag1.reader import ReaderError, decompressors

    names = {way: name for name, way in decompressors.items()}
    lent: Any = _Lent(file)
    try:
        with Reader(lent) as bag:
            unpacking = Unpacking(file)
            for chunk in bag.chunks.values():
                file.seek(chunk.datapos)
                unpacking.all_of(file.read(chunk.datasize), names[chunk.decompressor])
            known = {
                one.id: Connection(one.topic, one.msgtype, one.msgdef.data, cdr=False)
                for one in bag.connections
            }
            if not known:
                return
            for one, when, message in bag.messages():
                yield known[one.id], when, message
    except ReaderError as error:
        raise DataError(
            f"it is damaged or unfinished ({' '.join(str(error).split())[:200]})",
            file=path,
            remedy="mend it with rosbag reindex or fix, or record it again",
        ) from None


def _database(file: BufferedReader, path: Path) -> Iterator[tuple[Connection, int, bytes]]:
    """Return the messages in a database of ROS 2; the file is opened again, by its path."""
    where = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(where, uri=True)) as base:
        base.execute("PRAGMA trusted_schema = OFF")
        left = [100]

        def tired() -> int:
            left[0] -= 1
            return int(left[0] < 0)

        base.set_progress_handler(tired, _STEPS)
        kept = "SELECT name FROM sqlite_master WHERE type = 'table'"
        tables = {name for (name,) in base.execute(kept).fetchmany(MOST_PARTS)}
        if not {"topics", "messages"} <= tables:
            raise ValueError("it has no tables of topics and messages")
        known: dict[str, tuple[str, str]] = {}
        if "message_definitions" in tables:
            said = (
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            rows = base.execute(said).fetchmany(MOST_PARTS)
            known = {str(kind): (str(language), str(text)) for kind, language, text in rows}
        connections: dict[int, Connection] = {}
        rows = base.execute("SELECT id, name, type, serialization_format FROM topics").fetchmany(
            MOST_PARTS
        )
        for number, topic, kind, form in rows:
            language, text = known.get(str(kind), ("ros2msg", None))
            problem = (
                "" if (form, language) == ("cdr", "ros2msg") else f"it is in {form}, {language}"
            )
            connections[number] = Connection(str(topic), str(kind), text, True, problem)
        for number, when, message in base.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
        ):
            if message[:4] == _ZSTD:
                raise DataError(
                    "its messages are packed one by one",
                    file=path,
                    remedy="unpack it with ros2 bag convert",
                )
            yield connections[number], int(when), message
