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
        rf"\s*[+-]?(?:\d+(?:{re.escape(mark)}\d*)?|{re.escape(mark)}\d+)(?:[eE][+-]?\d+)?\s*"
    )
    for mark in ".,"
}
_BETWEEN_HEADERS = re.compile(r"\s+(?![^\[(]*[\])])(?!\s*[\[(])")


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
        return [cell.strip() for cell in line.split(self.separator)]

    def split_header(self, line: str, n_columns: int) -> list[str]:
        """Return the cells of a header line; ``Pressure (bar)`` is one also between blanks."""
        cells = self.split(line)
        if self.separator is None and len(cells) != n_columns and '"' not in line:
            for blanks in (re.compile(r"\s{2,}|\t"), _BETWEEN_HEADERS):
                wider = blanks.split(line.strip())
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


def _fitness(dialect: Dialect, lines: Sequence[str]) -> tuple[float, bool]:
    rows = [dialect.split(line) for line in lines]
    length, agreeing = Counter(map(len, rows)).most_common(1)[0]
    cells = [cell for row in rows for cell in row if cell]
    numbers = sum(map(dialect.is_number, cells)) / max(len(cells), 1)
    return numbers * agreeing / len(rows), length > 1
