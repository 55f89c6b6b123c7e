"""The pages of a Parquet file, looked at before they are unpacked: what the footer says are claims.

By "Apache Parquet: File Format" and "Thrift compact protocol" (both Apache): numbers of fields below
are theirs. What is here walks as PyArrow does, which makes room for what a page says it holds.
"""

from __future__ import annotations

from collections.abc import Set
from io import BufferedReader
from typing import Any

from mckibben.files.limits import MOST_PARTS, Budget

_I32, _I64, _BINARY, _LIST, _STRUCT = 5, 6, 8, 9, 12
_INTEGERS = (4, _I32, _I64)
_DEPTH = 16
_HEADER = 2**14
"""Bytes of a page's header, with the extremes of its samples."""

_WORDS = 2
_ABOUT = {0: 5, _WORDS: 7, 3: 8}
"""Field that tells what is in a page, by the page's type; PyArrow passes over other types."""

_MOST_FIELDS, _FIELDS_OF_PAGE = 100 * MOST_PARTS, 64
"""Of the footer, with its lists' items, and of the head of a page."""

Fields = dict[tuple[int, int], Any]
"""By number and type."""


def look(file: BufferedReader, wanted: Set[str], most: int, budget: Budget) -> None:
    """Refuse columns whose pages unpack to more than so many bytes, or hold more than their rows.

    Raises
    ------
    ValueError, LookupError
        If they do, or are not where the footer says.
    """
    end = file.seek(-8, 2)
    footer = end - int.from_bytes(file.read(4), "little")
    if footer < 0:
        raise ValueError("its footer is longer than the file")
    file.seek(footer)
    about = _Thrift(file.read(end - footer), _MOST_FIELDS).fields()
    within = tuple(f"{name}." for name in wanted)
    room = footer
    for group in about.get((4, _LIST), []):
        for column in group[1, _LIST]:
            described = column[3, _STRUCT]
            # a dot may be in a name, or lead to what is within a column, which is read with it
            name = b".".join(described[3, _LIST]).decode("utf-8", "replace")
            if name in wanted or name.startswith(within):
                most -= _unpacked(file, described, group[3, _I64], footer, budget)
                if most < 0:
                    raise ValueError("its pages unpack to more than its samples take")
                room -= described[7, _I64]
                if room < 0:
                    raise ValueError("its columns lie upon each other")
    file.seek(0)


def _unpacked(file: BufferedReader, column: Fields, rows: int, footer: int, budget: Budget) -> int:
    """Return how many bytes the pages of one column unpack to, in one group of rows."""
    at, dictionary = column[9, _I64], column.get((11, _I64), 0)
    at = dictionary if 0 < dictionary < at else at
    end, left, total = at + column[7, _I64], column[5, _I64], 0
    if rows == left == 0:
        return 0  # which may be said to be nowhere
    if not 0 < at <= end <= footer:
        raise ValueError("its pages are outside of it")
    if len(column[3, _LIST]) == 1 and left > rows:
        raise ValueError("a column has more samples than there are rows")
    while left > 0:
        budget.pieces(1)
        file.seek(at)
        thrift = _Thrift(file.read(min(_HEADER, end - at)), _FIELDS_OF_PAGE)
        page = thrift.fields()
        size, packed = page[2, _I32], page[3, _I32]
        at += thrift.at + packed
        if size < 0 or packed < 0 or at > end:
            raise ValueError("a page is longer than its column")
        total += size
        kind = page[1, _I32]
        held = page[_ABOUT[kind], _STRUCT][1, _I32] if kind in _ABOUT else 0
        if held < 0 or (kind == _WORDS and held > size):
            raise ValueError("a dictionary has more words than bytes")
        if kind != _WORDS:
            left -= held
            if left < 0:
                raise ValueError("a page has more samples than its column")
    return total


class _Thrift:
    """A struct in Thrift's compact protocol, of so many fields at most."""

    def __init__(self, data: bytes, most: int) -> None:
        self._data = data
        self._left = most
        self.at = 0

    def fields(self, depth: int = 0) -> Fields:
        """Read a struct; no field may come twice."""
        found: Fields = {}
        seen: set[int] = set()
        number = 0
        while head := self._byte():
            number = number + (head >> 4) if head >> 4 else self._signed()
            if number in seen:
                raise ValueError("a field comes twice")
            seen.add(number)
            self._count(1)
            kind = head & 15
            found[number, kind] = kind == 1 if kind in (1, 2) else self._value(kind, depth)
        return found

    def _value(self, kind: int, depth: int) -> Any:
        if depth > _DEPTH:
            raise ValueError("its footer is nested too deeply")
        if kind in _INTEGERS:
            return self._signed()
        if kind == _STRUCT:
            return self.fields(depth + 1)
        if kind in (_LIST, 10):
            head = self._byte()
            n = head >> 4 if head >> 4 < 15 else self._unsigned()
            if n > MOST_PARTS:
                raise ValueError("a list in its footer is too long")
            self._count(n)
            return [self._value(head & 15, depth + 1) for _ in range(n)]
        size = {1: 1, 2: 1, 3: 1, 7: 8}.get(kind)
        if size is None and kind != _BINARY:
            raise ValueError(f"a field of type {kind}")
        size = self._unsigned() if size is None else size
        start, self.at = self.at, self.at + size
        if self.at > len(self._data):
            raise ValueError("a field is cut off")
        return self._data[start : self.at]

    def _count(self, fields: int) -> None:
        self._left -= fields
        if self._left < 0:
            raise ValueError("it is described by too many fields")

    def _byte(self) -> int:
        self.at += 1
        return self._data[self.at - 1]

    def _unsigned(self) -> int:
        value = shift = 0
        while (byte := self._byte()) & 128:
            value |= (byte & 127) << shift
            shift += 7
            if shift > 63:
                raise ValueError("a number in its footer is too long")
        return value | byte << shift

    def _signed(self) -> int:
        value = self._unsigned()
        return value >> 1 ^ -(value & 1)
