"""A table: the columns of one recording as they are in the file, before they are interpreted."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array

MOST_TEXT = 2**16
"""Most characters of a text about the recording; longer ones are left out."""

WIDEST = 64
"""Most columns of a matrix that are read as channels."""

SLENDER = 10
"""Fewest rows of such a matrix for each of its columns."""


@dataclass(frozen=True)
class Flaw:
    """Why a column of numbers cannot be used.

    Parameters
    ----------
    sample : int
        The first that shows it, counted from 0.
    problem, remedy : str
        As in a `DataError`.
    """

    sample: int
    problem: str
    remedy: str


@dataclass(frozen=True)
class Column:
    """One column of a file.

    Parameters
    ----------
    header : str
        As written in the file.
    values : numpy.ndarray, shape (n,), or None
        The samples, NaN where a cell is blank; None for a column of text.
    unit : str, optional
        The unit where the file states it apart from the header.
    texts : sequence of str, length n
        The cells of a column of text; of a text file the first ones only, unless they are times.
    flaw : Flaw, optional
        Why the samples cannot be used, if they cannot.
    says : str, optional
        What names the channel and the unit in place of the header, as the name of a file does.
    times : numpy.ndarray, shape (n,), optional
        Times of the samples [s], where not all columns were sampled together.
    held : bool
        Whether the last sample holds until the next, as with counts and switches.
    place : str, optional
        The names that lead to it in the file, where the header is less.
    matrix : bool
        Whether it is a column of a matrix, whose names mean nothing.
    """

    header: str
    values: Array | None
    unit: str | None = None
    texts: Sequence[str] = ()
    flaw: Flaw | None = None
    says: str | None = None
    times: Array | None = None
    held: bool = False
    place: str | None = None
    matrix: bool = False

    @property
    def label(self) -> str:
        """What names the channel and the unit."""
        return self.says or self.header

    @property
    def size(self) -> int:
        """Number of samples."""
        return len(self.texts) if self.values is None else self.values.size


@dataclass(frozen=True)
class Table:
    """The columns of one recording in a file.

    Parameters
    ----------
    columns : tuple of Column
        In the order of the file; of unlike lengths where the file holds vectors of unlike lengths.
    lines : numpy.ndarray of int, shape (n,), optional
        The line of a text file that each sample is in; without it, samples count from 1.
    sample_time, start_time : float
        The time grid [s] where the file states it; ``sample_time`` is None otherwise.
    meta : mapping
        What else the file holds.
    rates : mapping of str to float
        Scalars named as rates or sample times are, by their places.
    unread : mapping of str to str
        What else holds data and became no column (a struct array, a sheet, a data set of three axes),
        by its place, and the reason in a few words.
    name : str, optional
        The name of this recording among several in the file.
    own : bool
        Whether this package wrote it: names, units and meta then need no interpretation.
    """

    columns: tuple[Column, ...]
    lines: NDArray[np.int64] | None = None
    sample_time: float | None = None
    start_time: float = 0.0
    meta: Mapping[str, Any] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)
    unread: Mapping[str, str] = field(default_factory=dict)
    name: str | None = None
    own: bool = False

    @property
    def n_samples(self) -> int:
        """Samples of the first column of numbers, or of the first column."""
        return next(
            (c.values.size for c in self.columns if c.values is not None), self.columns[0].size
        )

    @property
    def has_clocks(self) -> bool:
        """Whether columns have times of their own, so that none of them is the time."""
        return any(column.times is not None for column in self.columns)

    def row(self, sample: int) -> int:
        """Return the row to name in an error for a sample counted from 0."""
        return sample + 1 if self.lines is None else int(self.lines[sample])


def column(header: str, values: NDArray[Any], unit: str | None = None) -> Column:
    """Return the column of an array of any type; instants become seconds since the first."""
    if values.dtype.kind in "mM":
        since = values - values[:1] if values.dtype.kind == "M" else values
        seconds = since.astype("timedelta64[ns]").astype(np.float64) * 1e-9
        return Column(header, np.where(np.isnat(values), np.nan, seconds), "s")
    if values.dtype.kind in "biuf":
        return Column(header, np.asarray(values, dtype=np.float64), unit)
    return Column(header, None, unit, texts=[str(value) for value in values])


def plain_meta(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the finite numbers and the texts of a mapping, as JSON holds them."""
    meta: dict[str, Any] = {}
    for name, value in found.items():
        if isinstance(value, (np.ndarray, np.generic)) and value.size == 1:
            value = value.item()
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if (isinstance(value, str) and len(value) <= MOST_TEXT) or (
            isinstance(value, (int, float)) and math.isfinite(value)
        ):
            meta[name] = value
    return meta


def is_matrix(shape: Sequence[int]) -> bool:
    """Tell whether the rows or the columns of a matrix are channels: few, and long."""
    return len(shape) == 2 and 2 <= min(shape) <= WIDEST and max(shape) >= SLENDER * min(shape)


def printable(table: Table) -> Table:
    r"""Return a table of another program without control characters in its words.

    Blanks of any kind become plain ones; other signs that cannot be printed are written as ``\x1b``.
    """
    if table.own:
        return table
    columns = tuple(
        replace(
            column,
            header=plain(column.header),
            unit=column.unit and plain(column.unit),
            says=column.says and plain(column.says),
            place=column.place and plain(column.place),
        )
        for column in table.columns
    )
    return replace(
        table,
        columns=columns,
        name=table.name and plain(table.name),
        meta={plain(key): _plain_value(value) for key, value in table.meta.items()},
        rates={plain(place): value for place, value in table.rates.items()},
        unread={plain(place): plain(why) for place, why in table.unread.items()},
    )


def distinct(table: Table) -> Table:
    """Return a table in which the second column of one header is called ``header (2)``, and so on."""
    seen: Counter[str] = Counter()
    columns = []
    for column in table.columns:
        seen[column.header] += 1
        n = seen[column.header]
        header = column.header if n == 1 or table.own else f"{column.header} ({n})"
        columns.append(column if n == 1 else replace(column, header=header))
    return replace(table, columns=tuple(columns)) if len(seen) < len(columns) else table


def plain(text: str) -> str:
    r"""Return text with what cannot be printed written out.

    >>> print(plain("\x1b[31mpressure\xa0(bar)"))
    \x1b[31mpressure (bar)
    """
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() else " " if sign.isspace() else ascii(sign)[1:-1]
        for sign in text
    )


def _plain_value(value: Any) -> Any:
    if isinstance(value, str):
        return plain(value)
    return [_plain_value(item) for item in value] if isinstance(value, list) else value
