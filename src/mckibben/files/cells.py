"""Cells of text tables: separators, number formats, and columns."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from mckibben.files.instants import may_be_instant
from mckibben.files.table import Column, Flaw

MISSING = (
    *("-", "--", "---", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None"),
    *("∞", "+∞", "-∞", "OL", "OVLD"),
)
"""Cells of missing samples, or of samples beyond the instrument's range."""

_COMMENT = r"#(?!N/?A\b|DIV/0|VALUE!|REF!|NUM!|NAME\?|NULL!)|%|//"  # not the errors of spreadsheets
_GROUPING = r".,'’`_ \xa0\u2009\u202f"
_FORMS = {
    mark: re.compile(
        r"(?P<hexadecimal>[+-]?0[xX][0-9a-fA-F]+)"
        rf"|(?P<three_digits>[+-]?0*[1-9]\d{{0,2}}[{mark}]\d{{3}})"  # one, or a thousand: 1,000
        rf"|(?P<number>[+-]?(?:\d+(?:[{mark}]\d*)?|[{mark}]\d+)(?:[eEdD][+-]?\d+)?)"  # Fortran: 1.5D+00
        r"(?:\s*(?P<unit>[A-Za-z°%µμΩ][^\d,;:]{0,9}\d?))?"
        rf"|(?P<thousands>[+-]?\d{{1,3}}(?:(?![{mark}])[{_GROUPING}]\d{{3}})+[{mark}]\d+)"
        r"|(?P<spaced>[+-]?\d{1,3}(?: \d{3})+(?:[.,]\d*)?)"
        rf"|(?P<grouped>[+-]?\d{{1,3}}(?P<mark>[{_GROUPING}])(?:\d{{2,3}}(?P=mark))*\d{{3}}"
        r"(?:[.,]\d*)?|[+-]?\d*[.,]\d+)",  # or a number with the other decimal mark
        re.ASCII,
    )
    for mark in ".,"
}
"""Decimal mark -> the forms of cells that hold numbers."""


@dataclass(frozen=True)
class Dialect:
    """Separator and number format of a text table."""

    separator: str | None
    decimal: str

    def split(self, line: str, width: int = 0) -> list[str]:
        """Return the cells of a line; of a whitespace-separated header, a given number if possible."""
        if '"' in line:
            line = line if self.separator else line.replace("\t", " ").strip()
            cells = next(csv.reader([line], delimiter=self.separator or " ", skipinitialspace=True))
        elif self.separator is None:
            cells = re.split(r"[ \t]+", line.strip(" \t"))  # other blanks may be in numbers
            bracketed = re.findall(r"\S+(?:\s*[\[(][^\])]*[\])]+)?", line)
            wider = (re.split(r"\s{2,}|\t", line.strip()), bracketed)
            cells = next((w for w in wider if len(cells) != width == len(w)), cells)
        else:
            cells = line.split(self.separator)
            if width and len(cells) != width:  # "force (N, static)" is one name
                outside = re.split(re.escape(self.separator) + r"(?![^(\[]*[)\]])", line)
                cells = outside if len(outside) == width else cells
        return [cell.strip() for cell in cells]

    @property
    def comment(self) -> str:
        """The pattern of the start of a comment: a semicolon only if it is not the separator."""
        return _COMMENT if self.separator == ";" else f"{_COMMENT}|;"

    def is_comment(self, line: str) -> bool:
        """Return whether a line is a comment."""
        return re.match(rf"\s*(?:{self.comment})", line) is not None

    def form(self, cell: str) -> tuple[str, re.Match[str] | None]:
        """Return the form of a cell: one of `_FORMS`, missing or text; and the match of a number."""
        return _form(cell, self.decimal)

    def value(self, match: re.Match[str] | None) -> float:
        """Return the number of a cell of that form; NaN for a missing one, and what may be several."""
        if match is None:
            return math.nan
        if match["hexadecimal"]:
            return int(match["hexadecimal"], 16)
        if match["thousands"]:
            return float(re.sub(rf"[^-\d{self.decimal}]", "", match[0]).replace(self.decimal, "."))
        plain = (match["number"] or match["three_digits"] or "nan").replace(self.decimal, ".")
        return float(re.sub("[dD]", "e", plain))

    def is_value(self, cell: str) -> bool:
        """Return whether a cell holds a number in any form, or an instant."""
        return self.form(cell)[1] is not None or may_be_instant(cell)

    def balance(self, cells: Sequence[str]) -> int:
        """Return the number of values minus that of words in cells."""
        filled = [cell for cell in cells if self.form(cell)[0] != "missing"]
        return 2 * sum(map(self.is_value, filled)) - len(filled)


@lru_cache(maxsize=2**14)  # a table is tried with several separators
def _form(cell: str, decimal: str) -> tuple[str, re.Match[str] | None]:
    match = _FORMS[decimal].fullmatch(cell.replace("−", "-"))
    if match:
        return (match.lastgroup or "").replace("_", " "), match
    return "text" if cell and cell not in MISSING else "missing", None


def column(name: str, unit: str | None, cells: Any, dialect: Dialect) -> tuple[Column, str]:
    """Return a column from the forms of its cells, and a possible thousands number if all may be.

    "1,000" is a thousand to some and one to others: its mark is for decimals where another number of
    the column shows it, or where no number is without such a mark.
    """
    import pandas as pd

    codes, unique = pd.factorize(cells)  # -1 is for cells that are missing
    words = [*(str(word).strip() for word in unique), ""]
    forms, matches = zip(*map(dialect.form, words), strict=True)
    if may_be_instant(words[0]) and not matches[0]:
        return Column(name, None, unit, texts=[words[code] for code in codes]), ""
    if "grouped" in forms and (marked := _with_other_mark(words, dialect)):
        return column(name, unit, cells, marked)
    plain = [word for word, form in zip(words, forms, strict=True) if form == "number"]
    decimal = not plain or any(dialect.decimal in word for word in plain)
    same_form = {"three digits": "number" if decimal else "grouped", "spaced": "grouped"}
    same_form["thousands"] = "number"
    pairs = zip(forms, matches, strict=True)
    kinds = np.array([f"in {m['unit']}" if f == "unit" else same_form.get(f, f) for f, m in pairs])[
        codes
    ]
    filled = kinds != "missing"
    counts = pd.Series(kinds[filled]).value_counts()
    numbers = counts.drop("text", errors="ignore")
    if 2 * numbers.sum() <= counts.sum():
        return Column(name, None, unit, texts=[words[code] for code in codes]), ""
    usual = str(numbers.index[0])
    if usual.startswith("in "):
        unit = unit or usual.removeprefix("in ")
        usual = f"in {unit}"
    wrong, problem = kinds == "grouped", "may mean several numbers"
    remedy = (
        "write numbers without marks between thousands, with one decimal mark in the whole file, and "
        "whole numbers with it too, such as 2.0 for 2"
    )
    bridgeable = not wrong.any()
    if bridgeable:
        wrong, problem = filled & (kinds != usual), "is not a number like the others"
        remedy = "correct that cell"
    values = np.array(
        [
            math.nan if f in ("grouped", "spaced") else dialect.value(m)
            for f, m in zip(forms, matches, strict=True)
        ]
    )
    if wrong.any():
        at = int(np.argmax(wrong))
        flaw = Flaw(at, f"{words[codes[at]][:40]!r} {problem}", remedy, bridgeable)
        bad = wrong | (not bridgeable)
        return Column(name, np.where(bad, np.nan, values[codes]), unit, flaw=flaw), ""
    cell = next((w for w, f in zip(words, forms, strict=True) if f == "three digits"), "")
    return Column(name, values[codes], unit), "" if plain else cell


def _with_other_mark(words: Sequence[str], dialect: Dialect) -> Dialect | None:
    """Return the dialect with the other decimal mark where the words of a column show that it is so.

    As text of a spreadsheet, or in quotation marks, beside columns with the mark of the table.
    """
    other = replace(dialect, decimal="," if dialect.decimal == "." else ".")
    matches = [other.form(word) for word in words]
    is_plain = any(match and other.decimal in (match["number"] or "") for _, match in matches)
    sound = {form for form, _ in matches} <= {"number", "three digits", "unit", "missing"}
    return other if is_plain and sound else None
