"""Spreadsheets: a sheet as a text table, so that titles, units and headers are found alike."""

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
            text = _text(sheet)
            if text is None:
                continue
            reason = f"one sheet is read: the first with numbers, or sheet in {NAME}"
            others = [] if wanted else [name for name in names if name != sheet.title]
            found = texts.parsed(text, path, ("\t",))
            return [replace(found, unread={**found.unread, **dict.fromkeys(others, reason)})]
    raise DataError(
        "no sheet in it has numbers" if wanted is None else f"sheet {wanted!r} has no numbers",
        file=path,
        remedy="save samples in columns under one line of names",
    )


def _text(sheet: Any) -> bytes | None:
    """Return a sheet as text, a line for each row and tabs between; None where it has no numbers."""
    lines: list[str] = []
    width, numbers = 0, 0
    for row in sheet.iter_rows(values_only=True):
        cells = [_cell(value) for value in row]
        while cells and not cells[-1]:
            cells.pop()
        numbers += sum(isinstance(value, (int, float)) for value in row)
        width = max(width, len(cells))
        lines.append("\t".join(cells))
    if not numbers:
        return None
    rows = (line and line + "\t" * (width - 1 - line.count("\t")) for line in lines)
    return ("\n".join(rows) + "\n").encode()


def _cell(value: object) -> str:
    """Return a cell as the reader of texts takes it; numbers in a form that has no second meaning."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime.timedelta):
        value = value.total_seconds()
    if isinstance(value, int):
        return str(value) if abs(value) < 1e300 else "inf"
    if isinstance(value, float):
        written = repr(value)
        return written if "e" in written or not math.isfinite(value) else f"{written}e0"
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    text = " ".join(str(value).replace('"', "''").split())
    if _DOUBTFUL.fullmatch(text):  # a number that the program took for text, as its mark is another
        return f"{text} (text)"
    return f'"{text}"' if text[:1] in "#%;/" else text  # which begin comments
