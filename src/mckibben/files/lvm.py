"""LabVIEW measurement files (.lvm): a file header, then segments with headers.

By "LabVIEW Measurement File Format" (NI): a line of a header is a key and its value for each channel.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import BufferedReader
from itertools import zip_longest
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.cells import Dialect
from mckibben.files.sniffing import Layout, decoded
from mckibben.files.table import Column, Table
from mckibben.files.text import block

_END = "***End_of_Header***"
_X = "X_Value"


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the segments of a file, each a table."""
    data = decoded(file.read(), path)
    separator = re.search(rb"^Separator([\t,;])", data, re.MULTILINE)
    mark = re.search(rb"^Decimal_Separator[\t,;]([.,])", data, re.MULTILINE)
    dialect = Dialect(
        separator[1].decode() if separator else "\t", mark[1].decode() if mark else "."
    )
    words = re.finditer(rb"^[A-Za-z*][^\n]*", data, re.MULTILINE)  # no line of samples begins so
    heads = [(data.count(b"\n", 0, m.start()), m[0].decode()) for m in words]
    about: dict[str, Sequence[str]] = {}
    found: list[Table] = []
    n_headers = 0
    for (line, text), stop in zip_longest(heads, [line for line, _ in heads[1:]]):
        key, *values = dialect.split(text)
        if key == _X and n_headers > 1:
            names = [key, *(value or f"Untitled {i}" for i, value in enumerate(values, start=1))]
            names[-1] = names[-1].replace("Comment", "")  # lines may end before what has no name
            labels = list(about.get("Y_Unit_Label", ()))
            if len(labels) <= sum(name not in (_X, "") for name in names):  # of the channels alone
                rest = iter(labels)
                labels = ["" if name == _X else next(rest, "") for name in names][1:]
            units = [unit or None for _, unit in zip_longest(names, ["", *labels][: len(names)])]
            table = block(data, Layout(dialect, names, units, line + 1), path, stop)
            found.append(_timed(table, names, about, dialect.decimal))
        n_headers += key == _END
        about[key] = values
    if not found:
        problem = f"it has no segment of samples after a line {_END}"
        raise DataError(problem, file=path, remedy="export it again from LabVIEW")
    if len(found) == 1:
        return found
    return [replace(table, name=f"{i}") for i, table in enumerate(found, start=1)]


def _timed(
    table: Table, names: Sequence[str], about: Mapping[str, Sequence[str]], decimal: str
) -> Table:
    """Return a segment with its times: in one column, one per channel, or stated."""
    clocks = [column for column in table.columns if column.header == _X]
    names = [name for name in names if name != _X]  # not of comments
    channels = tuple(column for column in table.columns if column.header in names)
    unread = {place: why for place, why in table.unread.items() if place in names}
    table = replace(table, columns=channels, unread=unread)
    if "Time" not in about.get("X_Dimension", ["Time"])[:1]:
        return table
    if len(clocks) == 1 and clocks[0].values is not None:
        return replace(table, columns=(replace(clocks[0], unit="s", says="time"), *channels))
    times: Sequence[Array | None] = [clock.values for clock in clocks]
    if len(clocks) == 1:
        starts, steps = (
            [float(value.replace(decimal, ".")) for value in about.get(key, ()) if value]
            for key in ("X0", "Delta_X")
        )
        if len(set(starts)) == len(set(steps)) == 1:
            return replace(table, sample_time=steps[0], start_time=starts[0])
        grids = zip(starts, steps, strict=True)
        times = [start + step * np.arange(table.n_samples, dtype=float) for start, step in grids]
    return replace(table, columns=tuple(map(_on, channels, times)))


def _on(column: Column, times: Array | None) -> Column:
    """Return a column with its times, without the blank cells after its end."""
    if column.values is None or times is None:
        return column
    held = np.flatnonzero(np.isfinite(times) & np.isfinite(column.values))
    stop = int(held[-1]) + 1 if held.size else 0
    return replace(column, values=column.values[:stop], times=times[:stop])
