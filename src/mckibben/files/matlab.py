"""MATLAB files: vectors and matrices of a few, or structs of them; version 7.3 is HDF5 underneath.

Versions 4 and 5 are read here, by "MAT-File Format" (MathWorks): what is no vector is passed over,
what a variable unpacks to is bounded, and structs within structs are followed to a certain depth.
"""

from __future__ import annotations

import math
import struct
import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.files import hdf5, rates
from mckibben.files.limits import Budget
from mckibben.files.table import Column, Table, column, columns_of, is_matrix, of_equal_length

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"}
_NUMBERS |= {12: "i8", 13: "u8"}
_TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_WIDTHS = {1: 1, 2: 1, 4: 2, 16: 1, 17: 2, 18: 4}
"""Bytes that a letter takes at least."""
_LINE = 8
"""Samples that each line of a text counts for: Python keeps it apart."""
_CELL, _STRUCT, _OBJECT, _CHAR = 1, 2, 3, 4
_NUMERIC = range(6, 16)
_WITHOUT_SHAPE = (16, 17)
"""Functions, and objects of newer kinds."""
_COMPLEX = 0x800
_MOST_AXES = 32
_NUMBERS_4 = ("f8", "f4", "i4", "i2", "u2", "u1")
_FULL, _WORDS, _SPARSE = range(3)
"""Of version 4."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of a MAT file, of version 4 to 7.3."""
    if hdf5.is_hdf5(file):
        return hdf5.read(file, path)
    start = file.read(_HEADER)
    order = {b"IM": "<", b"MI": ">"}.get(start[126:])
    if order is None or 0 in start[:4]:
        file.seek(0)
        order = "<" if 0 <= int.from_bytes(start[:4], "little", signed=True) <= 5000 else ">"
        vectors: _Vectors = _Version4(order, Budget(file, path))
    else:
        vectors = _Version5(order, Budget(file, path))
    found = vectors.read(file)
    return [replace(of_equal_length(found, path, meta={}), rates=vectors.rates)]


class _Vectors(ABC):
    """Those that were found, by the dotted place where they stand."""

    def __init__(self, order: str, budget: Budget) -> None:
        self._order = order
        self._budget = budget
        self._found: dict[str, Column] = {}
        self.rates: dict[str, float] = {}

    @abstractmethod
    def read(self, file: BufferedReader) -> dict[str, Column]:
        """Read the variables from where the file stands."""

    def _add(self, place: str, shape: tuple[int, ...], cells: NDArray[Any]) -> None:
        """Add numbers, or the lines of a table of characters, if they are a vector."""
        name = place.rpartition(".")[2]
        if math.prod(shape) == 1:
            if cells.size == 1 and cells.dtype.kind != "U" and rates.is_one(name):
                self.rates[place] = float(cells[0])
            return
        if cells.size != math.prod(shape):
            raise ValueError(f"{cells.size} elements in a matrix of {shape}")
        self._budget.samples(cells.size)
        if cells.dtype.kind == "U" and cells.size:
            self._budget.samples(_LINE * (cells.size // shape[-1]))
            lines = np.ascontiguousarray(cells.reshape(shape, order="F"))
            cells, shape = lines.view(f"U{shape[-1]}")[..., 0], shape[:-1]
        if sum(n != 1 for n in shape) == 1 or not cells.size:
            self._found[place] = column(name, cells.reshape(-1))
        elif cells.dtype.kind != "U" and is_matrix(shape):
            self._budget.parts(min(shape))
            matrix = cells.reshape(shape, order="F")
            self._found |= columns_of(place, name, matrix, None)


class _Version4(_Vectors):
    """The vectors of a file of version 4, which neither packs nor nests."""

    def read(self, file: BufferedReader) -> dict[str, Column]:
        """Read the variables from where the file stands."""
        while head := file.read(20):
            kind, *shape, imaginary, length = struct.unpack(f"{self._order}5i", head)
            number, of = divmod(kind, 10)
            if of not in (_FULL, _WORDS, _SPARSE) or min(*shape, length) < 0:
                raise ValueError("the head of a variable is damaged")
            self._budget.parts(1)
            name = file.read(length).partition(b"\0")[0].decode("latin-1")
            self._budget.place(name)
            cells = np.dtype(self._order + _NUMBERS_4[number % 100])
            size = math.prod(shape) * cells.itemsize * (2 if imaginary else 1)
            data = file.read(size)
            if len(data) < size:
                raise ValueError("a variable is cut off")
            if of == _SPARSE or imaginary:
                continue
            values = np.frombuffer(data, cells)
            if of == _WORDS:
                values = _letters(values.astype(np.uint8).tobytes().decode("latin-1"))
            self._add(name, tuple(shape), values)
        return self._found


class _Version5(_Vectors):
    """The vectors of a file of version 5."""

    def __init__(self, order: str, budget: Budget) -> None:
        super().__init__(order, budget)
        self._bytes = 0

    def read(self, file: BufferedReader) -> dict[str, Column]:
        """Read the variables from where the file stands."""
        while tag := file.read(8):
            kind, size = struct.unpack(f"{self._order}II", tag)
            content = memoryview(file.read(size))
            if not 0 < len(content) == size:
                raise ValueError("a variable is cut off")
            if kind == _COMPRESSED:
                kind, content = next(self._elements(self._unpacked(content)))
            if kind != _MATRIX:
                raise ValueError(f"a variable of type {kind}")
            self._budget.parts(1)
            self._collect("", content, 0)
        return self._found

    def _unpacked(self, packed: memoryview) -> memoryview:
        most = max(8 * self._budget.allowed - self._bytes, 0)
        unpacking = zlib.decompressobj()
        content = unpacking.decompress(packed, most + 1)  # a limit of 0 would be none
        self._bytes += len(content)
        if len(content) > most:
            self._budget.at_once(self._bytes // 8 + 1)
        if not unpacking.eof:
            raise ValueError("a packed variable is cut off")
        return memoryview(content)

    def _elements(self, content: memoryview) -> Iterator[tuple[int, memoryview]]:
        """Return the type and content of each element of a matrix."""
        at = 0
        while at < len(content):
            kind, size = struct.unpack_from(f"{self._order}II", content, at)
            begin, at = at + 8, at + 8 + size + -size % 8
            if kind >> 16:  # up to four bytes, within the tag
                kind, size, begin, at = kind & 0xFFFF, kind >> 16, begin - 4, begin
            if begin + size > len(content):
                raise ValueError("an element is longer than what it is in")
            yield kind, content[begin : begin + size]

    def _collect(self, place: str, content: memoryview, depth: int) -> None:
        """Add a matrix, or what is in a struct of one element, at its place.

        Parameters
        ----------
        place : str
            Empty for a variable, which has a name of its own.
        """
        self._budget.depth(depth)
        elements = self._elements(content)
        flags = self._integers(next(elements)[1])[0]
        of = flags & 0xFF
        if of in _WITHOUT_SHAPE:
            return
        shape = self._integers(next(elements)[1])
        name = bytes(next(elements)[1]).decode("latin-1")
        if not place and (not name or name.startswith("__")):  # what functions keep
            return
        place = place or name
        self._budget.place(place)
        if of in _NUMERIC and not flags & _COMPLEX:
            kind, data = next(elements)
            self._add(place, shape, np.frombuffer(data, self._order + _NUMBERS[kind]))
        elif of == _CHAR:
            self._add(place, shape, self._characters(*next(elements)))
        elif of == _CELL and math.prod(shape) == 1:
            self._inside(place, elements, depth)
        elif of in (_STRUCT, _OBJECT) and math.prod(shape) == 1:
            if of == _OBJECT:
                next(elements)  # the name of its class
            length = self._integers(next(elements)[1])[0]
            names = bytes(next(elements)[1])
            for start in range(0, len(names), length):
                field = names[start : start + length].partition(b"\0")[0].decode("latin-1")
                self._inside(f"{place}.{field}", elements, depth)
        elif not 0 < of < 16:
            raise ValueError(f"a matrix of class {of}")

    def _inside(self, place: str, elements: Iterator[tuple[int, memoryview]], depth: int) -> None:
        self._budget.parts(1)
        kind, content = next(elements)
        if kind == _MATRIX and content:
            self._collect(place, content, depth + 1)

    def _characters(self, kind: int, data: memoryview) -> NDArray[np.str_]:
        wide = {"<": "-le", ">": "-be"}[self._order] if kind in (4, 17, 18) else ""
        self._budget.at_once(len(data) // _WIDTHS[kind])
        return _letters(bytes(data).decode(_TEXTS[kind] + wide, "replace"))

    def _integers(self, data: memoryview) -> tuple[int, ...]:
        if len(data) > 4 * _MOST_AXES:
            raise ValueError(f"a matrix of more than {_MOST_AXES} axes")
        return struct.unpack(f"{self._order}{len(data) // 4}i", data)


def _letters(text: str) -> NDArray[np.str_]:
    return np.array(text).reshape(1).view("U1") if text else np.empty(0, "U1")
