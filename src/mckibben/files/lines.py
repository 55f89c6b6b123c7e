"""Lines of samples in a text table: those that are none are left out, counted and noted."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Mask, Rows
from mckibben.errors import DataError
from mckibben.files.headers import is_time, parse
from mckibben.files.instants import may_be_instant
from mckibben.files.notices import warn
from mckibben.files.sniffing import Layout
from mckibben.files.units import find

LARGEST_SHARE_SKIPPED = 0.1
"""Largest share of lines with digits that are no samples; a file with more is refused."""


def samples(rows: Sequence[bytes], layout: Layout, path: Path) -> tuple[list[int], list[bytes]]:
    """Return the numbers of the lines of samples, counted from 1, and their text.

    Blank lines, comments and what is below the table are left out; so are words and lines that were
    cut off, but of samples without times, which become missing samples.

    Raises
    ------
    DataError
        If there are none, a quotation mark is not closed, or too many have other numbers of cells.
    """
    numbers, timed = np.array(_filled(rows, layout, path)), _is_timed(rows, layout)
    lines = np.array(rows, dtype=object)[numbers - 1]
    counts, begins = _measured(lines, numbers, layout, path)
    wrong = (counts > len(layout.headers)) | (counts < layout.least)
    end = _end(lines, numbers, begins & ~wrong, len(layout.headers), path)
    numbers, lines, begins, wrong = numbers[:end], lines[:end], begins[:end], wrong[:end]
    if 2 * begins.sum() >= begins.size:
        wrong[[k for k in np.flatnonzero(~begins) if _is_of_words(lines[k], layout)]] = True
    _refuse_many(wrong, lines, numbers, counts, layout, path)
    lost = wrong & begins & (not timed)
    _note(lost, "damaged, and read as missing samples", lines, numbers, path)
    _note(wrong & ~lost, "no samples, and left out", lines, numbers, path)
    lines[lost] = (layout.dialect.separator or " ").encode().join([b"nan"] * layout.least)
    numbers, lines = numbers[~wrong | lost], lines[~wrong | lost]
    if not timed and layout.stop is None and numbers[-1] - numbers[0] >= len(numbers):
        warn(path, "blank or other lines are left out: without times, what follows moves up")
    return numbers.tolist(), lines.tolist()


def _filled(rows: Sequence[bytes], layout: Layout, path: Path) -> list[int]:
    """Return the numbers of the lines that are not blank, nor comments, nor separators at the end."""
    separator = (layout.dialect.separator or " ").encode()
    blanks = rb" \v\f" if separator == b"\t" else rb" \t\v\f"
    skipped = re.compile(rb"[%s]*(?:$|%s)" % (blanks, layout.dialect.comment.encode())).match
    below = rows[layout.first : layout.stop]
    numbers = [k for k, row in enumerate(below, layout.first + 1) if not skipped(row)]
    while numbers and not rows[numbers[-1] - 1].strip(b' \t\v\f"' + separator):
        numbers.pop()
    if not numbers:
        remedy = "give a file with samples"
        raise DataError("there is a header and no samples", file=path, remedy=remedy)
    return numbers


def _measured(
    lines: Sequence[bytes], numbers: Rows, layout: Layout, path: Path
) -> tuple[NDArray[np.int64], Mask]:
    """Return the number of cells of every line, and whether it begins with a number or a blank cell."""
    joined, mark = b"\n".join(lines), (layout.dialect.separator or " ").encode()
    slowly = re.compile(rb'[ "]*(?:[-+.]?\d|%s)' % re.escape(mark)).match
    text = np.frombuffer(joined, np.uint8)
    starts = np.concatenate([[0], np.flatnonzero(text == ord("\n")) + 1])
    begins = (text[starts] - ord("0") < 10) | (text[starts] == ord(mark))
    begins[[k for k in np.flatnonzero(~begins) if slowly(lines[k])]] = True
    if b'"' in joined:
        joined = re.sub(rb'"[^"\n]*"', b"_", joined)
        lines, text = joined.split(b"\n"), np.frombuffer(joined, np.uint8)
        for number, line in zip(numbers, lines, strict=True):
            if b'"' in line:
                problem, remedy = "a quotation mark is not closed", "write no line breaks in cells"
                raise DataError(problem, file=path, row=number, remedy=remedy)
    if layout.dialect.separator is None:
        return np.array([len(line.split()) for line in lines]), begins
    ends = np.append(np.flatnonzero(text == ord("\n")), text.size)
    cells = np.searchsorted(np.flatnonzero(text == ord(mark)), ends)
    return np.diff(cells, prepend=0) + 1, begins


def _end(lines: Sequence[bytes], numbers: Rows, sound: Mask, width: int, path: Path) -> int:
    """Return the number of lines before words behind a blank line, such as "Maximum", with a note.

    Unless a good part of the samples follows.
    """
    named = re.compile(rb"[\s\"]*[A-Za-z\x80-\xff]").match
    if named(lines[0]):
        return len(lines)
    separators = re.compile(rb"[\s\",;|]*$").match
    short = np.flatnonzero(np.fromiter(map(len, lines), np.intp) <= 2 * width)
    blank = [int(k) for k in short if separators(lines[k])]
    behind = np.union1d(np.flatnonzero(np.diff(numbers) > 1), blank).astype(np.intp) + 1
    so_far = np.cumsum(sound)
    for at in map(int, behind[behind < len(lines)]):
        if named(lines[at]) and so_far[-1] - so_far[at] <= LARGEST_SHARE_SKIPPED * so_far[at]:
            line = lines[at].decode("utf-8", "replace")
            warn(path, f"from row {numbers[at]} on it is no table, left out: {line[:60]!r}")
            while separators(lines[at - 1]):
                at -= 1
            return at
    return len(lines)


def _is_of_words(line: bytes, layout: Layout) -> bool:
    """Return whether a line begins with a word and has more words than numbers."""
    cells = layout.dialect.split(line.decode("utf-8", "replace"), len(layout.headers))
    first = next(filter(None, cells), "")
    return layout.dialect.balance([first]) < 0 and layout.dialect.balance(cells) < 0


def _refuse_many(
    wrong: Mask,
    lines: Sequence[bytes],
    numbers: Rows,
    counts: NDArray[np.int64],
    layout: Layout,
    path: Path,
) -> None:
    """Raise an error if many lines with digits are no samples."""
    digits = [int(k) for k in np.flatnonzero(wrong) if re.search(rb"\d", lines[k])]
    if len(digits) <= max(1, LARGEST_SHARE_SKIPPED * len(lines)) and not wrong.all():
        return
    at = digits[0] if digits else 0
    problem = f"there are {counts[at]} cells where the header has {len(layout.headers)}"
    if len(digits) > 1:
        problem += f", and so in {len(digits)} of {len(lines)} lines"
    remedy = "complete or delete such lines, or give the line of names with `header`"
    raise DataError(problem, file=path, row=numbers[at], remedy=remedy)


def _note(some: Mask, flaw: str, lines: Sequence[bytes], numbers: Rows, path: Path) -> None:
    if some.any():
        first = int(some.argmax())
        text = " ".join(lines[first].decode("utf-8", "replace").split())[:60]
        warn(path, f"{some.sum()} line(s) are {flaw}, the first in row {numbers[first]}: {text!r}")


def _is_timed(rows: Sequence[bytes], layout: Layout) -> bool:
    """Return whether a column has times, by its name, its unit, or its cells."""
    units = zip(layout.headers, layout.units, strict=True)
    units_found = [find(text) for h, u in units if (text := u or parse(h).unit)]
    cells = layout.dialect.split(rows[layout.first].decode("utf-8", "replace"))
    seconds = any(unit is not None and unit.target == "s" for unit in units_found)
    instants = (may_be_instant(cell) and not layout.dialect.form(cell)[1] for cell in cells)
    return seconds or any(map(is_time, layout.headers)) or any(instants)
