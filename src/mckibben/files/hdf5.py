"""HDF5: the vectors, and matrices of a few, anywhere in its tree, with the units in their attributes.

A data set of HDF5 can name another file that holds its samples. One that does is refused: whoever
sends a file must not choose what else is read.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from io import BufferedReader
from operator import add, ge
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from mckibben.errors import DataError
from mckibben.files import hdf5_pieces, rates
from mckibben.files.chunks import DEFLATE, FLETCHER32, SHUFFLE, unpacked
from mckibben.files.limits import MOST_TEXT, Budget
from mckibben.files.table import Column, Table, column, columns_of, is_matrix, of_equal_length
from mckibben.system.extras import demand


def is_hdf5(file: BufferedReader) -> bool:
    """Tell whether a file is HDF5, also behind the 512 bytes that MATLAB puts in front."""
    start = file.read(520)
    file.seek(0)
    return hdf5_pieces.SIGNATURE in (start[:8], start[512:])


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of an HDF5 file."""
    demand("h5py", "hdf5", "HDF5", file=path)
    import h5py

    hdf5_pieces.look(file)
    budget = Budget(file, path)
    found: dict[str, Column] = {}
    told: dict[str, float] = {}
    numbers = (h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.ENUM, h5py.h5t.BITFIELD)
    with h5py.File(file, "r") as tree:
        for place, data in _data_sets(tree, budget):
            _refuse_elsewhere(place, data, path)
            name = place.rpartition("/")[2]
            rate = data.size == 1 and rates.is_one(name)
            vector = data.ndim == 1 or (data.ndim == 2 and 1 in data.shape)
            # types can be made of types without end: those are not asked for more
            number = data.id.get_type().get_class() in numbers
            matrix = not vector and is_matrix(data.shape or ())
            wanted = number and (vector or matrix or rate)
            if wanted and data.dtype.kind in "biuf" and not _is_text(data):
                budget.samples(data.size)
                if data.chunks is not None:
                    steps = zip(data.shape, data.chunks, strict=True)
                    padded = math.prod(-(-n // step) * step for n, step in steps)
                    budget.at_once(max(math.prod(data.chunks), padded // 2))
                samples = _samples(place, data, file, path)
                unit = _text(data, "units") or _text(data, "unit")
                if rate:
                    told[place] = float(samples.reshape(-1)[0])
                elif matrix:
                    budget.parts(min(data.shape))
                    found |= columns_of(place, name, samples, unit)
                else:
                    found[place] = column(name, samples.reshape(-1), unit)
        budget.parts(h5py.h5a.get_num_attrs(tree.id))
        meta = {name: _plain(tree, name) for name in tree.attrs}
    meta = {name: value for name, value in meta.items() if value is not None}
    return [replace(of_equal_length(found, path, meta=meta), rates=told)]


def _data_sets(tree: Any, budget: Budget) -> Iterator[tuple[str, Any]]:
    """Return every data set once, in the order of names.

    Only hard links are followed, which cannot leave the file; they can lead round in circles.
    """
    import h5py

    seen: set[int] = set()
    waiting: list[tuple[str, Any, bytes, int]] = [("", tree.id, b".", 0)]
    while waiting:
        place, parent, name, at = waiting.pop()
        if at in seen:
            continue
        seen.add(at)
        node = h5py.h5o.open(parent, name)
        if isinstance(node, h5py.h5d.DatasetID):
            yield place, h5py.Dataset(node)
        elif isinstance(node, h5py.h5g.GroupID):
            budget.parts(node.get_num_objs())
            budget.depth(place.count("/") + bool(place))
            names: list[bytes] = []
            node.links.iterate(names.append)
            for name in reversed(names):
                hidden = not place and name.startswith(b"#")  # what MATLAB refers to
                link = node.links.get_info(name)
                if not hidden and link.type == h5py.h5l.TYPE_HARD:
                    below = (f"{place}/" if place else "") + name.decode("utf-8", "replace")
                    budget.place(below)
                    waiting.append((below, node, name, link.u))


def _refuse_elsewhere(place: str, data: Any, path: Path) -> None:
    """Refuse a data set that is made of other files; its shape is not asked, that opens them."""
    if data.is_virtual or data.external:
        raise DataError(
            f"data set {place!r} keeps its samples in another file",
            file=path,
            remedy="save all samples in this file",
        )


def _samples(place: str, data: Any, file: BufferedReader, path: Path) -> np.ndarray[Any, Any]:
    """Return samples that take just the room that their shape says: HDF5 reads on past their end.

    What is in chunks is unpacked here, since HDF5 would make room for all that comes out.
    """
    import h5py
    from h5py import h5d

    def refuse(problem: str) -> NoReturn:
        raise DataError(
            f"data set {place!r} {problem}",
            file=path,
            remedy="save it with gzip or without compression",
        )

    about, kind, shape = data.id.get_create_plist(), data.id.get_type(), data.chunks
    size = kind.get_size()
    if shape is None:
        kept = about.get_layout() == h5d.COMPACT or data.id.get_offset() is not None
        if kept and data.id.get_storage_size() < data.size * size:
            refuse("has fewer samples than it says")
        return np.asarray(data[()])
    described = [about.get_filter(i) for i in range(about.get_nfilters())]
    filters = [(number, values) for number, _, values, _ in described]
    numbers = {number for number, _ in filters}
    known = numbers <= {DEFLATE, SHUFFLE, FLETCHER32} and len(numbers) == len(filters)
    if not known or any(one == SHUFFLE and values != (size,) for one, values in filters):
        names = ", ".join(name.decode("ascii", "replace") for *_, name in described)
        refuse(f"is packed by {names}: only deflate, shuffle and fletcher32 are read, each once")
    room = math.prod(shape) * size
    places = math.prod(-(-n // step) for n, step in zip(data.shape, shape, strict=True))
    if data.id.get_num_chunks() > places:
        refuse("has more chunks than it says")
    chunks: list[Any] = []
    data.id.chunk_iter(chunks.append)
    offsets = {chunk.chunk_offset for chunk in chunks}
    if len(offsets) < len(chunks) or any(any(map(ge, at, data.shape)) for at in offsets):
        refuse("has more chunks than it says")
    if not filters and all(chunk.size == room for chunk in chunks):
        return np.asarray(data[()])  # nothing is packed, and HDF5 finds it fastest
    # older libraries do not count what stands before HDF5 in a file, as MATLAB's header
    placed = data.file.userblock_size == 0 or h5py.version.hdf5_version_tuple >= (2, 0, 0)
    samples, dtype = None, data.dtype
    if h5py.h5t.py_create(dtype, logical=True) == kind:  # else HDF5 converts them
        samples = np.full(data.shape, data.fillvalue, dtype)
    for chunk in chunks:
        content = None
        if chunk.size <= room + room // 8 + 1024:
            used = [one for i, one in enumerate(filters) if not chunk.filter_mask >> i & 1]
            if placed and samples is not None:  # which takes a tenth of the time
                file.seek(chunk.byte_offset)
                packed = file.read(chunk.size)
            else:
                packed = data.id.read_direct_chunk(chunk.chunk_offset)[1]
            content = unpacked(packed, used, room)
        if content is None:
            refuse("is packed more or less closely than it says")
        if samples is not None:
            block = np.frombuffer(content, dtype).reshape(shape)
            of = tuple(map(slice, chunk.chunk_offset, map(add, chunk.chunk_offset, shape)))
            left = samples[of].shape  # of a chunk at the end
            samples[of] = block[tuple(map(slice, left))]
    return np.asarray(data[()]) if samples is None else samples


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
