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
from scipy.io.matlab import MatlabOpaque

from mckibben.files import hdf5, objects, tree
from mckibben.files.table import Table
from mckibben.files.tree import Node, Unread

_TYPES = {*range(1, 8), 9, *range(12, 19)}
"""Types of elements in "MAT-File Format" (MathWorks)."""

_MATRIX, _COMPRESSED = 14, 15
_OUTER = {_MATRIX, _COMPRESSED}

_NUMBERS = {**dict.fromkeys((4, *range(6, 16)), 1), 5: 3}
"""Classes of arrays -> the elements with their numbers, of which complex arrays have one more."""

_COMPLEX, _OPAQUE = 0x800, 17
_OF_MATRICES = {1, 2, 3, 16, _OPAQUE}
"""Classes of arrays that hold arrays: cells, structs, objects, functions, opaque ones."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of a MAT file, of version 4 to 7.3; of a struct array, each a recording."""
    start = file.peek(520)
    if b"\x89HDF\r\n\x1a\n" in (start[:8], start[512:520]):
        return hdf5.read(file, path)
    data = file.read()
    nodes: dict[str, Node] = {}
    decoded = None
    for name, value, at in _variables(data):
        order = "<" if data[126:128] == b"IM" else ">"
        if name == "__function_workspace__" and at == struct.unpack_from(f"{order}Q", data, 116)[0]:
            inside = np.asarray(value).tobytes()  # what is in objects
            list(_checked(inside[8:], "<" if inside[2:4] == b"IM" else ">"))
            decoded = objects.variables(path)
        elif not name.startswith("__"):
            if name in nodes:
                raise ValueError("two variables have one name")
            # a str is SciPy's reason why it cannot read a variable
            nodes[name] = Unread(value) if isinstance(value, str) else objects.node(value, name)
    return tree.runs(nodes if decoded is None else decoded, path)


def _variables(data: bytes) -> Iterator[tuple[str, Any, int]]:
    """Yield the variables by their names, and where each starts."""
    elements: Iterable[bytes] = [data[128:]]
    if data[126:128] in (b"IM", b"MI"):  # else it is version 4
        elements = _checked(data[128:], "<" if data[126:128] == b"IM" else ">")
    at = 128
    for element in elements:
        # each alone, as SciPy returns the last of one name, and objects have none there
        part = BytesIO(data[:128] + element)
        for name, value in loadmat(part).items():  # type: ignore[arg-type]  # stubs without files
            if isinstance(value, MatlabOpaque):
                name = value.reshape(-1)[0]["s0"].decode("latin-1")
            yield name, value, at
        at += len(element)


def _checked(data: bytes, order: str, outer: Collection[int] = _OUTER) -> Iterator[bytes]:
    """Yield the elements of version 5; raise an error for an element of an invalid type.

    SciPy and mat-io index a C array by the type unchecked, so that a received file could make them
    follow a pointer of its choice; see scipy/scipy#25829.
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
            list(_checked(zlib.decompressobj().decompress(inside), order, {_MATRIX}))
        elif kind == _MATRIX and inside:
            _check_array(inside, order)
        yield data[at:end]
        at = end


def _check_array(data: bytes, order: str) -> None:
    """Raise an error for an array that SciPy would read on in what follows it, or without dimensions."""
    *tag, flags = struct.unpack_from(f"{order}III", data)
    kind = flags & 0xFF
    parts = list(_checked(data, order, {_MATRIX} if kind in _OF_MATRICES else ()))
    of, size = struct.unpack_from(f"{order}II", parts[1]) if len(parts) > 1 else (0, 0)
    shaped = kind == _OPAQUE or (of in (5, 6) and size >= 8 and size % 4 == 0)
    numbers = _NUMBERS.get(kind, -3) + bool(flags & _COMPLEX)
    if tag != [6, 8] or not shaped or len(parts) < 3 + numbers:
        raise ValueError("it has an array without dimensions or numbers")
