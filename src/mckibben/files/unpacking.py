"""Unpacking the chunks of bags to no more than they say, and no more in all than their file pays for."""

from __future__ import annotations

import bz2
import os
import sys
from io import BufferedReader
from typing import Any

_FREE = 2**26
_PER_BYTE = 100
"""Bytes unpacked from one: measured ones have some five."""

_LARGEST = 2**28
"""Bytes of one chunk."""


class Unpacking:
    """What is left of what the chunks of a file may unpack to.

    Parameters
    ----------
    file : binary file
        It counts by its size, and stays where it stands.
    """

    def __init__(self, file: BufferedReader) -> None:
        self._left = max(_FREE, _PER_BYTE * os.fstat(file.fileno()).st_size)

    def all_of(self, packed: bytes, name: str, size: int | None = None) -> bytes:
        """Return what a chunk holds.

        Parameters
        ----------
        packed : bytes
        name : str
            Of the way it was packed: none, lz4, zstd or bz2.
        size : int, optional
            Bytes that it must have then.

        Raises
        ------
        ValueError
            If it is packed in another way, has another size, or unpacks to more than is left.
        """
        most = min(self._left, _LARGEST)
        if size is not None and size > most:
            raise ValueError("its chunks unpack to more than is read")
        room = most if size is None else size
        data = packed if name in ("", "none") else _unpacked(packed, name, room)
        if len(data) > most or size not in (None, len(data)):
            raise ValueError("a chunk has another size than it says, or more than is read")
        self._left -= len(data)
        return data


def _unpacked(packed: bytes, name: str, most: int) -> bytes:
    unpacker: Any
    if name == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        unpacker = LZ4FrameDecompressor()
    elif name == "zstd":
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd

        unpacker = zstd.ZstdDecompressor()
    elif name == "bz2":
        unpacker = bz2.BZ2Decompressor()
    else:
        raise ValueError(f"a chunk is packed by {name[:40]!r}")
    data: bytes = unpacker.decompress(packed, max_length=most + 1)
    while len(data) <= most and not unpacker.eof:
        more: bytes = unpacker.decompress(b"", max_length=most + 1 - len(data))
        if not more:
            raise ValueError("a chunk is cut off")
        data += more
    return data
