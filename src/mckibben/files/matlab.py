"""MATLAB files: vectors and narrow matrices, also in structs and cells; version 7.3 is HDF5."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterable, Iterator
from io import BufferedReader, BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatlabFunction, MatlabOpaque
from scipy.sparse import issparse

from mckibben.files import hdf5, tree
from mckibben.files.table import Table
from mckibben.files.tree import Node, Unread

_TYPES = {*range(1, 8), 9, *range(12, 19)}
"""Types of elements in "MAT-File Format" (MathWorks)."""

_MATRIX, _COMPRESSED = 14, 15
_OUTER = {_MATRIX, _COMPRESSED}

_OF_MATRICES = {1, 2, 3, 16, 17}
"""Classes of arrays that hold arrays: cells, structs, objects, functions, opaque ones."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of a MAT file, of version 4 to 7.3."""
    if file.peek(10).startswith((b"MATLAB 7.3", b"\x89HDF")):
        return hdf5.read(file, path)
    data = file.read()
    if data[126:128] not in (b"IM", b"MI"):  # version 4
        parts: Iterable[bytes] = [data]
    else:  # each variable alone, as SciPy returns the last of one name, and objects have none there
        elements = _checked(data[128:], "<" if data[126:128] == b"IM" else ">")
        parts = (data[:128] + element for element in elements)
    found: dict[str, Node] = {}
    variables = (loadmat(BytesIO(part)) for part in parts)  # type: ignore[arg-type]  # stubs without files
    for name, value in (item for each in variables for item in each.items()):
        if isinstance(value, MatlabOpaque):
            last = value.reshape(-1)[0]
            name, kind = (last[field].decode("latin-1") for field in ("s0", "s2"))
            node: Node = Unread(f"an object of class {kind}")
        elif name.startswith("__"):
            continue
        else:  # a str is SciPy's reason why it cannot read a variable
            node = Unread(value) if isinstance(value, str) else _node(value)
        if name in found:
            raise ValueError("two variables have one name")
        found[name] = node
    return [tree.table(found, path)]


def _checked(data: bytes, order: str, outer: Collection[int] = _OUTER) -> Iterator[bytes]:
    """Yield the elements of version 5; raise an error for an element of an invalid type.

    SciPy indexes a C array by the type unchecked, so that a received file could make it follow a pointer
    of its choice; see scipy/scipy#25829.
    """
    at = 0
    while at < len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        start, end = at + 8, at + 8 + size + (-size % 8 if kind != _COMPRESSED else 0)
        if kind >> 16:  # a small element, whose few bytes are in its tag
            kind, size, end = kind & 0xFFFF, 0, start
        if kind not in _TYPES or kind in _OUTER - set(outer):
            raise ValueError(f"it has an element of type {kind} where none can be")
        inside = data[start : start + size]
        if kind == _COMPRESSED:
            inside = zlib.decompressobj().decompress(inside)
        if kind == _COMPRESSED:
            list(_checked(inside, order, {_MATRIX}))
        elif kind == _MATRIX and inside:
            flags = struct.unpack_from(f"{order}I", inside, 8)[0]
            list(_checked(inside, order, {_MATRIX} if flags & 0xFF in _OF_MATRICES else ()))
        yield data[at:end]
        at = end


def _node(value: Any) -> Node:
    """Return a variable as a plain tree."""
    if value is None or isinstance(value, MatlabFunction):  # a struct without fields is None
        return ""
    if isinstance(value, MatlabOpaque) or issparse(value):
        return Unread("a sparse matrix" if issparse(value) else "an object")
    array = np.asarray(value)
    if array.dtype.names is not None:
        names = array.dtype.names
        structs = [{name: _node(each[name]) for name in names} for each in array.ravel(order="F")]
        return structs[0] if len(structs) == 1 else structs
    if array.dtype.kind == "O":
        if min(array.shape, default=0) > 1:
            return [[_node(each) for each in column.ravel(order="F")] for column in array.T]
        return [_node(each) for each in array.reshape(-1)]
    if array.dtype.kind in "US":
        lines = [str(line) for line in array.reshape(-1)]
        return lines if len(lines) > 1 else "".join(lines)
    return array
