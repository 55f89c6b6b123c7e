"""MCAP, walked through from its start; chunks are unpacked to no more than they say.

By "MCAP Format Specification" (Foxglove).
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from io import BufferedReader, BytesIO
from struct import Struct

from mckibben.files.topics import Connection
from mckibben.files.unpacking import Unpacking

MAGIC = b"\x89MCAP0\r\n"

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _END, _FOOTER = 3, 4, 5, 6, 15, 2
_RECORD, _ABOUT, _CHUNKED = Struct("<BQ"), Struct("<HIQQ"), Struct("<QQQI")
_SERIALIZED = {("cdr", "ros2msg"): True, ("ros1", "ros1msg"): False}
"""Encodings of a message and its definition -> whether it is as in ROS 2."""


def messages(file: BufferedReader, unpacking: Unpacking) -> Iterator[tuple[Connection, int, bytes]]:
    """Return the messages of a file, with the times at which they were recorded [ns].

    Raises
    ------
    ValueError
        If it is cut off or damaged.
    """
    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError("it does not begin as MCAP")
    yield from _Walk(unpacking).through(file)


class _Walk:
    """What is known on the way."""

    def __init__(self, unpacking: Unpacking) -> None:
        self._unpacking = unpacking
        self._schemas: dict[int, tuple[str, str, str]] = {0: ("", "", "")}
        self._connections: dict[int, Connection] = {}

    def through(
        self, file: BufferedReader | BytesIO, within: bool = False
    ) -> Iterator[tuple[Connection, int, bytes]]:
        while head := file.read(_RECORD.size):
            if len(head) < _RECORD.size:
                break
            kind, length = _RECORD.unpack(head)
            if kind in (_END, _FOOTER):
                return
            content = file.read(length)
            if len(content) < length:
                break
            if kind == _SCHEMA:
                self._schema(BytesIO(content))
            elif kind == _CHANNEL:
                self._channel(BytesIO(content))
            elif kind == _MESSAGE:
                channel, _, when, _ = _ABOUT.unpack(content[: _ABOUT.size])
                yield self._connections[channel], when, content[_ABOUT.size :]
            elif kind == _CHUNK and not within:
                yield from self.through(self._unpacked(BytesIO(content)), within=True)
        else:
            if within:
                return
        raise ValueError("it is cut off")

    def _schema(self, content: BytesIO) -> None:
        number = _number(content, 2)
        name, encoding = _text(content), _text(content)
        self._schemas[number] = name, encoding, _text(content)

    def _channel(self, content: BytesIO) -> None:
        number, schema = _number(content, 2), _number(content, 2)
        topic, encoding = _text(content), _text(content)
        kind, language, definition = self._schemas[schema]
        cdr = _SERIALIZED.get((encoding, language))
        said = f"{encoding or 'no encoding'} with {language or 'no definition'}"
        problem = "" if cdr is not None else f"its messages are in {said}"
        if cdr is False and kind.count("/") == 1:
            kind = kind.replace("/", "/msg/")
        found = Connection(topic, kind, definition, bool(cdr), problem)
        if self._connections.get(number) != found:  # chunks say it again and again
            self._connections[number] = found

    def _unpacked(self, content: BytesIO) -> BytesIO:
        *_, size, checksum = _CHUNKED.unpack(content.read(_CHUNKED.size))
        name = _text(content)
        data = self._unpacking.all_of(content.read(_number(content, 8)), name, size)
        if checksum and zlib.crc32(data) != checksum:
            raise ValueError("the checksum of a chunk is another")
        return BytesIO(data)


def _number(content: BytesIO, size: int) -> int:
    return int.from_bytes(content.read(size), "little")


def _text(content: BytesIO) -> str:
    return content.read(_number(content, 4)).decode("utf-8", "replace")
