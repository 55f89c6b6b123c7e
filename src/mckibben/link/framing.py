"""Frames on a stream of bytes: stuffed so that a zero ends each (COBS), numbered, checked (CRC-32)."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

VERSION = 1
HEAD = struct.Struct("<BBII")
CHECK = struct.Struct("<I")
PAYLOAD = 250
"""Bytes of a frame before it is stuffed, at most; one more than that after, and the zero."""

ROOM = PAYLOAD - HEAD.size - CHECK.size
"""Bytes for what it says."""


@dataclass(frozen=True)
class Frame:
    """What one end tells the other.

    Parameters
    ----------
    kind : int
        What for.
    session, sequence : int
        32 bits each.
    body : bytes
        At most `ROOM`.
    """

    kind: int
    session: int
    sequence: int
    body: bytes = b""

    def packed(self) -> bytes:
        """Return the bytes on the wire.

        >>> Frame(4, 0, 1).packed().count(0)
        1
        """
        head = HEAD.pack(VERSION, self.kind, self.session, self.sequence)
        payload = head + self.body
        return stuffed(payload + CHECK.pack(zlib.crc32(payload))) + b"\0"


def unpacked(payload: bytes) -> Frame | None:
    """Return the frame of bytes that are stuffed no more, or None where they are none."""
    if not HEAD.size + CHECK.size <= len(payload) <= PAYLOAD:
        return None
    content, check = payload[: -CHECK.size], payload[-CHECK.size :]
    version, kind, session, sequence = HEAD.unpack_from(content)
    if version != VERSION or CHECK.unpack(check)[0] != zlib.crc32(content):
        return None
    return Frame(kind, session, sequence, content[HEAD.size :])


def stuffed(payload: bytes) -> bytes:
    """Return up to 253 bytes without any zero, one byte longer.

    >>> stuffed(bytes([7, 0, 0, 9])).hex()
    '0207010209'
    """
    return b"".join(bytes([len(part) + 1]) + part for part in payload.split(b"\0"))


def unstuffed(coded: bytes) -> bytes | None:
    """Return what was stuffed, or None where it was not."""
    parts, at = [], 0
    while at < len(coded):
        size = coded[at]
        part = coded[at + 1 : at + size]
        if size == 0 or len(part) != size - 1:
            return None
        parts.append(part)
        at += size
    return b"\0".join(parts)


class Reader:
    """Takes bytes as they come, and gives the frames in them.

    Attributes
    ----------
    dropped : int
        Pieces between zeros that were no frames.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._begun = bytearray()

    def feed(self, came: bytes) -> list[Frame]:
        """Return the frames that end in these bytes."""
        found = []
        *ended, rest = came.split(b"\0")
        for piece in ended:
            coded = bytes(self._begun + piece)
            self._begun.clear()
            if not coded:
                continue
            payload = unstuffed(coded) if len(coded) <= PAYLOAD + 1 else None
            frame = None if payload is None else unpacked(payload)
            if frame is None:
                self.dropped += 1
            else:
                found.append(frame)
        self._begun += rest[: PAYLOAD + 2 - len(self._begun)]  # a piece as long as that is no frame
        return found
