"""Text tables: CSV, TSV and similar, with any common separator and decimal mark.

This package writes a plain header of channel names, and all else in a sidecar (see `own`).
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from io import BufferedReader, BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import own
from mckibben.files.cells import MISSING, Dialect, column
from mckibben.files.decoding import decoded
from mckibben.files.instants import may_be_instant
from mckibben.files.labview import labview_segments
from mckibben.files.lines import samples
from mckibben.files.named_values import read_named_values
from mckibben.files.notices import listed, warn
from mckibben.files.sniffing import SEPARATORS, Layout, sniff
from mckibben.files.table import Column, Table

_ARROW = re.compile(rb"(?m)^(\d\d:\d\d:\d\d\.\d+) -> (?=.*?([\t;|,]|$))")  # of Arduino's monitor
_SNIFFED = 2**18  # bytes of a line by which the layout of a table is recognised


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the table of a text file."""
    data = file.read()
    if os.path.lexists(own.sidecar(path)) and (description := _own(data, path)):
        return [description]
    data = decoded(data, path)
    if segments := labview_segments(data):
        return [replace(_table(*segment, path), name=name) for name, segment in segments.items()]
    return [parsed(data, path)]


def laid_out(
    file: BufferedReader, path: Path, header: int, skip: int, encoding: str | None
) -> BufferedReader:
    """Return a text in UTF-8 with the lines before the header and ``skip`` lines after it blanked.

    The others have the same numbers as before. Errors are those of `mckibben.read`.
    """
    data = file.read()
    try:
        data = data if encoding is None else data.decode(encoding).encode()
    except (LookupError, ValueError):
        problem = f"it is no text in {encoding}"
        raise DataError(problem, file=path, parameter="encoding", remedy="choose another") from None
    lines = decoded(data, path).decode().split("\n")
    first = max(header, 1)
    text = "\n".join(
        "" if at < first or first < at <= first + skip else line
        for at, line in enumerate(lines, start=1)
    )
    return BufferedReader(BytesIO(text.encode()))


def _own(data: bytes, path: Path) -> Table | None:
    """Return the table that a sidecar describes, or None if that is not by this package."""
    description = own.described(path)
    if description is None:
        return None
    header = data.partition(b"\n")[0].decode("utf-8", "replace")
    names = next(csv.reader([header]), [])
    if description.sha256 != description.digest(data) or names != description.header:
        raise own.conflict(path)
    frame = _frame(data, Dialect(",", "."), names, skiprows=1, dtype=np.float64)
    return description.table({name: frame[name].to_numpy() for name in names}, path)


def _frame(data: bytes, dialect: Dialect, names: Sequence[Any], **options: Any) -> Any:
    """Return a frame of cells, with decimals read exactly."""
    import pandas as pd

    if [int(part) for part in pd.__version__.split(".")[:2]] < [3, 1]:  # later ones do by default
        options["float_precision"] = "round_trip"
    return pd.read_csv(
        io.BytesIO(data),
        sep=r"\s+" if dialect.separator is None else dialect.separator,
        decimal=dialect.decimal,
        header=None,
        names=list(names),
        index_col=False,
        skipinitialspace=True,
        **options,
    )


def parsed(data: bytes, path: Path, separators: Sequence[str | None] = SEPARATORS) -> Table:
    """Return the table of a text in UTF-8 with line feeds; None in separators is whitespace."""
    separator = re.match(
        rb"\"?sep=([\t;|,])\"?[ \t;|,]*\n", data, re.IGNORECASE
    )  # a line for Excel
    if separator:
        separators = (separator[1].decode(),)
        data = b"\n" + data[separator.end() :]  # so that lines have the same numbers
    if _ARROW.search(data[:_SNIFFED]):
        data = _ARROW.sub(lambda found: found[1] + (found[2] or b" "), data)
    if (found := read_named_values(data)) is not None:
        return _table(*found, path)
    rows = data.split(b"\n")
    start = [row[:_SNIFFED].decode("utf-8", "replace") for row in rows[:400]]
    return _table(rows, sniff(start, path, separators), path)


def _table(rows: Sequence[bytes], layout: Layout, path: Path) -> Table:
    """Return the table of the samples of a text."""
    dialect, headers = layout.dialect, layout.headers
    numbers, lines = samples(rows, layout, path)
    missing = len(headers) - len(dialect.split(lines[0].decode("utf-8", "replace")))
    lines[0] += (dialect.separator or " nan").encode() * missing  # by which pandas counts columns
    frame, texts, read_headers = _frames(b"\n".join(lines).replace("−".encode(), b"-"), layout)
    if len(frame) != len(numbers):  # so that no sample has the number of another line
        raise DataError("its lines are not those of a table", file=path, remedy="export it again")
    decimals: dict[str, str] = {}  # column -> a number that has three digits after the mark, as all

    def made(i: int, name: str, unit: str | None) -> Column:
        cells = frame[i]
        if i in texts or (cells.dtype.kind not in "iufb" and cells.notna().any()):
            cells = texts.get(i, cells)
            made_column, cell = column(name, unit, cells, dialect)
            decimals.update({name: cell} if cell else {})
            return made_column
        values = cells.to_numpy(np.float64) if cells.notna().any() else None
        return Column(name, values, unit, texts=[""] * len(cells) if values is None else ())

    table = _in_columns(made, frame, layout, numbers)
    if decimals and not read_headers:
        _note_decimals(decimals, dialect.decimal, path)
    return table


def _in_columns(
    made: Callable[[int, str, str | None], Column], frame: Any, layout: Layout, numbers: list[int]
) -> Table:
    """Return a table with a column for each one that has a name or samples."""
    named = zip(range(len(layout.headers)), layout.headers, layout.units, strict=True)
    columns = [
        made(i, header or f"column_{i + 1}", unit)
        for i, header, unit in named
        if header or frame[i].notna().any()
    ]
    unread: dict[str, str] = {}
    for signal in columns:
        first = next(filter(None, signal.texts), "")
        if signal.values is None and not may_be_instant(first):
            unread[signal.header] = f"text, such as {first[:40]!r}" if first else "no number in it"
    start, rates = layout.start_time, layout.rates
    return Table(tuple(columns), np.array(numbers), None, start, rates=rates, unread=unread)


def _frames(body: bytes, layout: Layout) -> tuple[Any, Any, bool]:
    """Return the cells of samples, those as text whose mark may be of thousands, and if one is not."""
    options: dict[str, Any] = {"names": range(len(layout.headers)), "na_values": list(MISSING)}
    frame = _frame(body, layout.dialect, low_memory=False, **options)
    marked = [i for i in frame if frame[i].dtype.kind == "f" and frame[i].notna().any()]
    unclear = [i for i in marked if not _shows_decimals(frame[i].to_numpy())]
    if not unclear:
        return frame, {}, bool(marked)
    texts = _frame(body, layout.dialect, dtype=object, usecols=unclear, **options)
    return frame, texts, unclear != marked


def _note_decimals(decimals: Mapping[str, str], mark: str, path: Path) -> None:
    names, cell = listed([repr(name) for name in decimals], 10), next(iter(decimals.values()))
    warn(
        path,
        f"all numbers of column(s) {names} have three digits after the mark {mark!r}, which was taken "
        f"for the decimal mark: {cell} is {float(cell.replace(mark, '.')):.6g}, "
        f"not {cell.replace(mark, '')}",
    )


def _shows_decimals(values: Array) -> bool:
    """Return whether a number's mark is a decimal mark by its value alone.

    By another count of digits after it than three, more than three before it, or a zero there.
    """
    for some in (values[:1000], values):  # the first samples are faster, and mostly enough
        sizes = np.abs(some[some != np.rint(some)])
        steps = 1000 * (sizes % 1)
        if np.any((sizes < 1) | (sizes >= 1000) | (np.abs(steps - np.rint(steps)) > 1e-6)):
            return True
    return False
