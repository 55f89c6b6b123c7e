"""MATLAB files: vectors and matrices of a few, also in structs and cells; version 7.3 is HDF5."""

from __future__ import annotations

import struct
import warnings
import zlib
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


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of a MAT file, of version 4 to 7.3."""
    if file.peek(10).startswith((b"MATLAB 7.3", b"\x89HDF")):
        return hdf5.read(file, path)
    data = file.read()
    _refuse_unknown_types(data)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        variables: dict[str, Any] = loadmat(BytesIO(data))  # type: ignore[arg-type]  # the stubs take no files
    # SciPy names all objects "None", and returns the last of one name
    doubled = [each for each in caught if str(each.message).startswith("Duplicate variable name")]
    objects = sum('"None"' in str(each.message) for each in doubled)
    if objects < len(doubled):
        raise ValueError("two variables have one name")
    found: dict[str, Node] = {}
    for name, value in variables.items():
        if isinstance(value, MatlabOpaque):
            last = value.reshape(-1)[0]
            kind = f"an object of class {last['s2'].decode('latin-1')}"
            more = f", and {objects} more object(s)" if objects else ""
            found[last["s0"].decode("latin-1")] = Unread(kind + more)
        elif not name.startswith("__"):  # a str is SciPy's reason why it cannot read a variable
            found[name] = Unread(value) if isinstance(value, str) else _node(value)
    return [tree.table(found, path)]


def _refuse_unknown_types(data: bytes) -> None:
    """Refuse version 5 with elements of unknown types, by which SciPy indexes a C array unchecked.

    A received file could make it follow a pointer of its choice; see scipy/scipy#25829.
    """
    order = "<" if data[126:128] == b"IM" else ">"
    if data[126:128] not in (b"IM", b"MI"):
        return  # version 4, which has no such elements
    waiting = [(memoryview(data), 128)]
    while waiting:
        content, at = waiting.pop()
        while at + 8 <= len(content):
            kind, size = struct.unpack_from(f"{order}II", content, at)
            start, at = at + 8, at + 8 + size + (-size % 8 if kind != _COMPRESSED else 0)
            if kind >> 16:  # a small element, whose few bytes are in its tag
                kind, size, at = kind & 0xFFFF, 0, start
            if kind not in _TYPES:
                raise ValueError(f"it has an element of the unknown type {kind}")
            inside = content[start : start + size]
            if kind == _COMPRESSED:
                waiting.append((memoryview(zlib.decompressobj().decompress(inside)), 0))
            elif kind == _MATRIX:
                waiting.append((inside, 0))


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
