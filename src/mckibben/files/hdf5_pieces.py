"""The pieces that HDF5 walks through, walked before it does: it does not look where it has been.

By "HDF5 File Format Specification" (The HDF Group). Some pieces name others: texts in a heap say how
long they are, free room says where more of it is, and the nodes of an index name those below them. A
file in which they lead back, or many times to the same, would keep HDF5 busy for ever, take all memory
or end the process. Each piece has room of its own in a file, which bounds how many there can be.
"""

from __future__ import annotations

import os
import struct
from io import BufferedReader

import numpy as np

SIGNATURE = b"\x89HDF\r\n\x1a\n"

_HEAP, _NAMES, _NODE, _FRACTAL = b"GCOL\1", b"HEAP\0", b"TREE", b"FRHP\0"
_ENTRIES = b"SNOD"
"""Of a group, below the nodes of its index."""

_SMALLEST_HEAP = 4096
_END = 1
"""Where a list of free room ends."""

_BLOCK = 2**22
_KEPT = 8
"""Bytes before a block that are looked at with it: a fractal heap's first nine, less one."""

_CHUNKS = 1
_STRIDES = {0: (16,), _CHUNKS: (32, 40)}
"""Bytes from one name of a lower node to the next: of groups, and of vectors with one or two axes."""


def look(file: BufferedReader) -> None:
    """Refuse a file whose pieces lead HDF5 back, or that are packed, which h5py makes none.

    Raises
    ------
    ValueError
        Saying which.
    """
    _Pieces(file).look()
    file.seek(0)


class _Pieces:
    def __init__(self, file: BufferedReader) -> None:
        self._file = file
        self._size = os.fstat(file.fileno()).st_size
        self._base = self._beginning()
        # each takes eight bytes at least; nodes are walked from those above them, too
        self._left = self._size // 4 + 1000

    def look(self) -> None:
        at, last = 0, b""
        while block := self._bytes(at, _BLOCK):
            window, start = last + block, at - len(last)
            for found in _places(window, _HEAP):
                self._walk_heap(start + found)
            for found in _places(window, _NAMES):
                self._walk_free(start + found)
            for found in _places(window, _NODE):
                kind, level = (*window[found + 4 : found + 6], 0, 0)[:2]
                if level or kind != _CHUNKS:
                    for stride in _STRIDES.get(kind, ()):
                        self._walk_nodes(start + found, stride)
            if any(any(window[i + 7 : i + 9]) for i in _places(window, _FRACTAL)):
                raise ValueError("its names or attributes are packed")  # filters are described
            at += len(block)
            last = window[-_KEPT:]

    def _beginning(self) -> int:
        """Return what places in the file are counted from."""
        at = 0
        while at < self._size:
            start = self._bytes(at, 16)
            if start.startswith(SIGNATURE):
                sizes = start[13:15] if start[8] < 2 else start[9:11]
                if sizes != b"\x08\x08":
                    raise ValueError("its places are told by other than eight bytes")
                return at
            at = max(512, 2 * at)
        raise ValueError("no signature")

    def _bytes(self, at: int, n: int) -> bytes:
        self._file.seek(min(at, self._size))
        return self._file.read(n)

    def _number(self, at: int) -> int:
        return int.from_bytes(self._bytes(at, 8), "little")

    def _count(self, pieces: int) -> None:
        self._left -= pieces
        if self._left < 0:
            raise ValueError("its pieces have no end")

    def _walk_heap(self, at: int) -> None:
        size = self._number(at + 8)
        if not _SMALLEST_HEAP <= size <= self._size - at:
            return  # which HDF5 reads none of
        end, at = at + size, at + 16
        while at + 16 <= end:
            self._count(1)
            index, length = struct.unpack("<H6xQ", self._bytes(at, 16))
            step = 16 + length + -length % 8 if index else length
            if not 0 < step < 2**63:
                raise ValueError("its texts have no end")
            at += step

    def _walk_free(self, at: int) -> None:
        head = self._bytes(at + 8, 24)
        if len(head) == 24:
            size, free, place = struct.unpack("<QQQ", head)
            size = min(size, self._size - self._base - place)
            while free != _END and free + 16 <= size:
                self._count(1)
                free = self._number(self._base + place + free)

    def _walk_nodes(self, at: int, stride: int, above: int = 256) -> None:
        """Walk what is below a node, and lower than the one above it."""
        head = self._bytes(at, 8)
        if len(head) < 8 or head[:4] not in (_NODE, _ENTRIES):
            return
        kind, level, used = struct.unpack("<4xBBH", head)
        self._count(1 + used)
        if head.startswith(_ENTRIES) or (level == 0 and kind == _CHUNKS):
            return
        if level >= above:
            raise ValueError("its index leads back")
        names = self._bytes(at + 24, used * stride)
        for end in range(stride, len(names) + 1, stride):
            below = int.from_bytes(names[end - 8 : end], "little")
            self._walk_nodes(self._base + below, stride, level)


def _places(window: bytes, signature: bytes) -> list[int]:
    """Return where a signature stands; by words, which takes half the time of searching for bytes."""
    word, found = int.from_bytes(signature[:4], "little"), []
    for offset in range(4):
        n = (len(window) - offset) // 4
        if n > 0 and (alike := np.frombuffer(window, "<u4", n, offset) == word).any():
            found += (4 * np.flatnonzero(alike) + offset).tolist()
    return [at for at in found if window.startswith(signature, at)]
