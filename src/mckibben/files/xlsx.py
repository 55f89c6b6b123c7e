"""Spreadsheets (.xlsx): one sheet, its rows read as the lines of a text would be.

OpenPyXL gives a sheet row by row; libraries that give it at once make room for all cells between the
first and the last one, which two cells of a damaged file can put a thousand million apart.
"""

from __future__ import annotations

import datetime
import math
import zipfile
from collections import Counter
from collections.abc import Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any

from mckibben.errors import DataError
from mckibben.files import delimited
from mckibben.files.channels import NAME, about
from mckibben.files.limits import MOST_PARTS, Budget
from mckibben.files.notices import warn
from mckibben.files.table import Table
from mckibben.system.extras import demand

MOST_ROWS = 2**20
"""Rows of a sheet, as in the program itself."""

MOST_UNPACKED = 2**29
"""Bytes of all sheets together."""

_PER_BYTE = 200
"""Bytes unpacked from one: sheets have some ten."""

_FREE = 2**24
_PIECE = 2**20
_LOOKED_AT = 200  # rows from which the table's width is told


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the first sheet with numbers, or the one that ``channels.toml`` names."""
    demand("openpyxl", "xlsx", "spreadsheets", file=path)
    import openpyxl

    _look(file)
    budget = Budget(file, path)
    wanted = about(path).sheet
    book = openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)
    names = [sheet.title for sheet in book.worksheets]
    if wanted is not None and wanted not in names:
        raise DataError(
            f"it has no sheet {wanted!r}; there are {', '.join(names[:30])}",
            file=path,
            remedy=f"correct sheet in {NAME}",
        )
    for sheet in book.worksheets:
        if wanted not in (None, sheet.title):
            continue
        sheet.reset_dimensions()  # which are claims
        text = _text(sheet, budget, path)
        if text is None:
            continue
        if wanted is None and len(names) > 1:
            others = ", ".join(repr(name) for name in names[:30] if name != sheet.title)
            warn(
                path,
                f"sheet {sheet.title!r}, the first with numbers, was read, and not {others}; "
                f"say sheet in {NAME} where that is wrong",
            )
        return [delimited.parsed(text, ("\t",), budget, path)]
    raise DataError(
        "no sheet in it has numbers" if wanted is None else f"sheet {wanted!r} has no numbers",
        file=path,
        remedy="give a sheet with a line of names and samples in columns",
    )


def _look(file: BufferedReader) -> None:
    """Refuse parts that unpack to more than is read, or than they say."""
    with zipfile.ZipFile(file) as parts:
        infos = parts.infolist()
        size = file.seek(0, 2)
        if len(infos) > MOST_PARTS:
            raise ValueError("it has too many parts")
        if sum(info.file_size for info in infos) > min(MOST_UNPACKED, max(_FREE, _PER_BYTE * size)):
            raise ValueError("it unpacks to more than is read")
        for info in infos:
            with parts.open(info) as part:
                while part.read(_PIECE):
                    pass
    file.seek(0)


def _text(sheet: Any, budget: Budget, path: Path) -> bytes | None:
    """Return a sheet as text, a line for each row and tabs between; None where it has no numbers."""
    lines: list[str] = []
    filled: list[int] = []
    width, numbers = 0, 0
    for row in sheet.iter_rows(values_only=True):
        if len(lines) >= MOST_ROWS or len(row) > delimited.MOST_COLUMNS:
            raise DataError(
                f"sheet {sheet.title!r} goes on beyond row {MOST_ROWS} or column "
                f"{delimited.MOST_COLUMNS}",
                file=path,
                row=len(lines) + 1,
                remedy="delete what is not needed there, or save the table as CSV",
            )
        cells = [_cell(value) for value in row]
        while cells and not cells[-1]:
            cells.pop()
        budget.samples(len(cells))
        numbers += sum(isinstance(value, (int, float)) for value in row)
        width = max(width, len(cells))
        lines.append("\t".join(cells))
        if len(filled) < _LOOKED_AT:
            filled.append(sum(map(bool, cells)))
    if not numbers:
        return None
    titles = _titles(filled)
    heads = (f"# {line}".replace("\t", " ") for line in lines[:titles])
    rows = (line and line + "\t" * (width - 1 - line.count("\t")) for line in lines[titles:])
    return ("\n".join((*heads, *rows)) + "\n").encode()


def _titles(filled: Sequence[int]) -> int:
    """Return how many rows stand before the table: of half as many cells as its rows, or less."""
    usual = Counter(n for n in filled if n).most_common(1)
    return next((at for at, n in enumerate(filled) if 2 * n > usual[0][0]), 0) if usual else 0


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
    return f'"{text}"' if text[:1] in "#%" else text  # which begin comments
