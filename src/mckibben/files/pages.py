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
    about = _Thrift(file.read(end - footer)).fields()
    for group in about.get((4, _LIST), []):
        for column in group[1, _LIST]:
            described = column[3, _STRUCT]
            if described[3, _LIST][0].decode("utf-8", "replace").partition(".")[0] in wanted:
                most -= _unpacked(file, described, group[3, _I64], footer, budget)
                if most < 0:
                    raise ValueError("its pages unpack to more than its samples take")
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
        thrift = _Thrift(file.read(min(_HEADER, end - at)))
        page = thrift.fields()
        size, packed = page[2, _I32], page[3, _I32]
        at += thrift.at + packed
        if size < 0 or packed < 0 or at > end:
            raise ValueError("a page is longer than its column")
        total += size
        if words := page.get((7, _STRUCT)):
            if not 0 <= words[1, _I32] <= size:
                raise ValueError("a dictionary has more words than bytes")
        elif data := page.get((5, _STRUCT)) or page.get((8, _STRUCT)):
            left -= (held := data[1, _I32])
            if held < 0 or left < 0:
                raise ValueError("a page has more samples than its column")
    return total


class _Thrift:
    """A struct in Thrift's compact protocol; each step takes at least a byte, so that it ends."""

    def __init__(self, data: bytes) -> None:
        self._data = data
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
            return [self._value(head & 15, depth + 1) for _ in range(n)]
        size = {1: 1, 2: 1, 3: 1, 7: 8}.get(kind)
        if size is None and kind != _BINARY:
            raise ValueError(f"a field of type {kind}")
        size = self._unsigned() if size is None else size
        start, self.at = self.at, self.at + size
        if self.at > len(self._data):
            raise ValueError("a field is cut off")
        return self._data[start : self.at]

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
