"""HDF5: the one-dimensional data sets anywhere in its tree, with the units in their attributes.

A data set of HDF5 can name another file that holds its samples. One that does is refused: whoever
sends a file must not choose what else is read.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.errors import DataError
from mckibben.files.limits import MOST_TEXT, Budget
from mckibben.files.table import Column, Table, column, of_equal_length

_HEAP = b"GCOL\1\0\0\0"
_BLOCK = 2**22

MOST_UNLOOKED = 2**18
"""Bytes of a packed chunk that may stand for a thousand times as many, unseen."""

_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def is_hdf5(file: BufferedReader) -> bool:
    """Tell whether a file is HDF5, also behind the 512 bytes that MATLAB puts in front."""
    start = file.read(520)
    file.seek(0)
    return _SIGNATURE in (start[:8], start[512:])


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of an HDF5 file."""
    try:
        import h5py
    except ImportError:
        raise DataError(
            "HDF5 needs a library that is not installed",
            file=path,
            remedy="pip install mckibben[hdf5]",
        ) from None

    _refuse_endless(file)
    budget = Budget(file, path)
    found: dict[str, Column] = {}
    with h5py.File(file, "r") as tree:
        for place, data in _data_sets(tree, budget):
            _refuse_elsewhere(place, data, path)
            vector = data.ndim == 1 or (data.ndim == 2 and 1 in data.shape)
            if vector and data.dtype.kind in "biuf" and not _is_text(data):
                budget.samples(data.size)
                budget.at_once(math.prod(data.chunks or ()))
                _refuse_overfull(place, data, path)
                unit = _text(data, "units") or _text(data, "unit")
                found[place] = column(place.rpartition("/")[2], data[()].reshape(-1), unit)
        budget.parts(h5py.h5a.get_num_attrs(tree.id))
        meta = {name: _plain(tree, name) for name in tree.attrs}
    return [
        of_equal_length(
            found, path, meta={name: value for name, value in meta.items() if value is not None}
        )
    ]


def _refuse_endless(file: BufferedReader) -> None:
    """Refuse a heap of texts in which a piece has no length: HDF5 would look for its end for ever."""
    at, last = 0, b""
    while block := file.read(_BLOCK):
        window = last + block
        start = at - len(last)
        found = window.find(_HEAP)
        while found >= 0:
            _walk_heap(file, start + found)
            found = window.find(_HEAP, found + 1)
        at += len(block)
        file.seek(at)
        last = window[1 - len(_HEAP) :]
    file.seek(0)


def _walk_heap(file: BufferedReader, at: int) -> None:
    file.seek(at + len(_HEAP))
    size = int.from_bytes(file.read(8), "little")
    heap, inside = file.read(max(0, min(size, 2**32) - 16)), 0
    while inside + 16 <= len(heap):
        index = int.from_bytes(heap[inside : inside + 2], "little")
        length = int.from_bytes(heap[inside + 8 : inside + 16], "little")
        step = 16 + length + -length % 8 if index else length
        if not 0 < step < 2**63:
            raise ValueError("its texts have no end")
        inside += step


def _data_sets(tree: Any, budget: Budget) -> Iterator[tuple[str, Any]]:
    """Return every data set once, in the order of names.

    Only hard links are followed, which cannot leave the file; they can lead round in circles.
    """
    import h5py

    seen: set[tuple[int, ...]] = set()
    waiting: list[tuple[tuple[str, ...], Any, bytes]] = [((), tree.id, b".")]
    while waiting:
        place, parent, name = waiting.pop()
        where = h5py.h5o.get_info(parent, name)
        if (where.fileno, where.addr) in seen:
            continue
        seen.add((where.fileno, where.addr))
        node = h5py.h5o.open(parent, name)
        if isinstance(node, h5py.h5d.DatasetID):
            yield "/".join(place), h5py.Dataset(node)
        elif isinstance(node, h5py.h5g.GroupID):
            budget.parts(node.get_num_objs())
            budget.depth(len(place))
            names: list[bytes] = []
            node.links.iterate(names.append)
            for name in reversed(names):
                hidden = not place and name.startswith(b"#")  # what MATLAB refers to
                if not hidden and node.links.get_info(name).type == h5py.h5l.TYPE_HARD:
                    waiting.append(((*place, name.decode("utf-8", "replace")), node, name))


def _refuse_elsewhere(place: str, data: Any, path: Path) -> None:
    """Refuse a data set that is made of other files; its shape is not asked, that opens them."""
    if data.is_virtual or data.external:
        raise DataError(
            f"data set {place!r} keeps its samples in another file",
            file=path,
            remedy="save all samples in this file",
        )


def _refuse_overfull(place: str, data: Any, path: Path) -> None:
    """Refuse chunks that unpack to more than a chunk holds, which HDF5 would make room for."""
    from h5py import h5z

    if data.chunks is None:
        return
    pipeline = data.id.get_create_plist()
    filters = [pipeline.get_filter(i)[0] for i in range(pipeline.get_nfilters())]
    # what leaves as many bytes as a chunk has, or fewer, whatever it is given
    harmless = (h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32, h5z.FILTER_SCALEOFFSET, h5z.FILTER_NBIT)
    packing = [one for one in filters if one not in harmless]
    room = math.prod(data.chunks) * data.dtype.itemsize
    overfull = len(packing) > 1

    def look(chunk: Any) -> None:
        nonlocal overfull
        overfull |= chunk.size > room + room // 8 + 1024
        if chunk.size > MOST_UNLOOKED and not overfull and packing == [h5z.FILTER_DEFLATE]:
            packed = data.id.read_direct_chunk(chunk.chunk_offset)[1]
            unpacking = zlib.decompressobj()
            unpacking.decompress(packed, room + 1024)
            overfull |= bool(unpacking.unconsumed_tail)

    if packing and not overfull:
        data.id.chunk_iter(look)
    if overfull:
        raise DataError(
            f"data set {place!r} is packed more than once, or more closely than it says",
            file=path,
            remedy="save it without compression",
        )


def _is_text(data: Any) -> bool:
    return _text(data, "MATLAB_class") in ("char", "cell", "struct")


def _text(item: Any, name: str) -> str | None:
    plain = _plain(item, name)
    return plain if isinstance(plain, str) else None


def _plain(item: Any, name: str) -> str | float | int | bool | None:
    """Return an attribute as JSON holds it, or None where it does not or there is none."""
    import h5py

    if name not in item.attrs:
        return None
    about = h5py.h5a.open(item.id, name.encode("utf-8", "surrogateescape"))
    scalar = about.get_space().get_simple_extent_npoints() == 1
    kinds = (h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.STRING, h5py.h5t.ENUM)
    if not scalar or about.get_type().get_class() not in kinds:
        return None
    if about.get_storage_size() > MOST_TEXT:
        return None
    value = item.attrs[name]
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, str) and len(value) > MOST_TEXT:
        return None
    return value if isinstance(value, (str, int, float, bool)) else None
