"""Spreadsheets: a sheet as a text table, so that titles, units and headers are parsed alike."""

from __future__ import annotations

import datetime
import math
import re
from contextlib import closing, suppress
from dataclasses import replace
from io import BufferedReader
from pathlib import Path
from typing import Any

from mckibben.errors import DataError
from mckibben.files import text as texts
from mckibben.files.channels import about
from mckibben.files.notices import listed
from mckibben.files.table import Table
from mckibben.system.extras import demand

_DOUBTFUL = re.compile(r"[+-]?\d{1,3}\.\d{3}", re.ASCII)
"""Text that is a number of thousands to some and one with decimals to others."""

_NUMBER = re.compile(r"[-+.]?\d")


def read(file: BufferedReader, path: Path, sheet: str | None = None) -> list[Table]:
    """Read a sheet: by default the one of ``channels.toml``, or that with the most rows of numbers.

    Sheets with the same columns as the latter are recordings, too.

    Raises
    ------
    DataError
        If it is not there, or has no numbers.
    """
    wanted = sheet or about(path).sheet
    with _opened(file, path) as book:
        names = [one.title for one in book.worksheets]
        if wanted is not None and wanted not in names:
            problem, remedy = f"there is no sheet {wanted!r}", f"name one of {listed(names)}"
            raise DataError(problem, file=path, parameter="sheet", remedy=remedy)
        texts_of = {one.title: _text(one) for one in book.worksheets if wanted in (None, one.title)}
    name = max(texts_of, key=lambda name: texts_of[name][1:])
    text, _, n_numbers = texts_of[name]
    if not n_numbers:
        raise DataError(
            f"there are no numbers in {listed(list(texts_of))}",
            file=path,
            remedy="save samples in columns under one line of names, or name a `sheet` with numbers",
        )
    tables_by_sheet = {name: texts.parsed(text, path, ("\t",))}
    headers = _headers(tables_by_sheet[name])
    for other, (text, _, n_numbers) in texts_of.items():
        with suppress(DataError):  # of a sheet that is no table
            one = texts.parsed(text, path, ("\t",)) if other != name and n_numbers else None
            if one is not None and _headers(one) == headers:
                tables_by_sheet[other] = one
    reason = f"one sheet is read, {name!r}: the one with most rows of numbers, or `sheet`"
    unread = dict.fromkeys((other for other in names if other not in tables_by_sheet), reason)
    return [
        replace(
            tables_by_sheet[one],
            unread={**tables_by_sheet[one].unread, **unread},
            name=one if len(tables_by_sheet) > 1 else None,
        )
        for one in names
        if one in tables_by_sheet
    ]


def _headers(table: Table) -> list[str]:
    return [column.header for column in table.columns]


def sheets(path: Path) -> list[str]:
    """Return the names of the sheets of a spreadsheet."""
    with path.open("rb") as file, _opened(file, path) as book:
        return [worksheet.title for worksheet in book.worksheets]


def _opened(file: BufferedReader, path: Path) -> Any:
    """Return the values of a spreadsheet, as a context."""
    demand("openpyxl", "xlsx", "spreadsheets", file=path)
    import openpyxl

    return closing(openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False))


def _text(sheet: Any) -> tuple[bytes, int, int]:
    """Return a sheet as text, a line per row and tabs between; its rows of numbers; and all numbers."""
    sheet.reset_dimensions()  # which are claims
    rows = [[_cell(value) for value in row] for row in sheet.iter_rows(values_only=True)]
    numbers = [sum(_NUMBER.match(cell) is not None for cell in row) for row in rows]
    filled = [sum(map(bool, row)) for row in rows]
    of_numbers = sum(2 * n > m for n, m in zip(numbers, filled, strict=True))
    lines = ["\t".join(row).rstrip("\t") for row in rows]
    width = max((line.count("\t") for line in lines), default=0)
    lines = [line and line + "\t" * (width - line.count("\t")) for line in lines]
    return ("\n".join(lines) + "\n").encode(), of_numbers, sum(numbers)


def _cell(value: object) -> str:
    """Return a cell as text for the table reader; numbers in an unambiguous form."""
    if value is None:
        return ""
    if isinstance(value, datetime.timedelta):
        value = value.total_seconds()
    if isinstance(value, int):  # also a bool
        return str(int(value)) if abs(value) < 1e300 else "inf"
    if isinstance(value, float):
        written = repr(value)
        return written if "e" in written or not math.isfinite(value) else f"{written}e0"
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    text = " ".join(str(value).replace('"', "''").split())
    if _DOUBTFUL.fullmatch(text):  # a number that the program took for text, as its mark is another
        return f"{text} (text)"
    return f'"{text}"' if text[:1] in "#%;/" else text  # which begin comments
