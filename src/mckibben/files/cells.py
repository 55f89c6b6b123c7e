"""The cells of one column of a text file, taken part by part: numbers, or text."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.files.dialect import Dialect
from mckibben.files.instants import may_be_instant
from mckibben.files.marks import REMEDY, Doubt, is_marked, may_be_doubted
from mckibben.files.table import Column, Flaw

_SHOWN = 5  # cells of text that are kept, where they are no times
_FLAW = "correct that cell, or leave it blank and say --gaps split or interpolate"


class Cells:
    """What is known of a column after some of its cells.

    Parameters
    ----------
    header : str
        May be empty.
    unit : str or None
        Where the file states it apart from the header.
    dialect : Dialect
    """

    def __init__(self, header: str, unit: str | None, dialect: Dialect) -> None:
        self.header, self._unit, self._dialect = header, unit, dialect
        self._parts: list[Array] = []
        self._texts: list[str] = []
        self._n = self._filled = self._numbers = 0
        self._no_number: tuple[int, str] | None = None
        self._marked: tuple[int, str] | None = None
        self._n_marked = 0
        self._integers = True
        self.n_finite = 0

    def take(self, part: Any) -> None:
        """Take the next cells, a column as pandas reads it."""
        if part.dtype.kind in "iufb":
            values = part.to_numpy(np.float64)
            numbers = int(np.count_nonzero(~np.isnan(values)))
            self._filled += numbers
            self._numbers += numbers
            self._integers &= part.dtype.kind in "iu" or not numbers
        else:
            values = self._read(["" if cell != cell else str(cell).strip() for cell in part])
            self._integers = False
        self._parts.append(values)
        self.n_finite += int(np.count_nonzero(np.isfinite(values)))
        self._n += len(part)

    def may_be_doubted(self) -> bool:
        """Tell whether the marks in its numbers may stand for something else."""
        numeric = self.n_finite > 0 and self._no_number is None and not self._integers
        if not numeric:
            return False
        self._parts = [np.concatenate(self._parts)]
        return may_be_doubted(self._parts[0])

    def has_fractions(self) -> bool:
        """Tell whether there are numbers that are not whole, which none is without a decimal mark."""
        parts = (part[np.isfinite(part)] for part in self._parts)
        return any(bool(np.any(part != np.rint(part))) for part in parts)

    def column(self, place: int, doubt: Doubt | None) -> Column | None:
        """Return the column, the one of this place; None for a blank one without a header."""
        if not self._filled:
            return Column(self.header, None, self._unit, texts=[""]) if self.header else None
        header = self.header or f"column_{place + 1}"
        if 2 * (self._numbers + self._n_marked) <= self._filled:
            return Column(header, None, self._unit, texts=self._texts)
        flaw = None
        if self._marked is not None:
            sample, cell = self._marked
            flaw = Flaw(sample, f"{cell[:40]!r} may mean several numbers", REMEDY)
        elif self._no_number is not None:
            sample, cell = self._no_number
            flaw = Flaw(sample, f"{cell[:40]!r} is not a number", _FLAW)
        elif doubt is not None and not doubt.everywhere:
            whole = re.sub("[.,]", "", doubt.cell)
            flaw = Flaw(
                doubt.sample,
                f"in column {header!r}, {doubt.cell!r} may be a number with decimals or {whole}, since "
                "others in it have no mark",
                REMEDY,
            )
        values: Array = np.full(self._n, np.nan) if flaw else np.concatenate(self._parts)
        return Column(header, values, self._unit, flaw=flaw)

    def _read(self, cells: list[str]) -> Array:
        """Return the numbers in cells of which some are none."""
        values = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            if not cell:
                continue
            self._filled += 1
            if self._dialect.is_number(cell):
                self._numbers += 1
                values[k] = float(cell.replace(self._dialect.decimal, "."))
                continue
            here = self._n + k, cell
            self._no_number = self._no_number or here
            if is_marked(cell):
                self._n_marked += 1
                self._marked = self._marked or here
        self._keep_texts(cells)
        return values

    def _keep_texts(self, cells: list[str]) -> None:
        """Keep the first cells for show, and all of them where they are times."""
        if self._n < _SHOWN or len(self._texts) == self._n:
            first = next((cell for cell in (*self._texts, *cells) if cell), "")
            texts = [*([""] * (self._n - len(self._texts))), *cells]
            self._texts += texts if may_be_instant(first) else texts[:_SHOWN]
