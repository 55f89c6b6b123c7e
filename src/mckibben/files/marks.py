"""Marks between digits: those of thousands told from decimal marks, by all cells of a column.

"1,000" is a thousand to some and one to others. A mark is a decimal mark where a number of the column
shows it: by another count of digits after it than three, more than three before it, or a zero there.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.files.dialect import Dialect
from mckibben.files.lines import Lines

REMEDY = (
    "write numbers without marks between thousands, with one decimal mark in the whole file, and "
    "whole numbers with it too, such as 2.0 for 2"
)

_GROUPED = re.compile(
    r"[+-]?\d{1,3}(?P<mark>[.,'’`_ \xa0\u2009\u202f])(?:\d{2,3}(?P=mark))*\d{3}(?:[.,]\d*)?",
    re.ASCII,
)
_OTHERWISE = re.compile(r"[+-]?\d*[.,]\d+", re.ASCII)
_BLOCK = 200_000  # cells that are looked at at once
_FIRST = 1000  # samples that are looked at first: few columns need more


@dataclass(frozen=True)
class Doubt:
    """A number of a column that can be read in two ways.

    Parameters
    ----------
    sample : int
        Counted from 0.
    cell : str
    everywhere : bool
        Whether all numbers of the column are written like it, so that it has decimals.
    """

    sample: int
    cell: str
    everywhere: bool


def is_marked(cell: str) -> bool:
    """Tell whether a cell that is no number would be one but for its marks.

    >>> [is_marked(cell) for cell in ("1,234,567", "1'000", "1.234,5", "31.12.2026", "up")]
    [True, True, True, False, False]
    """
    return (_GROUPED.fullmatch(cell) or _OTHERWISE.fullmatch(cell)) is not None


def may_be_doubted(values: Array) -> bool:
    """Tell whether no number of a column shows by itself that its mark is a decimal one."""
    return _no_proof(values[:_FIRST]) and _no_proof(values)


def doubts(
    columns: Sequence[int], filled: Sequence[int], lines: Lines, dialect: Dialect
) -> dict[int, Doubt]:
    """Return the doubts that remain about columns when all their cells are looked at.

    Parameters
    ----------
    columns : sequence of int
        Columns of numbers.
    filled : sequence of int
        Numbers in every column of the file.
    lines : Lines
        All of them, each with as many cells.
    dialect : Dialect
    """
    open_, at = set(columns), 0
    found: dict[int, tuple[int, str]] = {}
    doubted: dict[int, int] = dict.fromkeys(columns, 0)
    while open_ and at < len(lines):
        stop = min(at + (max(_BLOCK // len(filled), 1) if at else _FIRST), len(lines))
        grid = lines.grid(at, stop, dialect)
        marks = (grid.signs == ord(dialect.decimal)).view(np.uint8)
        for i in sorted(open_):
            starts, stops = grid.starts[:, i], grid.stops[:, i]
            edges = np.column_stack([starts, stops]).ravel()
            marked = np.add.reduceat(marks, edges, dtype=np.int64)[::2] * (stops > starts) > 0
            alike = marked.copy()
            alike[marked] = _like_thousands(grid.signs, starts[marked], stops[marked], dialect)
            if np.any(marked & ~alike):
                open_.remove(i)
            elif alike.any():
                if not doubted[i]:
                    k = int(np.argmax(alike))
                    cell = grid.signs[starts[k] : stops[k]].tobytes().decode()
                    found[i] = at + k, cell
                doubted[i] += int(alike.sum())
        at = stop
    return {i: Doubt(*found[i], doubted[i] == filled[i]) for i in sorted(open_ & set(found))}


def _like_thousands(
    signs: NDArray[np.uint8], starts: NDArray[np.int64], stops: NDArray[np.int64], dialect: Dialect
) -> NDArray[np.bool_]:
    """Tell which numbers are written as [+-]D.DDD to DDD.DDD, with no zero before."""
    first = starts + np.isin(signs[starts], list(b"+-"))
    whole = stops - 4 - first
    alike = (whole >= 1) & (whole <= 3)
    alike &= (signs[first] > ord("0")) & (signs[first] <= ord("9"))
    alike &= signs[stops - 4] == ord(dialect.decimal)
    for place in (1, 2, 3):
        alike &= (signs[stops - place] >= ord("0")) & (signs[stops - place] <= ord("9"))
    return alike


def _no_proof(values: Array) -> bool:
    sizes = np.abs(values[np.isfinite(values)])
    whole = sizes == np.rint(sizes)
    fractions = sizes[~whole]
    if not fractions.size:
        return True
    if fractions.min() < 1 or fractions.max() >= 1000:
        return False
    return bool(np.all(np.abs(1000 * fractions - np.rint(1000 * fractions)) < 1e-6))
