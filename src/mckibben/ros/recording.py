"""Recording topics to MCAP, message by message, with ROS 2's definitions.

Every message is handed to the system once it is written, outside of chunks: a recording that is cut off
has lost its end and nothing else.

By "MCAP Format Specification" (Foxglove), profile ros2.
"""

from __future__ import annotations

from pathlib import Path
from struct import pack
from types import TracebackType
from typing import Self

from mckibben.ros.kinds import Kind

MAGIC = b"\x89MCAP0\r\n"

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _DATA_END = 1, 2, 3, 4, 5, 15


class Recorder:
    """A recording under way.

    Parameters
    ----------
    path : Path
        File to write; a ``.mcap``.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._file.write(MAGIC)
        self._record(_HEADER, _text("ros2") + _text("mckibben"))
        self._sequences: list[int] = []

    def topic(self, name: str, kind: Kind) -> int:
        """Add a topic and return its number."""
        number = len(self._sequences) + 1
        self._sequences.append(0)
        definition = _text(kind.ros) + _text("ros2msg") + _text(kind.definition)
        self._record(_SCHEMA, pack("<H", number) + definition)
        about = _text("/" + name.removeprefix("/")) + _text("cdr") + pack("<I", 0)
        self._record(_CHANNEL, pack("<HH", number, number) + about)
        return number

    def write(self, topic: int, when: int, message: bytes) -> None:
        """Add a message of a topic, at a time [ns since 1970]."""
        self._sequences[topic - 1] += 1
        head = pack("<HIQQ", topic, self._sequences[topic - 1] & 0xFFFFFFFF, when, when)
        self._record(_MESSAGE, head + message)
        self._file.flush()

    def close(self) -> None:
        """End the recording."""
        if not self._file.closed:
            try:
                self._record(_DATA_END, pack("<I", 0))
                self._record(_FOOTER, pack("<QQI", 0, 0, 0))
                self._file.write(MAGIC)
            finally:
                self._file.close()

    def _record(self, kind: int, content: bytes) -> None:
        self._file.write(pack("<BQ", kind, len(content)) + content)

    def __enter__(self) -> Self:
        """Return the recording."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the recording."""
        self.close()


def _text(text: str) -> bytes:
    data = text.encode()
    return pack("<I", len(data)) + data
