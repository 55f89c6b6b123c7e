"""Chunks of an HDF5 data set, unpacked once and to no more than their room, as HDF5 would.

By "HDF5 File Format Specification" and the filters of the HDF5 library (both The HDF Group).
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from struct import pack

import numpy as np

DEFLATE, SHUFFLE, FLETCHER32 = 1, 2, 3
"""Numbers of the filters, in HDF5."""

_SUM = 4
"""Bytes of a checksum."""

_PIECE = 2**24
"""Words whose sums of sums fit in 64 bits."""

Filter = tuple[int, Sequence[int]]


def unpacked(packed: bytes, filters: Sequence[Filter], room: int) -> memoryview | None:
    """Return what a chunk holds, or None where that is damaged or not just what it has room for.

    Parameters
    ----------
    packed : bytes
        The chunk in the file.
    filters : sequence of (int, sequence of int)
        Number and values of each filter that it went through, in that order. The one value of
        shuffling is the bytes of a sample.
    room : int
        Bytes that it has when unpacked.
    """
    content: memoryview | None = memoryview(packed)
    for number, values in reversed(filters):
        if content is None:
            break
        if number == DEFLATE:
            content = _inflated(content, room + _SUM)
        elif number == FLETCHER32:
            content = _checked(content)
        else:
            content = _unshuffled(content, *values)
    return content if content is not None and len(content) == room else None


def _inflated(packed: memoryview, most: int) -> memoryview | None:
    unpacking = zlib.decompressobj()
    try:
        content = unpacking.decompress(packed, most + 1)
    except zlib.error:
        return None
    return memoryview(content) if unpacking.eof and not unpacking.unused_data else None


def _unshuffled(content: memoryview, width: int) -> memoryview:
    """Put the bytes of each sample together again: first come the first bytes of all."""
    whole = len(content) // width * width
    shuffled = np.frombuffer(content, np.uint8)
    ordered = np.empty_like(shuffled)
    samples = ordered[:whole].reshape(-1, width)
    for place, column in enumerate(shuffled[:whole].reshape(width, -1)):
        samples[:, place] = column
    ordered[whole:] = shuffled[whole:]
    return ordered.data


def _checked(content: memoryview) -> memoryview | None:
    """Return what stands before the checksum, or None where that is another."""
    kept, said = content[:-_SUM], bytes(content[-_SUM:])
    lower, upper = _fletcher32(kept)
    # the library before 1.6.3 wrote the bytes of each half the wrong way round
    return kept if said in (pack("<2H", lower, upper), pack(">2H", lower, upper)) else None


def _fletcher32(content: memoryview) -> tuple[int, int]:
    """Return both halves of Fletcher's checksum, over words whose high byte comes first."""
    lower = upper = 0
    for start in range(0, len(content), 2 * _PIECE):
        piece = content[start : start + 2 * _PIECE]
        words = np.frombuffer(piece if len(piece) % 2 == 0 else bytes(piece) + b"\0", ">u2")
        sums = words.cumsum(dtype=np.uint64)
        upper += lower * len(words) + int(sums.sum())
        lower += int(sums[-1])
    return _folded(lower), _folded(upper)


def _folded(total: int) -> int:
    """Add what goes beyond 16 bits to what is below: only zeros sum up to 0."""
    return (total - 1) % 65535 + 1 if total else 0
