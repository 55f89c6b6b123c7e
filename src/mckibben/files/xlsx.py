"""Spreadsheets (.xlsx): the table of one sheet, below titles, names and perhaps units."""

from __future__ import annotations

import datetime
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.errors import DataError
from mckibben.files.channels import NAME, about
from mckibben.files.headers import channel_of, parse, unit_of
from mckibben.files.instants import may_be_instant
from mckibben.files.notices import listed, warn
from mckibben.files.table import Column, Flaw, Table, column
from mckibben.files.units import find
from mckibben.system.extras import demand

_PLAIN = re.compile(
    r"(?![+-]?[1-9]\d{0,2}\.\d{3}$)[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII
)
"""Numbers as text, but for those like 1.000, which is one or a thousand."""

_MARKED = re.compile(r"[+-]?\d*(?:[.,'’ ]\d+)+", re.ASCII)
"""Numbers as text with any marks."""

Row = Sequence[Any]


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the first sheet with numbers, or the one that ``channels.toml`` names."""
    demand("openpyxl", "xlsx", "spreadsheets", file=path)
    import openpyxl

    wanted = about(path).sheet
    with closing(
        openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)
    ) as book:
        names = [sheet.title for sheet in book.worksheets]
        if wanted is not None and wanted not in names:
            raise DataError(
                f"it has no sheet {wanted!r}; there are {listed(names)}",
                file=path,
                remedy=f"correct sheet in {NAME}",
            )
        for sheet in book.worksheets:
            if wanted not in (None, sheet.title):
                continue
            sheet.reset_dimensions()  # which are claims
            rows = [[_cell(value) for value in row] for row in sheet.iter_rows(values_only=True)]
            if not any(map(_numbers, rows)):
                continue
            reason = f"one sheet is read: the first with numbers, or sheet in {NAME}"
            others = [] if wanted else [name for name in names if name != sheet.title]
            return [replace(_table(rows, path), unread=dict.fromkeys(others, reason))]
    raise DataError(
        "no sheet in it has numbers" if wanted is None else f"sheet {wanted!r} has no numbers",
        file=path,
        remedy="give a sheet with a line of names and samples in columns",
    )


def _table(rows: Sequence[Row], path: Path) -> Table:
    headers, units, first = _head(rows)
    lines = [at for at in range(first, len(rows)) if _filled(rows[at])]
    width = max(len(rows[at]) for at in lines)
    if not headers:
        warn(path, f"no line of names: the columns are called column_1 to column_{width}")
    columns = []
    for i in range(max(width, len(headers))):
        cells = [rows[at][i] if i < len(rows[at]) else None for at in lines]
        header = headers[i] if i < len(headers) else None
        if header is not None or _filled(cells):
            unit = units[i].strip("[]() ") if i < len(units) and units[i] else None
            columns.append(_column(header or f"column_{i + 1}", cells, unit or None))
    return Table(tuple(columns), lines=np.array(lines) + 1)


def _head(rows: Sequence[Row]) -> tuple[Row, Row, int]:
    """Return the row of names and that of units, if there are some, and where samples begin.

    Names are the last texts above the first row with more than half as many numbers as most rows have,
    unless they are less than half as many as its cells, as titles are.
    """
    counts = list(map(_numbers, rows))
    usual = Counter(filter(None, counts)).most_common(1)[0][0]
    first = next(at for at, count in enumerate(counts) if 2 * count > usual)
    above = [at for at in range(first) if _filled(rows[at]) and not counts[at]]
    if not above:
        return (), (), 0
    last = above[-1]
    names, units = rows[last - 1] if last - 1 in above else (), rows[last]
    if _filled(names) >= _filled(units) and _are_units(units):
        return names, units, last + 1
    return units if 2 * _filled(units) >= _filled(rows[first]) else (), (), last + 1


def _are_units(row: Row) -> bool:
    """Tell whether at least half of the texts in a row are units, and no names of channels."""
    texts = [text.strip("[]() ") for text in row if text is not None]
    known = (find(text) and unit_of(channel_of(parse(text))) is None for text in texts)
    return 2 * sum(map(bool, known)) >= len(texts)


def _column(header: str, cells: Row, unit: str | None) -> Column:
    filled = [cell for cell in cells if cell is not None]
    instants = sum(isinstance(cell, (np.datetime64, np.timedelta64)) for cell in filled)
    if filled and instants == len(filled) and len({type(cell) for cell in filled}) == 1:
        kind = "datetime64[ns]" if isinstance(filled[0], np.datetime64) else "timedelta64[ns]"
        blank = np.datetime64("NaT") if kind[0] == "d" else np.timedelta64("NaT")
        return column(header, np.array([blank if c is None else c for c in cells], dtype=kind))
    flaw: Flaw | None = None
    values = np.full(len(cells), np.nan)
    numbers = 0
    for k, cell in enumerate(cells):
        text = cell if isinstance(cell, str) else ""
        if isinstance(cell, float) or _PLAIN.fullmatch(text):
            values[k] = float(cell)
            numbers += 1
        elif cell is not None:
            marked = bool(_MARKED.fullmatch(text)) and not may_be_instant(text)
            numbers += marked
            problem = "may mean several numbers" if marked else "is not a number"
            remedy = "correct that cell: a number, not text; or leave it blank and say --gaps split"
            flaw = flaw or Flaw(k, f"{str(cell)[:40]!r} {problem}", remedy)
    if 2 * numbers <= len(filled):
        return Column(header, None, unit, texts=["" if c is None else str(c) for c in cells])
    return Column(header, values, unit, flaw=flaw)


def _cell(value: object) -> float | str | np.datetime64 | np.timedelta64 | None:
    """Return a cell as a number, a text without blanks around it, an instant, or None."""
    if isinstance(value, (bool, int, float)):
        return float(value)
    if isinstance(value, datetime.timedelta):
        return np.timedelta64(value, "ns")
    if isinstance(value, datetime.time):
        clock = datetime.datetime.combine(datetime.date(1970, 1, 1), value)
        return np.datetime64(clock, "ns") - np.datetime64("1970-01-01", "ns")
    if isinstance(value, datetime.date):
        return np.datetime64(value, "ns")
    return " ".join(str(value).split()) or None if value is not None else None


def _filled(row: Row) -> int:
    return sum(cell is not None for cell in row)


def _numbers(row: Row) -> int:
    return sum(cell is not None and not isinstance(cell, str) for cell in row)
