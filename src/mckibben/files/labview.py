"""Measurement files of LabVIEW: segments, each with a header of its own."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from mckibben.files.cells import Dialect
from mckibben.files.sniffing import Layout, LinesWithLayout


def labview_segments(data: bytes) -> dict[str | None, LinesWithLayout]:
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
    segments: list[Layout] = []
    last_time = math.nan
    for begin, end, stop in zip(begins, ends[1:], [*begins[1:], len(text)], strict=True):
        segment = _segment(text[begin : end + 2], end + 2, stop, dialect, about)
        lines = [line for line in text[end + 2 : stop] if line.strip()]
        first_time, final_time, longest_gap = _times(segment, lines)
        if segments and _continues(segments[-1], segment, first_time - last_time, longest_gap):
            text[begin : end + 2] = [""] * (end + 2 - begin)
            segment = replace(segments.pop(), stop=stop)
        segments.append(segment)
        last_time = final_time
    rows = [line.encode() for line in text]
    names = [str(k) for k in range(1, len(segments) + 1)] if len(segments) > 1 else [None]
    return {name: (rows, layout) for name, layout in zip(names, segments, strict=True)}


def _continues(previous: Layout, this: Layout, gap: float, longest_gap: float) -> bool:
    """Return whether a segment goes on with the channels of the previous one, a gap later [s]."""
    same_channels = (previous.headers, previous.rates) == (this.headers, this.rates)
    return same_channels and 0 < gap < longest_gap


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


def _times(segment: Layout, lines: Sequence[str]) -> tuple[float, float, float]:
    """Return the first and last time of a segment, and the longest gap to one that continues it [s]."""
    if "" in segment.headers[:1]:
        step = next(iter(segment.rates.values()), math.nan)
        return segment.start_time, segment.start_time + step * (len(lines) - 1), 1.5 * step
    dialect, outer = segment.dialect, (*lines[:1], *lines[-1:])
    ends = [dialect.form(dialect.split(line)[0])[1] for line in outer]
    first, final = map(dialect.value, ends or [None, None])
    return first, final, math.inf
