"""Text tables: CSV, TSV and their kin, with any common separator and decimal mark.

What this package writes is a plain header of channel names and, beside the file, a sidecar
``NAME.csv-metadata.json`` (named as in W3C's "CSV on the Web") with units, time grid and meta.
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

from mckibben.errors import DataError
from mckibben.files import stored
from mckibben.files.cells import Cells
from mckibben.files.dialect import SEPARATORS, Dialect, detect
from mckibben.files.limits import Budget
from mckibben.files.lines import Lines
from mckibben.files.marks import Doubt, doubts
from mckibben.files.notices import PLAIN, warn
from mckibben.files.stored import Stored
from mckibben.files.table import Column, Table
from mckibben.recording import Recording
from mckibben.system.atomic import replacing
from mckibben.system.manifest import digest
from mckibben.system.ordinary import DESCRIPTION, read_bytes

MOST_COLUMNS = 4096
_CONTROL = bytes([*range(0x09), *range(0x0E, 0x20), 0x7F])
_MARKS = re.compile(rb"\A(?:\xef\xbb\xbf)+")
"""Of UTF-8; a program that puts one there may find another."""
_SAID = re.compile(rb"\A\"?sep=([\t;|,])\"?[ \t;|,]*\n", re.IGNORECASE)
"""A first line that tells Excel of the separator."""
_PART = 200_000  # cells that are read at once
_LISTED = 10


def sidecar(path: Path) -> Path:
    """Return where the description of a text file lies.

    >>> sidecar(Path("run.csv")).name
    'run.csv-metadata.json'
    """
    return path.with_name(f"{path.name}-metadata.json")


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the one table of a text file."""
    data = file.read()
    description = _described(path, data)
    if description is not None:
        return [_own(data, description)]
    data, separators = _said(_utf8(data, path))
    return [parsed(data, separators, Budget(file, path), path)]


def write(recording: Recording, path: Path) -> None:
    """Write a recording as text, and its description beside it."""
    # 1.38, not 1.3800000000000001: the description has the exact step
    time = {} if recording.sample_time is None else {"time": recording.time.round(12)}
    columns = {**time, **recording.channels}
    separator = "\t" if path.suffix.casefold() == ".tsv" else ","
    text = io.StringIO()
    csv.writer(text, delimiter=separator, lineterminator="\n").writerow(columns)
    row = separator.join(["%r"] * len(columns)) + "\n"
    text.writelines(
        row % cells for cells in zip(*map(np.ndarray.tolist, columns.values()), strict=True)
    )
    data = text.getvalue().encode()
    description = Stored.describe(recording, data, path).to_json(path) + "\n"
    with replacing(path) as new:
        new.write_bytes(data)
    with replacing(sidecar(path)) as new:
        new.write_text(description, encoding="utf-8")


def _described(path: Path, data: bytes) -> Stored | None:
    """Return the sidecar's description, if there is one and it is of these bytes."""
    beside = sidecar(path)
    if not os.path.lexists(beside):
        return None
    try:
        description = stored.parse(read_bytes(beside, most=DESCRIPTION))
    except DataError as error:
        description = error.problem
    if isinstance(description, str):
        problem = f"is not a description by this package ({description})"
    elif description.sha256 != digest(data):
        problem = "describes another version of the file"
    elif all(
        next(csv.reader([_header(data)], delimiter=mark), []) != _columns_of(description)
        for mark in "\t,"
    ):
        problem = "names other columns than the file"
    else:
        return description
    warn(beside, f"it {problem}; it is ignored, and units are taken from the header")
    return None


def _header(data: bytes) -> str:
    return data.partition(b"\n")[0].decode("utf-8", "replace")


def _separator(data: bytes) -> str:
    return "\t" if "\t" in _header(data) else ","


def _columns_of(description: Stored) -> list[str]:
    return [*([] if description.sample_time is None else ["time"]), *description.units]


def _own(data: bytes, description: Stored) -> Table:
    import pandas as pd

    frame = pd.read_csv(
        io.BytesIO(data),
        sep=_separator(data),
        skiprows=1,
        header=None,
        names=_columns_of(description),
        index_col=False,
        dtype=np.float64,
        **_exact(pd.__version__),
    )
    return description.table({name: frame[name].to_numpy() for name in description.units})


def _utf8(data: bytes, path: Path) -> bytes:
    """Return the text in UTF-8, its lines ended by line feeds."""
    try:
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            data = data.decode("utf-16").encode()
        elif not data.isascii():
            data.decode("utf-8")
    except UnicodeDecodeError:
        data = data.decode("latin-1").encode()
    data = _MARKS.sub(b"", data, count=1).rstrip(b"\x1a")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if len(data.translate(None, _CONTROL)) < len(data):
        raise DataError(
            "this is not text",
            file=path,
            remedy="give the file the ending of its format, or export it as CSV",
        )
    return data


def _said(data: bytes) -> tuple[bytes, Sequence[str | None]]:
    """Return a text without a first line that tells of the separator, and those there may be."""
    said = _SAID.match(data)
    if said is None:
        return data, SEPARATORS
    # the lines keep their numbers
    return b" " * (said.end() - 1) + data[said.end() - 1 :], (said[1].decode(),)


def parsed(data: bytes, separators: Sequence[str | None], budget: Budget, path: Path) -> Table:
    """Return the table in a text in UTF-8, whose lines line feeds end.

    Parameters
    ----------
    data : bytes
    separators : sequence of str or None
        What may stand between its cells; None is blanks.
    budget : Budget
    path : Path
    """
    lines, comment = Lines.of(data, path)
    dialect = detect(lines.sample(), separators)
    headers, units, first = _head(lines.sample(), comment, dialect, path)
    if len(headers) > MOST_COLUMNS:
        raise DataError(
            f"{len(headers)} columns are more than the {MOST_COLUMNS} that are read",
            file=path,
            remedy="save the channels needed alone, each as one column",
        )
    lines = lines.after(first)
    if not len(lines):
        raise DataError(
            "there is a header and no samples", file=path, remedy="give a file with samples"
        )
    budget.samples(len(headers) * len(lines))
    _refuse_ragged(lines, len(headers), dialect, path)
    return Table(_columns(lines, headers, units, dialect, path), lines=lines.numbers)


def _head(
    lines: list[str], comment: str, dialect: Dialect, path: Path
) -> tuple[list[str], list[str | None], int]:
    """Return the headers, the units of a line of units, and where the samples begin."""
    cells = dialect.split(lines[0])
    none: list[str | None] = [None] * len(cells)
    if 2 * sum(map(dialect.is_number, cells)) >= len(cells):
        described = dialect.split_header(comment, len(cells))
        if len(described) == len(cells):
            return described, none, 0
        warn(path, f"no line of names: the columns are called column_1 to column_{len(cells)}")
        return [f"column_{i}" for i in range(1, len(cells) + 1)], none, 0
    following = [dialect.split(line) for line in lines[1:3]]
    n_columns = len(following[0]) if following else len(cells)
    headers = dialect.split_header(lines[0], n_columns)
    if len(following) == 2 and not any(map(dialect.is_number, following[0])):
        looks_like_units = any(map(dialect.is_number, following[1]))
        if looks_like_units and len(following[0]) == len(headers):
            return headers, [cell.strip("[]() ") or None for cell in following[0]], 2
    return headers, [None] * len(headers), 1


def _refuse_ragged(lines: Lines, expected: int, dialect: Dialect, path: Path) -> None:
    found = lines.counted(dialect.separator)
    for at in lines.quoted:
        found[at] = len(dialect.split(lines.text(at)))
    wrong = np.flatnonzero(found != expected)
    if wrong.size:
        raise DataError(
            f"there are {found[wrong[0]]} cells where the header has {expected}",
            file=path,
            row=int(lines.numbers[wrong[0]]),
            remedy="complete or delete that line",
        )


def _columns(
    lines: Lines, headers: list[str], units: list[str | None], dialect: Dialect, path: Path
) -> tuple[Column, ...]:
    import pandas as pd

    columns = [Cells(header, unit, dialect) for header, unit in zip(headers, units, strict=True)]
    with pd.read_csv(
        lines.source(),
        sep=r"\s+" if dialect.separator is None else dialect.separator,
        decimal=dialect.decimal,
        header=None,
        names=range(len(headers)),
        index_col=False,
        skipinitialspace=True,
        **_exact(pd.__version__),
        low_memory=False,
        chunksize=max(_PART // len(headers), 1),  # bounds the memory that text takes
    ) as parts:
        for part in parts:
            for i, cells in enumerate(columns):
                cells.take(part[i])
    asked = [i for i, cells in enumerate(columns) if cells.may_be_doubted()]
    doubted = doubts(
        asked,
        [cells.n_finite for cells in columns],
        lines,
        dialect,
    )
    _say_understood(columns, doubted, dialect.decimal, path)
    found = (cells.column(i, doubted.get(i)) for i, cells in enumerate(columns))
    return tuple(column for column in found if column is not None)


def _say_understood(columns: list[Cells], doubted: dict[int, Doubt], mark: str, path: Path) -> None:
    """Say which columns have decimals though all their numbers could be of thousands."""
    listed = [i for i, doubt in doubted.items() if doubt.everywhere]
    if not listed:
        return
    names = ", ".join(repr(columns[i].header) for i in listed[:_LISTED])
    more = f" and {len(listed) - _LISTED} more" if len(listed) > _LISTED else ""
    cell = doubted[listed[0]].cell
    shown = any(cells.has_fractions() for i, cells in enumerate(columns) if i not in doubted)
    warn(
        path,
        f"all numbers of column(s) {names}{more} have three digits after the mark {mark!r}, which was "
        f"taken for the decimal mark: {cell} is {float(cell.replace(mark, '.')):.6g}, "
        f"not {cell.replace(mark, '')}{PLAIN if shown else ''}",
    )


def _exact(version: str) -> dict[str, Any]:
    """Return what makes pandas read decimals to the last bit, as it does unasked since 3.1."""
    major, minor = version.split(".")[:2]
    return {} if (int(major), int(minor)) >= (3, 1) else {"float_precision": "round_trip"}
