"""Text tables: CSV, TSV and their kin, with any common separator and decimal mark.

This package writes a plain header of channel names, and all else in a sidecar (see `own`).
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import own
from mckibben.files.instants import may_be_instant
from mckibben.files.notices import PLAIN, listed, warn
from mckibben.files.sniffing import (
    GROUPED,
    MISSING,
    NUMBER,
    SEPARATORS,
    Dialect,
    Layout,
    decoded,
    sniff,
)
from mckibben.files.table import Column, Flaw, Table
from mckibben.recording import Recording
from mckibben.system.atomic import replacing
from mckibben.system.manifest import digest
from mckibben.system.ordinary import DESCRIPTION, read_bytes

_SNIFFED, _SNIFFED_BYTES = 400, 2**18  # by which a table is recognised, but 4 lines at least
_NAMED = re.compile(rb"\A\"?sep=([\t;|,])\"?[ \t;|,]*\n", re.IGNORECASE)
"""A first line that names the separator to Excel."""

_MARKS = (
    "write numbers without marks between thousands, with one decimal mark in the whole file, and "
    "whole numbers with it too, such as 2.0 for 2"
)
_KINDS = {
    "(hexadecimal)": re.compile(r"[+-]?0[xX][0-9a-fA-F]+"),
    "(grouped)": GROUPED,
    "(missing)": re.compile(""),
    "(text)": re.compile(".*", re.DOTALL),
}
"""Kinds of cells that are no plain numbers, and have no unit."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the table of a text file."""
    data = file.read()
    table = _own(data, path) if os.path.lexists(own.sidecar(path)) else None
    return [table or parsed(decoded(data, path), path)]


def write(recording: Recording, path: Path) -> None:
    """Write a recording as text, and its description beside it."""
    import pandas as pd

    # 1.38, not 1.3800000000000001: the description has the exact step
    time = {} if recording.sample_time is None else {"time": recording.time.round(12)}
    columns = {**time, **recording.channels}
    separator = "\t" if path.suffix.casefold() == ".tsv" else ","
    data = pd.DataFrame(columns).to_csv(index=False, sep=separator, lineterminator="\n").encode()
    description = own.describe(recording, data, path) + "\n"
    with replacing(path) as new:
        new.write_bytes(data)
    with replacing(own.sidecar(path)) as new:
        new.write_text(description, encoding="utf-8")


def _own(data: bytes, path: Path) -> Table | None:
    """Return the table that the description beside a file is of, or None with a note."""
    header = data.partition(b"\n")[0].decode("utf-8", "replace")
    try:
        description = own.parse(read_bytes(own.sidecar(path), most=DESCRIPTION))
    except DataError as error:
        description = error.problem
    if isinstance(description, str):
        problem = f"is not a description by this package ({description})"
    elif description.sha256 != digest(data):
        problem = "describes another version of the file"
    else:
        names = [*([] if description.sample_time is None else ["time"]), *description.units]
        for separator in "\t,":
            if next(csv.reader([header], delimiter=separator), []) == names:
                frame = _frame(data, Dialect(separator, "."), names, skiprows=1, dtype=np.float64)
                return description.table({name: frame[name].to_numpy() for name in names})
        problem = "names other columns than the file"
    warn(own.sidecar(path), f"it {problem}; it is ignored, and units are taken from the header")
    return None


def _frame(data: bytes, dialect: Dialect, names: Sequence[Any], **options: Any) -> Any:
    """Return a frame of cells, all decimals read to the last bit."""
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
    """Return the table in a text in UTF-8, whose lines line feeds end; None in separators is blanks."""
    named = _NAMED.match(data)
    if named:
        separators = (named[1].decode(),)
        data = b"\n" + data[named.end() :]  # so that lines have the same numbers
    start = data[: 4 * _SNIFFED_BYTES].decode("utf-8", "replace").split("\n")
    start = start[: max(4, data.count(b"\n", 0, _SNIFFED_BYTES))][:_SNIFFED]
    layout = sniff(start, separators)
    if layout is None:
        problem, remedy = "there is nothing in it", "give a file with a header and samples"
        raise DataError(problem, file=path, remedy=remedy)
    if not layout.headers:
        warn(path, f"no line of names: the columns are called column_1 to column_{layout.width}")
    return block(data, layout, path)


def block(data: bytes, layout: Layout, path: Path, stop: int | None = None) -> Table:
    """Return the table of the samples of a text, from the line where they begin on.

    Parameters
    ----------
    data : bytes
        UTF-8.
    layout : Layout
        Where the last column has no header, lines may end before it.
    path : Path
    stop : int, optional
        The line, counted from 0, before which they end.
    """
    headers = layout.headers or [f"column_{i}" for i in range(1, layout.width + 1)]
    dialect, places = layout.dialect, range(len(headers))
    numbers, lines = _samples(data, layout, headers, path, stop)
    body = b"\n".join(lines).replace("−".encode(), b"-")
    frame = _frame(body, dialect, places, na_values=list(MISSING), low_memory=False)
    if len(frame) != len(numbers):  # so that no sample has the number of another line
        raise DataError("its lines are not those of a table", file=path, remedy="export it again")
    doubts = _doubts(frame, body, dialect)
    columns: list[Column] = []
    unread: dict[str, str] = {}
    decimals: dict[str, str] = {}  # column -> a number that has three digits after the mark, as all
    shown = False
    for i, unit in zip(places, layout.units or [None] * len(headers), strict=True):
        cells, name = frame[i], headers[i] or f"column_{i + 1}"
        if cells.isna().all():
            if headers[i]:
                columns.append(Column(name, None, unit, texts=[""]))
                unread[name] = "no number in it"
        elif cells.dtype.kind in "iufb":
            values, flaw = cells.to_numpy(np.float64), None
            if i in doubts:
                at, all_marked = doubts[i]
                cell = dialect.split(lines[at].decode("utf-8", "replace"))[i]
                if all_marked:
                    decimals[name] = cell
                else:
                    whole = re.sub("[.,]", "", cell)
                    problem = (
                        f"in column {name!r}, {cell!r} may be a number with decimals or {whole}, "
                        "since others in it have no mark"
                    )
                    values, flaw = np.full(values.size, np.nan), Flaw(at, problem, _MARKS)
            else:
                shown |= bool(np.any(np.isfinite(values) & (values != np.rint(values))))
            columns.append(Column(name, values, unit, flaw=flaw))
        else:
            columns.append(_irregular(name, unit, cells, dialect))
            first = next(filter(None, columns[-1].texts), "")
            if columns[-1].values is None and not may_be_instant(first):
                unread[name] = f"text, such as {first[:40]!r}"
    if decimals:
        names, cell = listed([repr(name) for name in decimals], 10), next(iter(decimals.values()))
        mark = dialect.decimal
        warn(
            path,
            f"all numbers of column(s) {names} have three digits after the mark {mark!r}, which was "
            f"taken for the decimal mark: {cell} is {float(cell.replace(mark, '.')):.6g}, "
            f"not {cell.replace(mark, '')}{PLAIN if shown else ''}",
        )
    return Table(tuple(columns), lines=np.array(numbers), unread=unread)


def _samples(
    data: bytes, layout: Layout, headers: Sequence[str], path: Path, stop: int | None
) -> tuple[list[int], list[bytes]]:
    """Return the numbers and texts of the lines of samples, each with a cell for each header.

    Blank lines, comments, and words or separators alone at the end are left out.
    """
    dialect, rows = layout.dialect, data.split(b"\n")[:stop]
    blanks = b" \v\f" if dialect.separator == "\t" else b" \t\v\f"
    numbers = [
        number
        for number, row in enumerate(rows[layout.first :], layout.first + 1)
        if (sign := row.lstrip(blanks)[:1]) not in b"#%/;"  # as nothing is, too
        or (sign and not dialect.is_comment(row.decode("utf-8", "replace")))
    ]
    nothing = b' \t\v\f"' + (dialect.separator or "").encode()
    while numbers and not rows[numbers[-1] - 1].strip(nothing):
        numbers.pop()
    if not numbers:
        remedy = "give a file with samples"
        raise DataError("there is a header and no samples", file=path, remedy=remedy)
    lines = [rows[number - 1] for number in numbers]
    bare = lines  # without quoted cells
    if b'"' in data:
        bare = [re.sub(rb'"[^"]*"', b"_", line) if b'"' in line else line for line in lines]
        for number, line in zip(numbers, bare, strict=True):
            if b'"' in line:
                remedy = "close it, and write no line breaks in cells"
                problem = "a quotation mark is not closed"
                raise DataError(problem, file=path, row=number, remedy=remedy)
    if dialect.separator is None:
        counts = np.array([len(line.split()) for line in bare])
    else:
        separator = dialect.separator.encode()
        counts = np.array([line.count(separator) + 1 for line in bare])
    wrong = np.flatnonzero((counts > len(headers)) | (counts < len(headers) - (not headers[-1])))
    if wrong.size:
        at = int(wrong[0])
        if at == 0 or re.search(rb"\d", b"".join(lines[at:])):
            raise DataError(
                f"there are {counts[at]} cells where the header has {len(headers)}",
                file=path,
                row=numbers[at],
                remedy="complete or delete that line",
            )
        words = " ".join(b" ".join(lines[at:]).decode("utf-8", "replace").split())[:60]
        warn(path, f"from row {numbers[at]} on there are words alone, left out: {words!r}")
        return numbers[:at], lines[:at]
    return numbers, lines


def _doubts(frame: Any, data: bytes, dialect: Dialect) -> dict[int, tuple[int, bool]]:
    """Return the columns whose mark may be of thousands, as no number shows that it is for decimals.

    "1,000" is a thousand to some and one to others. A mark is for decimals where a number shows it: by
    another count of digits after it than three, more than three before it, or a zero there.

    Returned are the first such sample, counted from 0, and whether all are: then they are decimals.
    """
    import pandas as pd

    columns = {i: frame[i].to_numpy() for i in frame if frame[i].dtype.kind == "f"}
    firsts = (1000, None)  # the first samples alone are faster, and mostly enough
    doubted = [
        i for i, each in columns.items() if not any(_shows_decimals(each[:n]) for n in firsts)
    ]
    if not doubted:
        return {}
    # a 9 in place of the mark: 1,125 is 19125, and only what has three digits there is 1e4 + 9125
    nines = data.replace(dialect.decimal.encode(), b"9")
    digits = _frame(nines, dialect, frame.columns, na_values=list(MISSING), usecols=doubted)
    digits = digits.apply(pd.to_numeric, errors="coerce").abs()
    found = {}
    for i in doubted:
        values = np.abs(columns[i])
        number, small = np.isfinite(values), np.where(values < 1000, values, 0)
        whole = np.floor(small)
        marked = number & (digits[i].to_numpy() != values)
        alike = digits[i] == 1e4 * whole + 9000 + np.rint(1000 * (small - whole))
        alike &= whole >= 1
        if marked.any() and alike[marked].all():
            found[i] = int(np.argmax(marked)), bool(marked[number].all())
    return found


def _shows_decimals(values: Array) -> bool:
    """Return whether a number shows by its value alone that its mark is for decimals."""
    sizes = np.abs(values[values != np.rint(values)])
    steps = 1000 * (sizes % 1)
    return bool(np.any((sizes < 1) | (sizes >= 1000) | (np.abs(steps - np.rint(steps)) > 1e-6)))


def _irregular(name: str, unit: str | None, cells: Any, dialect: Dialect) -> Column:
    """Return a column of which some cells are no plain numbers."""
    import pandas as pd

    codes, found = pd.factorize(cells)  # -1 is for cells that are missing
    words = [*(str(word).strip() for word in found), ""]
    form = rf"(?![+-]?0[xX])({NUMBER[dialect.decimal]})\s*([A-Za-z°%µμΩ]\D*\d?)?"
    number = re.compile(form, re.ASCII)  # with a unit or without
    parts = [number.fullmatch(word) for word in words]
    if may_be_instant(words[0]) and not parts[0]:
        return Column(name, None, unit, texts=[words[code] for code in codes])
    kinds = np.array(
        [
            (part[2] or "") if part else next(k for k, f in _KINDS.items() if f.fullmatch(word))
            for word, part in zip(words, parts, strict=True)
        ]
    )[codes]
    filled = kinds != "(missing)"
    counts = pd.Series(kinds[filled]).value_counts()
    numbers = counts.drop("(text)", errors="ignore")
    if 2 * numbers.sum() <= counts.sum():
        return Column(name, None, unit, texts=[words[code] for code in codes[:5]])
    usual = str(numbers.index[0])
    united = usual[:1] not in ("", "(")
    usual = unit or usual if united else usual
    wrong, remedy = kinds == "(grouped)", _MARKS
    problem = "may mean several numbers"
    if not wrong.any():
        wrong, problem = filled & (kinds != usual), "is not a number like the others"
        remedy = "correct that cell, or leave it blank and use --gaps split or interpolate"
    if wrong.any():
        at = int(np.argmax(wrong))
        flaw = Flaw(at, f"{words[codes[at]][:40]!r} {problem}", remedy)
        return Column(name, np.full(codes.size, np.nan), unit, flaw=flaw)
    values = [
        float(part[1].replace(dialect.decimal, ".")) if part else int(word, 16) if word else np.nan
        for word, part in zip(words, parts, strict=True)
    ]
    return Column(name, np.array(values, dtype=np.float64)[codes], usual if united else unit)
