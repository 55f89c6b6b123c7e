"""How the cells of a text file are separated and its numbers written, found from its lines."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

SEPARATORS = ("\t", ";", "|", ",", None)
"""In the order in which they are preferred where a file can be read in two ways; None is blanks."""

_NUMBER = {
    mark: re.compile(
        rf"\s*[+-]?(?:\d+(?:{re.escape(mark)}\d*)?|{re.escape(mark)}\d+)(?:[eE][+-]?\d+)?\s*",
        re.ASCII,
    )
    for mark in ".,"
}
_SPACED = re.compile(r"[+-]?\d{1,3}(?: \d{3})+(?:[.,]\d*)?", re.ASCII)
"""A number like 1 000, which is refused later, but is one cell where there is a better separator."""
_BLANKS = re.compile(r"[ \t]+")
_WIDE_BLANKS = re.compile(r"\s{2,}|\t")
_BRACKET = re.compile(r"[\[\]()]")


@dataclass(frozen=True)
class Dialect:
    """A separator (None for blanks) and a decimal mark."""

    separator: str | None
    decimal: str

    def split(self, line: str) -> list[str]:
        """Return the cells of a line."""
        if '"' in line:
            line = line if self.separator else line.replace("\t", " ").strip()
            cells = next(csv.reader([line], delimiter=self.separator or " ", skipinitialspace=True))
            return [cell.strip() for cell in cells]
        if self.separator is None:
            return _BLANKS.split(line.strip(" \t"))
        return [cell.strip() for cell in line.split(self.separator)]

    def split_header(self, line: str, n_columns: int) -> list[str]:
        """Return the cells of a header line; ``Pressure (bar)`` is one also between blanks."""
        cells = self.split(line)
        if self.separator is None and len(cells) != n_columns and '"' not in line:
            for wider in (_WIDE_BLANKS.split(line.strip()), _between_brackets(line)):
                if len(wider) == n_columns:
                    return wider
        return cells

    def is_number(self, cell: str) -> bool:
        """Tell whether a cell holds a number."""
        return _NUMBER[self.decimal].fullmatch(cell) is not None


def detect(lines: Sequence[str]) -> Dialect:
    """Return the dialect in which most cells are numbers and most lines equally long.

    >>> detect(["p;l", "0,5;10,25", "1;11"])
    Dialect(separator=';', decimal=',')
    """
    candidates = [
        Dialect(separator, decimal)
        for separator in SEPARATORS
        for decimal in ".,"
        if separator != decimal
    ]
    data = lines[1:] or lines
    return max(candidates, key=lambda dialect: _fitness(dialect, data))


def _between_brackets(line: str) -> list[str]:
    """Split at blanks that are neither in brackets nor before some.

    >>> _between_brackets("Pressure (bar) Stroke [mm s]")
    ['Pressure (bar)', 'Stroke [mm s]']
    """
    cells: list[list[str]] = []  # all from the right, so that one look at a word is enough
    inside = False
    for word in reversed(line.split()):
        if cells and (inside or cells[-1][-1].startswith(("[", "("))):
            cells[-1].append(word)
        else:
            cells.append([word])
        bracket = _BRACKET.search(word)
        inside = inside if bracket is None else bracket[0] in ")]"
    return [" ".join(reversed(words)) for words in reversed(cells)]


def _fitness(dialect: Dialect, lines: Sequence[str]) -> tuple[float, bool]:
    rows = [dialect.split(line) for line in lines]
    length, agreeing = Counter(map(len, rows)).most_common(1)[0]
    cells = [cell for row in rows for cell in row if cell]
    numbers = sum(dialect.is_number(cell) or bool(_SPACED.fullmatch(cell)) for cell in cells)
    return numbers / max(len(cells), 1) * agreeing / len(rows), length > 1
