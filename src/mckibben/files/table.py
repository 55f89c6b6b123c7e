"""Raw table: the columns of one recording before interpretation."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.printing import printable

WIDEST = 64
"""Most columns of a matrix that are read as channels."""


@dataclass(frozen=True)
class Flaw:
    """Why a column of numbers cannot be used, as in a `DataError`, and the first bad sample.

    Samples of a column that is ``bridgeable`` are missing (NaN) where they are bad.
    """

    sample: int
    problem: str
    remedy: str
    bridgeable: bool = False


@dataclass(frozen=True)
class Column:
    """One column of a file."""

    header: str  # as written in the file
    values: Array | None  # the samples, NaN where a cell is blank; None for a column of text
    unit: str | None = None  # where the file states it outside the header
    texts: Sequence[str] = ()  # cells of text; of a text file the first ones, unless they are times
    flaw: Flaw | None = None
    alias: str | None = None  # names channel and unit in place of the header, as a file's name does
    times: Array | None = None  # of the samples [s], where not all columns were sampled together
    held: bool = False  # whether each sample holds until the next, as with counts and switches
    place: str | None = None  # the names that lead to it in the file, where the header is less
    matrix: bool = False  # whether it is a column of a matrix, whose names mean nothing

    @property
    def label(self) -> str:
        """Text with the channel and the unit."""
        return self.alias or self.header

    @property
    def size(self) -> int:
        """Number of samples."""
        return len(self.texts) if self.values is None else self.values.size


@dataclass(frozen=True)
class Table:
    """The columns of one recording in a file, and other contents.

    The columns are in the order of the file, and of unlike lengths where it holds such vectors.
    """

    columns: tuple[Column, ...]
    lines: NDArray[np.int64] | None = None  # of each sample in a text file; without, count from 1
    sample_time: float | None = None  # [s], where the file states it
    start_time: float = 0.0  # [s]
    meta: Mapping[str, Any] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)  # place -> rate or sample time
    unread: Mapping[str, str] = field(default_factory=dict)  # place -> why it became no column
    name: str | None = None  # of this recording among several in the file
    own: bool = False  # whether this package wrote it, so that nothing needs interpretation

    @property
    def n_samples(self) -> int:
        """Number of samples of the first numeric column, or of the first column."""
        return next(
            (c.values.size for c in self.columns if c.values is not None), self.columns[0].size
        )

    @property
    def has_clocks(self) -> bool:
        """Whether columns have separate times, so that none of them is the time."""
        return any(column.times is not None for column in self.columns)

    def row(self, sample: int) -> int:
        """Return the row number for a sample counted from 0."""
        return sample + 1 if self.lines is None else int(self.lines[sample])


def column(header: str, values: NDArray[Any], unit: str | None = None) -> Column:
    """Return the column of an array of any type; instants are converted to seconds since the first."""
    if values.dtype.kind in "mM":
        since = values - values[:1] if values.dtype.kind == "M" else values
        seconds = since.astype("timedelta64[ns]").astype(np.float64) * 1e-9
        return Column(header, np.where(np.isnat(values), np.nan, seconds), "s")
    if values.dtype.kind in "biuf":
        return Column(header, np.asarray(values, dtype=np.float64), unit)
    return Column(header, None, unit, texts=[str(value) for value in values])


def plain_meta(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the finite numbers and the texts of a mapping, as JSON values."""
    meta: dict[str, Any] = {}
    for name, value in found.items():
        if isinstance(value, (np.ndarray, np.generic)) and value.size == 1:
            value = value.item()
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if isinstance(value, (int, float)):
            usable = math.isfinite(value)
        else:
            usable = isinstance(value, str) and len(value) <= 2**16  # longer texts are other data
        if usable:
            meta[name] = value
    return meta


def is_matrix(shape: Sequence[int]) -> bool:
    """Return whether the rows or the columns of a matrix are channels: few, and long."""
    return len(shape) == 2 and 2 <= min(shape) <= WIDEST and max(shape) >= 10 * min(shape)


def legible(value: Any) -> Any:
    """Return a foreign table, or a part of one, with printable texts."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, (list, tuple)):
        return type(value)(map(legible, value))
    if isinstance(value, Mapping):
        return {legible(key): legible(each) for key, each in value.items()}
    if isinstance(value, (Table, Column)) and not getattr(value, "own", False):
        return replace(value, **{name: legible(each) for name, each in vars(value).items()})
    return value


def distinct(table: Table) -> Table:
    """Return a table with repeated headers numbered, as ``header (2)``."""
    seen: Counter[str] = Counter()
    columns = []
    for column in () if table.own else table.columns:
        seen[column.header] += 1
        n = seen[column.header]
        columns.append(column if n == 1 else replace(column, header=f"{column.header} ({n})"))
    return replace(table, columns=tuple(columns)) if len(seen) < len(columns) else table
