"""Measurement files of LabVIEW (.lvm): a header of the file, then segments with headers of their own.

By "LabVIEW Measurement File Format" (NI): a line of a header is a key and its value for each channel.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import BufferedReader
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.errors import DataError
from mckibben.files.sniffing import Dialect, Layout, decoded
from mckibben.files.table import Column, Table
from mckibben.files.text import block

_WORDS = re.compile(rb"^[A-Za-z*][^\n]*", re.MULTILINE)  # no line of samples begins so
_END = "***End_of_Header***"
_X = "X_Value"

About = Mapping[str, Sequence[str]]


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the segments of a file, each a table."""
    data = decoded(file.read(), path)
    separator = re.search(rb"^Separator([\t,;])", data, re.MULTILINE)
    mark = re.search(rb"^Decimal_Separator[\t,;]([.,])", data, re.MULTILINE)
    dialect = Dialect(
        separator[1].decode() if separator else "\t", mark[1].decode() if mark else "."
    )
    heads = [(data.count(b"\n", 0, m.start()), m[0].decode()) for m in _WORDS.finditer(data)]
    about: dict[str, Sequence[str]] = {}
    found: list[Table] = []
    n_headers = 0
    for (line, text), stop in zip_longest(heads, [line for line, _ in heads[1:]]):
        key, *values = dialect.split(text)
        if key == _X and n_headers > 1:
            names = [key, *(value or f"Untitled {i}" for i, value in enumerate(values, start=1))]
            names[-1] = names[-1].replace("Comment", "")  # lines may end before what has no name
            layout = Layout(dialect, len(names), names, _units(names, about), line + 1)
            table = block(data, layout, path, stop)
            found.append(_timed(table, names, about, dialect.decimal))
        n_headers += key == _END
        about[key] = values
    if not found:
        problem = f"it has no segment of samples after a line {_END}"
        raise DataError(problem, file=path, remedy="export it again from LabVIEW")
    if len(found) == 1:
        return found
    return [replace(table, name=f"{i}") for i, table in enumerate(found, start=1)]


def _units(names: Sequence[str], about: About) -> list[str | None]:
    """Return the units of the columns: those of the header are of the channels alone."""
    time = "s" if "Time" in about.get("X_Dimension", ["Time"])[:1] else None
    labels = iter(about.get("Y_Unit_Label", ()))
    return [time if name == _X else next(labels, "") or None for name in names]


def _timed(table: Table, names: Sequence[str], about: About, decimal: str) -> Table:
    """Return a segment with its times: in one column, in one for each channel, or stated."""
    clocks = [column for column in table.columns if column.header == _X]
    names = [name for name in names if name != _X]  # not of comments
    channels = [column for column in table.columns if column.header in names]
    unread = {place: why for place, why in table.unread.items() if place in names}
    table = replace(table, columns=tuple(channels), unread=unread)
    if clocks[0].unit != "s":
        return table
    if len(clocks) > 1:
        return replace(table, columns=tuple(map(_on, channels, [each.values for each in clocks])))
    if clocks[0].values is not None:
        return replace(table, columns=(replace(clocks[0], says="time"), *channels))
    starts, steps = (
        [float(value.replace(decimal, ".")) for value in about.get(key, ()) if value]
        for key in ("X0", "Delta_X")
    )
    if len(set(starts)) == len(set(steps)) == 1:
        return replace(table, sample_time=steps[0], start_time=starts[0])
    ticks = np.arange(table.n_samples)
    times = [start + step * ticks for start, step in zip(starts, steps, strict=True)]
    return replace(table, columns=tuple(map(_on, channels, times)))


def _on(column: Column, times: NDArray[np.floating[Any]] | None) -> Column:
    """Return a column with its times, without the blank cells after its end."""
    if column.values is None or times is None:
        return column
    held = np.flatnonzero(np.isfinite(times) & np.isfinite(column.values))
    stop = int(held[-1]) + 1 if held.size else 0
    return replace(column, values=column.values[:stop], times=times[:stop].astype(np.float64))
