"""The lines of a text that hold a table: all but blank ones and comments."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben.errors import DataError
from mckibben.files.dialect import Dialect

LONGEST = 2**18
"""Bytes of a line."""

MOST = 50_000_000
"""Lines of a text."""

_BLOCK = 2**20  # bytes that are looked at at once
_SAMPLE = 200  # lines that the dialect is found from
_BLANK = np.isin(np.arange(256), list(b" \t\v\f"))
_BETWEEN_CELLS = np.isin(np.arange(256), list(b" \t\n"))
_COMMENT = np.isin(np.arange(256), list(b"#%"))


@dataclass(frozen=True)
class Grid:
    """Where the cells of some lines are: ``signs[start:stop]``, without the blanks around them.

    Parameters
    ----------
    signs : numpy.ndarray of uint8
    starts, stops : numpy.ndarray of int, shape (lines, columns)
    """

    signs: NDArray[np.uint8]
    starts: NDArray[np.int64]
    stops: NDArray[np.int64]


@dataclass(frozen=True)
class Lines:
    """Lines of a text, where they are in it and as an editor counts them.

    Parameters
    ----------
    data : bytes
        The whole text, UTF-8.
    starts, stops : numpy.ndarray of int, shape (n,)
        Of the lines in ``data``.
    numbers : numpy.ndarray of int, shape (n,)
        Counted from 1, with those that are left out.
    quoted : tuple of int
        Which of the lines have quotation marks.
    """

    data: bytes
    starts: NDArray[np.int64]
    stops: NDArray[np.int64]
    numbers: NDArray[np.int64]
    quoted: tuple[int, ...] = ()

    @classmethod
    def of(cls, data: bytes, path: Path) -> tuple[Lines, str]:
        """Return the lines of a text, and the last comment before them.

        Raises
        ------
        DataError
            If there are none, or too many; if one is too long, or a quotation mark not closed.
        """
        if not data.endswith(b"\n"):
            data += b"\n"
        if data.count(b"\n") > MOST:
            raise DataError(
                f"it has more than {MOST} lines", file=path, remedy="cut it into smaller files"
            )
        signs = np.frombuffer(data, np.uint8)
        stops = np.flatnonzero(signs == ord("\n"))
        starts = np.concatenate([[0], stops[:-1] + 1])
        long = np.flatnonzero(stops - starts > LONGEST)
        if long.size:
            raise DataError(
                f"the line has {stops[long[0]] - starts[long[0]]} bytes, more than the {LONGEST} "
                "that are read",
                file=path,
                row=int(long[0]) + 1,
                remedy="give a table with a line for each sample and a column for each channel",
            )
        text = _text_starts(signs, starts, stops)
        filled = text < stops
        comment = filled.copy()
        comment[filled] = _COMMENT[signs[text[filled]]]
        kept = np.flatnonzero(filled & ~comment)
        if not kept.size:
            raise DataError(
                "there is nothing in it", file=path, remedy="give a file with a header and samples"
            )
        lines = cls(data, starts[kept], stops[kept], kept + 1)
        before = np.flatnonzero(comment[: kept[0]])
        said = ""
        if before.size:
            said = data[starts[before[-1]] : stops[before[-1]]].decode().lstrip().lstrip("#% ")
        return lines._with_quotes(path), said

    def __len__(self) -> int:
        return self.starts.size

    def text(self, at: int) -> str:
        """Return one of the lines."""
        return self.data[self.starts[at] : self.stops[at]].decode()

    def sample(self) -> list[str]:
        """Return the first lines: three, and more while they are short."""
        size = np.cumsum(self.stops[:_SAMPLE] - self.starts[:_SAMPLE])
        return [self.text(at) for at in range(max(3, int(np.sum(size < LONGEST))))[: len(self)]]

    def after(self, first: int) -> Lines:
        """Return the lines from the one of this place on, with nothing between or after them."""
        rest = replace(
            self,
            starts=self.starts[first:],
            stops=self.stops[first:],
            numbers=self.numbers[first:],
            quoted=tuple(at - first for at in self.quoted if at >= first),
        )
        if not len(rest) or (
            np.array_equal(rest.starts[1:], rest.stops[:-1] + 1)
            and rest.stops[-1] == len(self.data) - 1
        ):
            return rest
        ends = zip(rest.starts.tolist(), rest.stops.tolist(), strict=True)
        data = b"".join(self.data[start : stop + 1] for start, stop in ends)
        lengths = rest.stops - rest.starts + 1
        stops = np.cumsum(lengths) - 1
        return replace(rest, data=data, starts=stops - lengths + 1, stops=stops)

    def source(self) -> io.BytesIO:
        """Return a file whose place is where these lines begin, which end it."""
        file = io.BytesIO(self.data)
        file.seek(int(self.starts[0]))
        return file

    def counted(self, separator: str | None) -> NDArray[np.int64]:
        """Return how many cells each line has, if none is quoted; a separator of None is blanks."""
        if separator is None:
            return self._count(lambda signs: _begins(~_BETWEEN_CELLS[signs]))
        return self._count(lambda signs: signs == ord(separator)) + 1

    def grid(self, first: int, stop: int, dialect: Dialect) -> Grid:
        """Return where the cells of some lines are, all of which have as many."""
        separator = dialect.separator
        if any(first <= at < stop for at in self.quoted):
            separator = "\x1f"  # which no text has
            rows = (separator.join(dialect.split(self.text(at))) for at in range(first, stop))
            data = ("\n".join(rows) + "\n").encode()
        else:
            data = self.data[self.starts[first] : self.stops[stop - 1] + 1]
        signs = np.frombuffer(data, np.uint8)
        if separator is None:
            cell = ~_BETWEEN_CELLS[signs]
            starts, stops = np.flatnonzero(_begins(cell)), np.flatnonzero(_begins(~cell))
            stops = stops[stops > starts[0]]  # blanks that begin the first line are no end
        else:
            stops = np.flatnonzero((signs == ord(separator)) | (signs == ord("\n")))
            starts = np.concatenate([[0], stops[:-1] + 1])
            if b" " in data or b"\t" in data:
                starts = _text_starts(signs, starts, stops)
                stops = _text_stops(signs, starts, stops)
        shape = (stop - first, -1)
        return Grid(signs, starts.reshape(shape), stops.reshape(shape))

    def _count(self, marks: Callable[[NDArray[np.uint8]], NDArray[np.bool_]]) -> NDArray[np.int64]:
        """Return how many of the signs in every line are marks."""
        signs = np.frombuffer(self.data, np.uint8)
        found: NDArray[np.int64] = np.zeros(len(self), dtype=np.int64)
        blocks = np.searchsorted(self.starts, np.arange(0, signs.size, _BLOCK))
        for first, stop in pairwise(sorted({*blocks.tolist(), len(self)})):
            begin, end = self.starts[first], self.stops[stop - 1]
            edges = np.column_stack([self.starts[first:stop], self.stops[first:stop]]).ravel()
            here = marks(signs[begin : end + 1]).view(np.uint8)
            found[first:stop] = np.add.reduceat(here, edges - begin, dtype=np.int64)[::2]
        return found

    def _with_quotes(self, path: Path) -> Lines:
        if b'"' not in self.data:
            return self
        quotes = self._count(lambda signs: signs == ord('"'))
        unclosed = np.flatnonzero(quotes % 2)
        if unclosed.size:
            raise DataError(
                "a quotation mark is not closed",
                file=path,
                row=int(self.numbers[unclosed[0]]),
                remedy="close it, and keep line breaks out of cells",
            )
        return replace(self, quoted=tuple(np.flatnonzero(quotes).tolist()))


def _text_starts(
    signs: NDArray[np.uint8], starts: NDArray[np.int64], stops: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return where each line's first sign is that is no blank; its stop, if there is none."""
    at = starts.copy()
    left = np.flatnonzero(at < stops)
    while left.size:
        left = left[_BLANK[signs[at[left]]]]
        at[left] += 1
        left = left[at[left] < stops[left]]
    return at


def _text_stops(
    signs: NDArray[np.uint8], starts: NDArray[np.int64], stops: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the places after each cell's last sign that is no blank."""
    at = stops.copy()
    left = np.flatnonzero(at > starts)
    while left.size:
        left = left[_BLANK[signs[at[left] - 1]]]
        at[left] -= 1
        left = left[at[left] > starts[left]]
    return at


def _begins(marks: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where runs of marks begin."""
    begins = marks.copy()
    begins[1:] &= ~marks[:-1]
    return begins
