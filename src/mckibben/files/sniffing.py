"""What a text table looks like by its first lines: encoding, separator, decimal mark, header, units."""

from __future__ import annotations

import csv
import re
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mckibben.errors import DataError
from mckibben.files.headers import foreign_words, is_standard
from mckibben.files.instants import may_be_instant
from mckibben.files.notices import warn
from mckibben.files.units import find, find_listed

SEPARATORS = ("\t", ";", "|", ",", None)
"""In the order in which they are preferred where a file can be read in two ways; None is blanks."""

MISSING = (
    *("-", "--", "---", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None"),
    *("∞", "+∞", "-∞", "OL", "OVLD"),
)
"""Cells of samples that were not taken, or are beyond the instrument's range."""

NUMBER = {
    mark: rf"[+-]?(?:\d+(?:{re.escape(mark)}\d*)?|{re.escape(mark)}\d+)(?:[eE][+-]?\d+)?"
    for mark in ".,"
}
"""Decimal mark -> what a number looks like."""

COMMENT = re.compile(r"\s*(?:#(?!N/?A\b|DIV/0|VALUE!|REF!|NUM!|NAME\?|NULL!)|%|//|;)[\s#%/;]*")
"""What begins a comment; not the errors of spreadsheets, and a semicolon not where it separates."""

GROUPED = re.compile(
    r"[+-]?\d{1,3}(?P<mark>[.,'’`_ \xa0\u2009\u202f])(?:\d{2,3}(?P=mark))*\d{3}(?:[.,]\d*)?"
    r"|[+-]?\d*[.,]\d+",  # a number with the other decimal mark
    re.ASCII,
)
"""A number that may mean several: with marks between thousands, or another decimal mark."""

_ENCODINGS = ("cp1252", "cp932", "gb18030", "cp949", "latin-1")
_UNIT = r"(?:\s*[A-Za-z°%µμΩ][^\s\d,;:]{0,7})?"
_SPACED = r"[+-]?\d{1,3}(?: \d{3})+(?:[.,]\d*)?"  # refused later, but one cell where it can be
_LIKE = {
    mark: re.compile(rf"{form}{_UNIT}|{_SPACED}|0[xX][0-9a-fA-F]+", re.ASCII)
    for mark, form in NUMBER.items()
}
_WITH_BRACKETS = re.compile(r"\S+(?:\s*[\[(][^\])]*[\])]+)?")
_CONTROL = bytes([*range(0x09), *range(0x0E, 0x20), 0x7F])
_LOOKED_AT = 2**16


@dataclass(frozen=True)
class Dialect:
    """How lines are cut into cells and numbers written."""

    separator: str | None
    decimal: str

    def split(self, line: str, width: int = 0) -> list[str]:
        """Return the cells of a line; of a header between blanks, so many if it can be."""
        if '"' in line:
            line = line if self.separator else line.replace("\t", " ").strip()
            cells = next(csv.reader([line], delimiter=self.separator or " ", skipinitialspace=True))
        elif self.separator is None:
            cells = re.split(r"[ \t]+", line.strip(" \t"))  # other blanks may be in numbers
            wider = (re.split(r"\s{2,}|\t", line.strip()), _WITH_BRACKETS.findall(line))
            cells = next((w for w in wider if len(cells) != width == len(w)), cells)
        else:
            cells = line.split(self.separator)
        return [cell.strip() for cell in cells]

    def is_comment(self, line: str) -> bool:
        """Return whether a line is a comment."""
        return COMMENT.match(line) is not None and not (self.separator == line.strip()[:1] == ";")

    def is_number(self, cell: str) -> bool:
        """Return whether a cell holds a number: plain, with a unit, or hexadecimal."""
        return _LIKE[self.decimal].fullmatch(cell.replace("−", "-")) is not None

    def is_value(self, cell: str) -> bool:
        """Return whether a cell holds a number in any form, or an instant."""
        return self.is_number(cell) or bool(GROUPED.fullmatch(cell)) or may_be_instant(cell)


@dataclass(frozen=True)
class Layout:
    """Where the samples begin, a line counted from 0, and what their columns are called, if they are."""

    dialect: Dialect
    width: int
    headers: list[str]
    units: list[str | None]
    first: int


def decoded(data: bytes, path: Path) -> bytes:
    """Return a text in UTF-8, its lines ended by line feeds; `DataError` if it is no text."""
    start = data[:_LOOKED_AT]
    zeros = [start[at::2].count(0) * 4 > len(start) for at in (0, 1)]
    try:
        if start.startswith((b"\xff\xfe", b"\xfe\xff")) or any(zeros):
            wide = "utf-16-be" if zeros[0] else "utf-16-le"
            data = data.decode("utf-16" if start[0] >= 0xFE else wide).encode()
        elif not data.isascii():
            data.decode("utf-8")
    except UnicodeDecodeError:
        data = _foreign(data, path)
    data = re.sub(rb"\A(?:\xef\xbb\xbf)+", b"", data, count=1).rstrip(b"\x1a")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if len(data.translate(None, _CONTROL)) < len(data):
        better = "give the file the ending of its format, or export it as CSV"
        raise DataError("this is not text", file=path, remedy=better)
    return data


def _foreign(data: bytes, path: Path) -> bytes:
    """Decode text in no encoding of Unicode's: by that in which its header has words of `names`."""
    texts = {}
    for encoding in _ENCODINGS:
        with suppress(UnicodeDecodeError):
            texts[encoding] = data.decode(encoding)
    words = {encoding: foreign_words(text[:_LOOKED_AT]) for encoding, text in texts.items()}
    best = max(words, key=words.__getitem__)
    if not words[best]:
        warn(path, f"its encoding shows by no word; it was read as {best}, so names may be garbled")
    return texts[best].encode()


def sniff(lines: Sequence[str], separators: Sequence[str | None] = SEPARATORS) -> Layout | None:
    """Return the layout of a table by its first lines; None if they are comments and blanks.

    The header is the last row of words before the rows of numbers, or the last comment there.
    """
    dialects = [Dialect(s, d) for s in separators for d in ".," if s != d]
    *_, width, dialect = max((_fitness(each, lines) for each in dialects), key=lambda fit: fit[:3])
    texts = [(at, line) for at, line in enumerate(lines) if line.strip()]
    rows = [(at, dialect.split(line, width)) for at, line in texts if not dialect.is_comment(line)]
    if not rows:
        return None
    block = [row for _, row in rows[len(rows) // 2 :] if len(row) == width]
    solid = [i for i in range(width) if _balance([row[i] for row in block], dialect) > 0]
    samples = [
        len(row) == width and _balance([row[i] for i in solid], dialect) > 0 for _, row in rows
    ]
    # one row of numbers between words is a part of the header
    pairs = [here and after for here, after in zip(samples, [*samples[1:], True], strict=True)]
    first = pairs.index(True) if True in pairs else 0
    spare = not any(row[-1] for row in block)
    heads = [_fitted(row, width, spare) for _, row in rows[:first]]
    words = [k for k, row in enumerate(heads) if len(row) == width and _balance(row, dialect) < 0]
    if words:
        # names are in the row with the most known ones, or else the last
        best = max(words, key=lambda k: (_known(heads[k]), k))
        first = words[-1] + 1
        if _known(heads[best]):  # rows of words alone may follow it, none with numbers
            first = best + 1
            while first in words and not any(map(dialect.is_value, heads[first])):
                first += 1
        above = int(
            best == first - 1 and best > 0
        )  # of the last row, the one above it may have names
        names = heads[best - above : min(best - above + 2, first)]
    elif not solid:  # nothing but words
        first, names = 1, [rows[0][1]]
    else:
        while first and len(heads[first - 1]) == width:  # no words: damaged samples
            first -= 1
        notes = [line for at, line in texts if at < rows[first][0] and dialect.is_comment(line)]
        names = [dialect.split(COMMENT.sub("", line, count=1), width) for line in notes[-2:]]
        if not names or len(names[-1]) != width:
            names = [row for row in heads[:first][-1:] if len(row) > 1]  # a header of other rows
    header, units = names[-1] if names else [], []
    if len(names) == 2 and len(names[0]) == width:
        if _are_units(header, names[0]):
            header, units = names
        elif _known(names[0]) > _known(header):
            header = names[0]
    stated = [cell.strip("[]() ") or None for cell in units] or [None] * len(header)
    return Layout(dialect, width, header, stated, (*(at for at, _ in rows), len(lines))[first])


def _fitness(dialect: Dialect, lines: Sequence[str]) -> tuple[float, float, bool, int, Dialect]:
    """Return how well a dialect fits: how many rows of one width are numbers.

    Then whether it cuts the row above these to that width, and whether it cuts at all.
    """
    numbers: dict[int, float] = defaultdict(float)
    rest: dict[int, float] = defaultdict(float)
    above: dict[int, str] = {}
    before = ""
    for line in lines:
        if line.strip() and not dialect.is_comment(line):
            row = dialect.split(line)
            cells = [cell for cell in row if cell and cell not in MISSING]
            share = sum(map(dialect.is_number, cells)) / max(len(cells), 1)
            if share > 0.5:
                above.setdefault(len(row), before)
                numbers[len(row)] += share
            rest[len(row)] += share  # also of titles, and tables with more words than numbers
            before = line
    width = max(numbers or rest, key=lambda each: (numbers[each], rest[each]), default=1)
    score = round(numbers[width] or rest[width] / (1 + len(lines)), 6)
    fits = len(dialect.split(above.get(width, ""), width)) == width
    return score, fits, width > 1, width, dialect


def _balance(cells: Sequence[str], dialect: Dialect) -> int:
    """Return how many more values than words there are in cells."""
    filled = [cell for cell in cells if cell and cell not in MISSING]
    return 2 * sum(map(dialect.is_value, filled)) - len(filled)


def _fitted(row: list[str], width: int, spare: bool) -> list[str]:
    """Return a row with the separator at its end that the samples have, or without the one they lack."""
    if len(row) == width + 1 and not row[-1]:
        return row[:-1]
    return [*row, ""] if spare and len(row) == width - 1 else row


def _are_units(row: Sequence[str], above: Sequence[str]) -> bool:
    """Return whether a row of words has the units of those above it: units that are no better names."""
    cells = [cell.strip("[]() ") for cell in row if cell]
    found = [find_listed(cell) or (re.search(r"[/*·^]", cell) and find(cell)) for cell in cells]
    return _known(row) <= _known(above) and 2 * sum(map(bool, found)) >= len(cells)


def _known(row: Sequence[str]) -> int:
    """Return how many cells of a row name a standard channel."""
    return sum(map(is_standard, row))
