"""Texts whose layout is not seen by their first rows: names in every line, and LabVIEW's."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from mckibben.files.cells import Dialect
from mckibben.files.sniffing import Layout

Found = tuple[Sequence[bytes], Layout]
"""The lines of a text, and their layout."""

_INSTANT = re.compile(r"(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?")

_NAME = r"[^\W\d][^\s:=,;|]*"
_PAIR = re.compile(rf"(?:^|[,;|\s]+)({_NAME})\s*[:=]\s*(?!{_NAME}\s*[:=])")


def keyed(data: bytes) -> Found | None:
    """Return text with a name before each number as one with columns; None if it is none.

    >>> keyed(b"p:1.20,d:3.4")[1].headers
    ['p', 'd']
    """
    start = [_pairs(line) for line in data[: 2**16].split(b"\n") if line.strip()]
    named = [tuple(one) for one in start if one]
    names = max(named, key=named.count, default=())
    if not names or 2 * named.count(names) <= len(start):
        return None
    rows, first, comma = data.split(b"\n"), -1, False
    for at, row in enumerate(rows):
        found = _pairs(row)
        if found and tuple(found) == names:
            first = at if first < 0 else first
            comma |= any(re.match(r"[-+]?\d*,\d", cell) is not None for cell in found.values())
            rows[at] = "\t".join(found.values()).encode()
        elif row.strip():
            rows[at] += b"\t" * len(names)  # more cells than a sample has
    dialect = Dialect("\t", "," if comma else ".")
    return rows, Layout(dialect, [*names], [None] * len(names), first, len(names))


def _pairs(row: bytes) -> dict[str, str] | None:
    """Return name -> text of a line of such pairs, perhaps behind an instant and words; or None."""
    line = row.decode("utf-8", "replace").replace('"', "").strip("{};,| \t")
    before, *parts = _PAIR.split(line)
    found = {
        name: " ".join(cell.split()) for name, cell in zip(parts[::2], parts[1::2], strict=True)
    }
    instant = _INSTANT.search(before)
    if not found or len(parts) > 2 * len(found):
        return None
    return {"time": instant[0], **found} if instant and "time" not in found else found


def labview(data: bytes) -> dict[str | None, Found]:
    """Return name -> the segments of a LabVIEW measurement file; nothing for other texts.

    Segments of the same channels that go on in time are one.
    """
    text = data.decode("utf-8", "replace").split("\n") if data.startswith(b"LabVIEW Meas") else []
    ends = [k for k, line in enumerate(text) if line.startswith("***End_of_Header***")]
    if len(ends) < 2:
        return {}
    about = dict(re.findall(r"(?m)^(\w+)[\t,;]+([^\t,;\n]+|[,;])", "\n".join(text[: ends[0]])))
    separator = "," if about.get("Separator") == "Comma" else "\t"
    dialect = Dialect(separator, about.get("Decimal_Separator", "."))
    begins = [max(k for k in range(end) if text[k].startswith("Channels")) for end in ends[1:]]
    found: list[Layout] = []
    last = math.nan
    for begin, end, stop in zip(begins, ends[1:], [*begins[1:], len(text)], strict=True):
        one = _segment(text[begin : end + 2], end + 2, stop, dialect, about)
        first, final, most = _times(one, [line for line in text[end + 2 : stop] if line.strip()])
        alike = found and (found[-1].headers, found[-1].rates) == (one.headers, one.rates)
        if alike and 0 < first - last < most:
            text[begin : end + 2] = [""] * (end + 2 - begin)
            one = replace(found.pop(), stop=stop)
        found.append(one)
        last = final
    rows = [line.encode() for line in text]
    names = [str(k) for k in range(1, len(found) + 1)] if len(found) > 1 else [None]
    return {name: (rows, layout) for name, layout in zip(names, found, strict=True)}


def _segment(
    header: Sequence[str], first: int, stop: int, dialect: Dialect, about: Mapping[str, str]
) -> Layout:
    """Return the layout of a segment from its header, which ends with a line of names."""
    given = {cells[0]: cells[1:] for line in header if len(cells := dialect.split(line)) > 1}
    names = dialect.split(header[-1])
    of = [at for at, name in enumerate(names) if name not in ("X_Value", "Comment", "")]

    def stated(key: str) -> list[str]:
        filled = [cell for cell in given.get(key, []) if cell]
        placed = [cell for at in of for cell in given.get(key, [])[at - 1 : at]]
        return filled if len(filled) == len(of) else placed

    steps, starts = (
        [dialect.value(dialect.form(c)[1]) for c in stated(k)] for k in ("Delta_X", "X0")
    )
    x = "time" if {*stated("X_Dimension")} <= {"Time", ""} else "X_Value"
    called = {"X_Value": "" if about.get("X_Columns") == "No" else x, "Comment": ""}
    units = dict(zip(of, stated("Y_Unit_Label"), strict=False))
    return Layout(
        dialect,
        [called.get(name, name) for name in names],
        [units.get(at) or ("s" if called.get(n) == "time" else None) for at, n in enumerate(names)],
        first,
        of[-1] + 1,
        stop,
        {f"Delta_X {at}/dt": step for at, step in enumerate(steps, start=1)},
        starts[0] if starts else 0.0,
    )


def _times(one: Layout, lines: Sequence[str]) -> tuple[float, float, float]:
    """Return the first and last time of a segment, and how much later one that goes on may begin."""
    if "" in one.headers[:1]:
        step = next(iter(one.rates.values()), math.nan)
        return one.start_time, one.start_time + step * (len(lines) - 1), 1.5 * step
    ends = [one.dialect.form(one.dialect.split(line)[0])[1] for line in (*lines[:1], *lines[-1:])]
    first, final = map(one.dialect.value, ends or [None, None])
    return first, final, math.inf
