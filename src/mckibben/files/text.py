"""Text tables: CSV, TSV and similar, with any common separator and decimal mark.

This package writes a plain header of channel names, and all else in a sidecar (see `own`).
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from io import BufferedReader, BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import own
from mckibben.files.cells import MISSING, Dialect, column
from mckibben.files.headers import is_time
from mckibben.files.instants import may_be_instant
from mckibben.files.notices import listed, warn
from mckibben.files.sniffing import SEPARATORS, Layout, decoded, sniff
from mckibben.files.table import Column, Table

_SNIFFED = 2**18  # bytes by which the layout of a table is recognised


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the table of a text file."""
    data = file.read()
    if os.path.lexists(own.sidecar(path)) and (found := _own(data, path)):
        return [found]
    return [parsed(decoded(data, path), path)]


def laid_out(
    file: BufferedReader, path: Path, header: int, skip: int, encoding: str | None
) -> BufferedReader:
    """Return a text in UTF-8 with the lines before the header and ``skip`` lines after it blanked.

    The others have the same numbers as before. Errors are those of `mckibben.read`.
    """
    try:
        lines = file.read().decode("utf-8" if encoding is None else encoding).splitlines()
    except (LookupError, ValueError):
        problem = f"it is no text in {encoding or 'utf-8'}"
        raise DataError(problem, file=path, parameter="encoding", remedy="choose another") from None
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
    named = re.match(rb"\"?sep=([\t;|,])\"?[ \t;|,]*\n", data, re.IGNORECASE)  # a line for Excel
    if named:
        separators = (named[1].decode(),)
        data = b"\n" + data[named.end() :]  # so that lines have the same numbers
    start = data[:_SNIFFED].decode("utf-8", "replace").split("\n")
    return _table(data, sniff(start[:400], path, separators), path)


def _table(data: bytes, layout: Layout, path: Path) -> Table:
    """Return the table of the samples of a text; lines may end before a last column without header."""
    dialect, headers = layout.dialect, layout.headers
    numbers, body = _samples(data, layout, path)
    options: dict[str, Any] = {"names": range(len(headers)), "na_values": list(MISSING)}
    frame = _frame(body, dialect, low_memory=False, **options)
    if len(frame) != len(numbers):  # so that no sample has the number of another line
        raise DataError("its lines are not those of a table", file=path, remedy="export it again")
    marked = [i for i in frame if frame[i].dtype.kind == "f" and frame[i].notna().any()]
    unclear = [i for i in marked if not _shows_decimals(frame[i].to_numpy())]
    texts = _frame(body, dialect, dtype=object, usecols=unclear, **options) if unclear else {}
    columns: list[Column] = []
    unread: dict[str, str] = {}
    decimals: dict[str, str] = {}  # column -> a number that has three digits after the mark, as all
    for i, (header, unit) in enumerate(zip(headers, layout.units, strict=True)):
        cells, name = frame[i], header or f"column_{i + 1}"
        if i in unclear or (cells.dtype.kind not in "iufb" and cells.notna().any()):
            found, cell = column(name, unit, texts[i] if i in unclear else cells, dialect)
            first = next(filter(None, found.texts), "")
            if found.values is None and not may_be_instant(first):
                unread[name] = f"text, such as {first[:40]!r}"
            if cell:
                decimals[name] = cell
            columns.append(found)
        elif cells.notna().any():
            columns.append(Column(name, cells.to_numpy(np.float64), unit))
        elif header:
            columns.append(Column(name, None, unit, texts=[""]))
            unread[name] = "no number in it"
    if decimals and unclear == marked:
        names, cell = listed([repr(name) for name in decimals], 10), next(iter(decimals.values()))
        mark = dialect.decimal
        warn(
            path,
            f"all numbers of column(s) {names} have three digits after the mark {mark!r}, which was "
            f"taken for the decimal mark: {cell} is {float(cell.replace(mark, '.')):.6g}, "
            f"not {cell.replace(mark, '')}",
        )
    return Table(tuple(columns), lines=np.array(numbers), unread=unread)


def _samples(data: bytes, layout: Layout, path: Path) -> tuple[list[int], bytes]:
    """Return the numbers of the lines of samples and their text, with a cell per header.

    Blank lines, comments, and words or separators alone at the end are left out.
    """
    dialect, headers, rows = layout.dialect, layout.headers, data.split(b"\n")
    separator = (dialect.separator or " ").encode()
    blanks = rb" \v\f" if separator == b"\t" else rb" \t\v\f"
    skipped = re.compile(rb"[%s]*(?:$|%s)" % (blanks, dialect.comment.encode())).match
    start = layout.first
    numbers = [k for k, row in enumerate(rows[start:], start + 1) if not skipped(row)]
    while numbers and not rows[numbers[-1] - 1].strip(b' \t\v\f"' + separator):
        numbers.pop()
    if not numbers:
        remedy = "give a file with samples"
        raise DataError("there is a header and no samples", file=path, remedy=remedy)
    lines = bare = [rows[number - 1] for number in numbers]
    if b'"' in data:
        bare = re.sub(rb'"[^"\n]*"', b"_", b"\n".join(lines)).split(b"\n")
        for number, line in zip(numbers, bare, strict=True):
            if b'"' in line:
                problem, remedy = "a quotation mark is not closed", "write no line breaks in cells"
                raise DataError(problem, file=path, row=number, remedy=remedy)
    if dialect.separator is None:
        counts = np.array([len(line.split()) for line in bare])
    else:
        counts = np.array([line.count(separator) + 1 for line in bare])
    named = re.compile(
        rb"[%s\"]*[A-Za-z\x80-\xff]" % blanks
    ).match  # as "Maximum" behind a blank line
    if not named(lines[0]):
        behind = np.flatnonzero(np.diff(numbers) > 1) + 1
        at = next((int(k) for k in behind if named(lines[k])), len(numbers))
        if at < len(numbers):
            rest = lines[at].decode("utf-8", "replace")
            warn(path, f"from row {numbers[at]} on it is no table, left out: {rest[:60]!r}")
            numbers, lines, counts = numbers[:at], lines[:at], counts[:at]
    wrong = np.flatnonzero((counts > len(headers)) | (counts < len(headers) - (not headers[-1])))
    if wrong.size:
        at = int(wrong[0])
        rest = " ".join(b" ".join(lines[at:]).decode("utf-8", "replace").split())
        if at == 0 or re.search(r"\d", rest, re.ASCII):
            problem = f"there are {counts[at]} cells where the header has {len(headers)}"
            remedy = "complete or delete that line, or give the line of names with `header`"
            raise DataError(problem, file=path, row=numbers[at], remedy=remedy)
        warn(path, f"from row {numbers[at]} on there are words alone, left out: {rest[:60]!r}")
        numbers, lines = numbers[:at], lines[:at]
    if numbers[-1] - numbers[0] >= len(numbers) and not any(map(is_time, headers)):
        warn(path, "blank or commented lines are left out: without times, what follows moves up")
    return numbers, b"\n".join(lines).replace("−".encode(), b"-")


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
