"""Spreadsheets: a sheet as a text table, so that titles, units and headers are parsed alike."""

from __future__ import annotations

import datetime
import math
import re
from contextlib import closing
from dataclasses import replace
from io import BufferedReader
from pathlib import Path
from typing import Any

from mckibben.errors import DataError
from mckibben.files import text as texts
from mckibben.files.channels import NAME, about
from mckibben.files.notices import listed
from mckibben.files.table import Table
from mckibben.system.extras import demand

_DOUBTFUL = re.compile(r"[+-]?\d{1,3}[.,]\d{3}", re.ASCII)
"""Text that is a number of thousands to some and one with decimals to others."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the first sheet with numbers, or the one of ``channels.toml``."""
    demand("openpyxl", "xlsx", "spreadsheets", file=path)
    import openpyxl

    wanted = about(path).sheet
    with closing(
        openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)
    ) as book:
        names = [sheet.title for sheet in book.worksheets]
        for sheet in book.worksheets:
            if wanted not in (None, sheet.title):
                continue
            sheet.reset_dimensions()  # which are claims
            if (text := _text(sheet)) is not None:
                found = texts.parsed(text, path, ("\t",))
                reason = f"one sheet is read: the first with numbers, or sheet in {NAME}"
                others = [name for name in names if wanted is None and name != sheet.title]
                return [replace(found, unread={**found.unread, **dict.fromkeys(others, reason)})]
    raise DataError(
        f"there are no numbers in it, in {f'sheet {wanted!r} of ' if wanted else ''}{listed(names)}",
        file=path,
        remedy=f"save samples in columns under one line of names, or correct sheet in {NAME}",
    )


def _text(sheet: Any) -> bytes | None:
    """Return a sheet as text, with a line per row and tabs between; None without numbers."""
    rows = list(sheet.iter_rows(values_only=True))
    if not any(isinstance(value, (int, float)) for row in rows for value in row):
        return None
    lines = ["\t".join(map(_cell, row)).rstrip("\t") for row in rows]
    width = max(line.count("\t") for line in lines)
    filled = (line and line + "\t" * (width - line.count("\t")) for line in lines)
    return ("\n".join(filled) + "\n").encode()


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
