"""Texts with a name before every number, such as ``p:1.20,d:3.4``."""

from __future__ import annotations

import re

from mckibben.files.cells import Dialect
from mckibben.files.sniffing import Layout, LinesWithLayout

_INSTANT = re.compile(r"(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?")

_NAME = r"[^\W\d][^\s:=,;|]*"
_PAIR = re.compile(rf"(?:^|[,;|\s]+)({_NAME})\s*[:=]\s*(?!{_NAME}\s*[:=])")

BYTES_LOOKED_AT = 2**16
"""Bytes at the start by which such a text is recognised."""


def read_named_values(data: bytes) -> LinesWithLayout | None:
    """Return text with a name before each number as one with columns; None if it is none.

    >>> read_named_values(b"p:1.20,d:3.4")[1].headers
    ['p', 'd']
    """
    start = [_pairs(line) for line in data[:BYTES_LOOKED_AT].split(b"\n") if line.strip()]
    names_of_lines = [tuple(pairs) for pairs in start if pairs]
    names = max(names_of_lines, key=names_of_lines.count, default=())
    if not names or 2 * names_of_lines.count(names) <= len(start):
        return None
    rows, first, comma = data.split(b"\n"), -1, False
    for at, row in enumerate(rows):
        pairs = _pairs(row)
        if pairs and tuple(pairs) == names:
            first = at if first < 0 else first
            comma |= any(re.match(r"[-+]?\d*,\d", cell) is not None for cell in pairs.values())
            rows[at] = "\t".join(pairs.values()).encode()
        elif row.strip():
            # more cells than a sample has, so that no reader takes it for a sample
            rows[at] += b"\t" * len(names)
    dialect = Dialect("\t", "," if comma else ".")
    return rows, Layout(dialect, [*names], [None] * len(names), first, len(names))


def _pairs(row: bytes) -> dict[str, str] | None:
    """Return name -> text of a line of such pairs, perhaps behind an instant and words; or None."""
    line = row.decode("utf-8", "replace").replace('"', "").strip("{};,| \t")
    before, *parts = _PAIR.split(line)
    pairs = {
        name: " ".join(cell.split()) for name, cell in zip(parts[::2], parts[1::2], strict=True)
    }
    instant = _INSTANT.search(before)
    if not pairs or len(parts) > 2 * len(pairs):  # a name twice
        return None
    return {"time": instant[0], **pairs} if instant and "time" not in pairs else pairs
