"""Text tables: CSV, TSV and their kin, with any common separator and decimal mark.

What this package writes is a plain header of channel names and, beside the file, a sidecar
``NAME.csv-metadata.json`` (named as in W3C's "CSV on the Web") with units, time grid and meta.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import stored
from mckibben.files.instants import may_be_instant
from mckibben.files.notices import PLAIN, listed, warn
from mckibben.files.sniffing import MISSING, NUMBER, SEPARATORS, Dialect, Layout, decoded, sniff
from mckibben.files.stored import Stored
from mckibben.files.table import Column, Flaw, Table
from mckibben.recording import Recording
from mckibben.system.atomic import replacing
from mckibben.system.manifest import digest
from mckibben.system.ordinary import DESCRIPTION, read_bytes

Places = NDArray[np.int64]

MOST_COLUMNS = 4096
LONGEST = 2**18
"""Bytes of a line."""

_SNIFFED, _SNIFFED_BYTES = 400, 2**18
_SAID = re.compile(rb"\A\"?sep=([\t;|,])\"?[ \t;|,]*\n", re.IGNORECASE)
"""A first line that names the separator to Excel."""

_AROUND = b' \t\v\f"'  # cells
_BETWEEN = np.isin(np.arange(256), list(b" \t\n"))
_FIRST = 1000  # samples that are looked at first: few columns need more
_SHOWN = 5  # cells of a column of text, where they are no times

_GROUPED = re.compile(
    r"[+-]?\d{1,3}(?P<mark>[.,'’`_ \xa0\u2009\u202f])(?:\d{2,3}(?P=mark))*\d{3}(?:[.,]\d*)?"
    r"|[+-]?\d*[.,]\d+",  # a number with the other decimal mark
    re.ASCII,
)
_HEXADECIMAL = re.compile(r"[+-]?0[xX][0-9a-fA-F]+")
_MARKS = (
    "write numbers without marks between thousands, with one decimal mark in the whole file, and "
    "whole numbers with it too, such as 2.0 for 2"
)
_CELL = "correct that cell, or leave it blank and say --gaps split or interpolate"


def sidecar(path: Path) -> Path:
    """Return where the description of a text file lies.

    >>> sidecar(Path("run.csv")).name
    'run.csv-metadata.json'
    """
    return path.with_name(f"{path.name}-metadata.json")


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the table of a text file."""
    data = file.read()
    description = _described(path, data)
    if description is not None:
        return [_own(data, description)]
    return [parsed(decoded(data, path), path)]


def write(recording: Recording, path: Path) -> None:
    """Write a recording as text, and its description beside it."""
    # 1.38, not 1.3800000000000001: the description has the exact step
    time = {} if recording.sample_time is None else {"time": recording.time.round(12)}
    columns = {**time, **recording.channels}
    separator = "\t" if path.suffix.casefold() == ".tsv" else ","
    text = io.StringIO()
    csv.writer(text, delimiter=separator, lineterminator="\n").writerow(columns)
    row = separator.join(["%r"] * len(columns)) + "\n"
    text.writelines(
        row % cells for cells in zip(*map(np.ndarray.tolist, columns.values()), strict=True)
    )
    data = text.getvalue().encode()
    description = Stored.describe(recording, data, path).to_json(path) + "\n"
    with replacing(path) as new:
        new.write_bytes(data)
    with replacing(sidecar(path)) as new:
        new.write_text(description, encoding="utf-8")


def _described(path: Path, data: bytes) -> Stored | None:
    """Return the sidecar's description, if there is one and it is of these bytes."""
    beside = sidecar(path)
    if not os.path.lexists(beside):
        return None
    try:
        description = stored.parse(read_bytes(beside, most=DESCRIPTION))
    except DataError as error:
        description = error.problem
    if isinstance(description, str):
        problem = f"is not a description by this package ({description})"
    elif description.sha256 != digest(data):
        problem = "describes another version of the file"
    elif all(
        next(csv.reader([_header(data)], delimiter=mark), []) != _columns_of(description)
        for mark in "\t,"
    ):
        problem = "names other columns than the file"
    else:
        return description
    warn(beside, f"it {problem}; it is ignored, and units are taken from the header")
    return None


def _header(data: bytes) -> str:
    return data.partition(b"\n")[0].decode("utf-8", "replace")


def _columns_of(description: Stored) -> list[str]:
    return [*([] if description.sample_time is None else ["time"]), *description.units]


def _own(data: bytes, description: Stored) -> Table:
    names = _columns_of(description)
    separator = "\t" if "\t" in _header(data) else ","
    frame = _frame(data, Dialect(separator, "."), names, skiprows=1, dtype=np.float64)
    return description.table({name: frame[name].to_numpy() for name in description.units})


def _frame(data: bytes, dialect: Dialect, names: Sequence[Any], **options: Any) -> Any:
    """Return a frame of cells, all decimals read to the last bit."""
    import pandas as pd

    major, minor = pd.__version__.split(".")[:2]
    if (int(major), int(minor)) < (3, 1):  # which does so unasked
        options["float_precision"] = "round_trip"
    return pd.read_csv(
        io.BytesIO(data),
        sep=r"\s+" if dialect.separator is None else dialect.separator,
        decimal=dialect.decimal,
        header=None,
        names=list(names),
        index_col=False,
        skipinitialspace=True,
        **options,
    )


def parsed(data: bytes, path: Path, separators: Sequence[str | None] = SEPARATORS) -> Table:
    """Return the table in a text in UTF-8, whose lines line feeds end.

    Parameters
    ----------
    data : bytes
    path : Path
    separators : sequence of str or None
        What may be between its cells; None is blanks.
    """
    said = _SAID.match(data)
    if said is not None:  # so that lines have the same numbers
        separators = (said[1].decode(),)
        data = b" " * (said.end() - 1) + data[said.end() - 1 :]
    start = data[: 4 * LONGEST].decode("utf-8", "replace").split("\n")
    start = start[: max(4, data.count(b"\n", 0, _SNIFFED_BYTES))][:_SNIFFED]
    layout = sniff(start, separators)
    if layout is None:
        problem, remedy = "there is nothing in it", "give a file with a header and samples"
        raise DataError(problem, file=path, remedy=remedy)
    if not layout.headers:
        warn(path, f"no line of names: the columns are called column_1 to column_{layout.width}")
    return block(data, layout, path)


@dataclass(frozen=True)
class _Lines:
    """Lines of samples, without blank ones and comments, and where their cells are.

    Parameters
    ----------
    data : bytes
    numbers, ends, upto : numpy.ndarray of int, shape (n,)
        Of each line: its number as an editor counts, its line feed, and all cells up to there.
    starts, stops : numpy.ndarray of int
        Of all cells, with the blanks around them.
    """

    data: bytes
    numbers: Places
    ends: Places
    upto: Places
    starts: Places
    stops: Places


def block(data: bytes, layout: Layout, path: Path, stop: int | None = None) -> Table:
    """Return the table of the samples of a text, from the line where they begin on.

    Parameters
    ----------
    data : bytes
        UTF-8.
    layout : Layout
        Where the last column has no header, lines may end before it.
    path : Path
    stop : int, optional
        The line, counted from 0, before which they end.
    """
    headers = layout.headers or [f"column_{i}" for i in range(1, layout.width + 1)]
    if len(headers) > MOST_COLUMNS:
        raise DataError(
            f"{len(headers)} columns are more than the {MOST_COLUMNS} that are read",
            file=path,
            remedy="save the channels needed alone, each as one column",
        )
    dialect, places = layout.dialect, range(len(headers))
    lines = _rectangular(_lines(data, layout, path, stop), headers, path)
    frame = _frame(lines.data, dialect, places, na_values=list(MISSING), low_memory=False)
    if len(frame) != lines.numbers.size:  # so that no sample has the number of another line
        raise DataError("its lines are not those of a table", file=path, remedy="export it again")
    columns: list[Column] = []
    unread: dict[str, str] = {}
    decimals: dict[str, str] = {}  # column -> a number that has three digits after the mark, as all
    shown = False
    for i, unit in zip(places, layout.units or [None] * len(headers), strict=True):
        cells, name = frame[i], headers[i] or f"column_{i + 1}"
        if cells.isna().all():
            if headers[i]:
                columns.append(Column(name, None, unit, texts=[""]))
                unread[name] = "no number in it"
        elif cells.dtype.kind in "iufb":
            values, flaw = cells.to_numpy(np.float64), None
            doubt = _doubt(i, values, lines, dialect) if cells.dtype.kind == "f" else None
            if doubt is None:
                shown = shown or bool(np.any(np.isfinite(values) & (values != np.rint(values))))
            elif doubt[2]:
                decimals[name] = doubt[1]
            else:
                values, flaw = np.full(values.size, np.nan), _two_ways(name, *doubt[:2])
            columns.append(Column(name, values, unit, flaw=flaw))
        else:
            columns.append(_irregular(name, unit, cells, dialect))
            first = next((text for text in columns[-1].texts if text), "")
            if columns[-1].values is None and not may_be_instant(first):
                unread[name] = f"text, such as {first[:40]!r}"
    if decimals:
        names, cell = listed([repr(name) for name in decimals], 10), next(iter(decimals.values()))
        mark = dialect.decimal
        warn(
            path,
            f"all numbers of column(s) {names} have three digits after the mark {mark!r}, which was "
            f"taken for the decimal mark: {cell} is {float(cell.replace(mark, '.')):.6g}, "
            f"not {cell.replace(mark, '')}{PLAIN if shown else ''}",
        )
    return Table(tuple(columns), lines=lines.numbers, unread=unread)


def _lines(data: bytes, layout: Layout, path: Path, stop: int | None) -> _Lines:
    """Return the lines of samples; `DataError` if there are none or a quotation mark is open."""
    if not data.endswith(b"\n"):
        data += b"\n"
    dialect, signs = layout.dialect, np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(signs == ord("\n"))[:stop]
    starts = np.concatenate([[0], ends[:-1] + 1])
    longest = int(np.argmax(ends - starts))
    if ends[longest] - starts[longest] > LONGEST:
        raise DataError(
            f"the line has {ends[longest] - starts[longest]} bytes, more than {LONGEST}",
            file=path,
            row=longest + 1,
            remedy="give a table with a line for each sample and a column for each channel",
        )
    starts, ends = starts[layout.first :], ends[layout.first :]
    text, _ = _trimmed(signs, starts, ends, b" \v\f" if dialect.separator == "\t" else b" \t\v\f")
    filled = text < ends
    for k in np.flatnonzero(np.isin(signs[text], list(b"#%/;"))).tolist():
        filled[k] = not dialect.is_comment(data[starts[k] : ends[k]].decode("utf-8", "replace"))
    nothing, last = _AROUND + (dialect.separator or " ").encode(), filled.size
    while last and not (
        filled[last - 1] and data[starts[last - 1] : ends[last - 1]].strip(nothing)
    ):
        last -= 1  # separators alone, with which spreadsheets end
    if not last:
        remedy = "give a file with samples"
        raise DataError("there is a header and no samples", file=path, remedy=remedy)
    starts, ends, filled = starts[:last], ends[:last], filled[:last]
    numbers = np.flatnonzero(filled) + layout.first + 1
    body = data[starts[0] : ends[-1] + 1]
    if numbers.size < last:
        inside = np.repeat(filled, ends - starts + 1)
        body = np.frombuffer(body, np.uint8)[inside].tobytes()
    body = body.replace("−".encode(), b"-")
    signs = np.frombuffer(body, np.uint8)
    ends = np.flatnonzero(signs == ord("\n"))
    quoted = np.zeros(1, dtype=bool)
    if b'"' in body:
        quoted = np.logical_xor.accumulate(signs == ord('"'))
    if quoted.size > 1 and quoted[ends].any():
        raise DataError(
            "a quotation mark is not closed",
            file=path,
            row=int(numbers[np.argmax(quoted[ends])]),
            remedy="close it, and keep line breaks out of cells",
        )
    if dialect.separator is None:
        cell = ~_BETWEEN[signs] | quoted
        before = np.concatenate([[False], cell[:-1]])
        starts, stops = np.flatnonzero(cell & ~before), np.flatnonzero(before & ~cell)
    else:
        between = (signs == ord(dialect.separator)) | (signs == ord("\n"))
        stops = np.flatnonzero(between & ~quoted)
        starts = np.concatenate([[0], stops[:-1] + 1])
    upto = np.searchsorted(stops, ends, side="right")
    return _Lines(body, numbers, ends, upto, starts, stops)


def _rectangular(lines: _Lines, headers: Sequence[str], path: Path) -> _Lines:
    """Return the lines, which have a cell for each header, without words that end the file."""
    found = np.diff(lines.upto, prepend=0)
    wrong = np.flatnonzero((found > len(headers)) | (found < len(headers) - (not headers[-1])))
    if not wrong.size:
        return lines
    at = int(wrong[0])
    begin = int(lines.ends[at - 1]) + 1 if at else 0
    rest = lines.data[begin : begin + LONGEST]
    if at and len(lines.data) - begin < LONGEST and not re.search(rb"\d", rest):
        words = " ".join(rest.decode("utf-8", "replace").split())[:60]
        warn(path, f"from row {lines.numbers[at]} on there are words alone, left out: {words!r}")
        n = lines.upto[at - 1]
        whole = (lines.numbers[:at], lines.ends[:at], lines.upto[:at])
        return _Lines(lines.data[:begin], *whole, lines.starts[:n], lines.stops[:n])
    raise DataError(
        f"there are {found[at]} cells where the header has {len(headers)}",
        file=path,
        row=int(lines.numbers[at]),
        remedy="complete or delete that line",
    )


def _trimmed(
    signs: NDArray[np.uint8], starts: Places, stops: Places, blanks: bytes
) -> tuple[Places, Places]:
    """Return where texts are without the blanks around them."""
    blank = np.isin(np.arange(256), list(blanks))
    starts, stops = starts.copy(), stops.copy()
    for ends, step in ((starts, 1), (stops, -1)):
        left = np.flatnonzero(starts < stops)
        while left.size:
            left = left[blank[signs[ends[left] - (step < 0)]]]
            ends[left] += step
            left = left[starts[left] < stops[left]]
    return starts, stops


def _irregular(name: str, unit: str | None, cells: Any, dialect: Dialect) -> Column:
    """Return a column of which some cells are no plain numbers."""
    import pandas as pd

    codes, found = pd.factorize(cells)
    words = [*(str(word).strip() for word in found), ""]  # the last for cells that are missing
    number = re.compile(NUMBER[dialect.decimal], re.ASCII)
    united = re.compile(rf"({number.pattern})\s*([A-Za-z°%µμΩ]\D*\d?)", re.ASCII)
    first = words[codes[int(np.argmax(codes >= 0))]]
    if may_be_instant(first) and not united.fullmatch(first):
        return Column(name, None, unit, texts=[words[code] for code in codes])
    forms = {"number": number, "hexadecimal": _HEXADECIMAL, "grouped": _GROUPED, "united": united}
    kinds = np.array(
        [next((kind for kind, form in forms.items() if form.fullmatch(w)), "text") for w in words]
    )[codes]
    filled = np.array([bool(word) for word in words])[codes]
    counts = {kind: int(np.count_nonzero(kinds == kind)) for kind in forms}
    if 2 * sum(counts.values()) <= np.count_nonzero(filled):
        return Column(name, None, unit, texts=[words[code] for code in codes[:_SHOWN]])
    usual = max(counts, key=lambda kind: counts[kind])
    parts = {word: united.fullmatch(word) for word in words if usual == "united"}
    units = [match[2] if match else "" for match in (parts.get(word) for word in words)]
    said = unit or next(filter(None, units), None)
    wrong, problem = filled & (kinds != usual), "is not written as others are"
    if counts["grouped"]:
        wrong, problem = kinds == "grouped", "may mean several numbers"
    elif usual == "number":
        problem = "is not a number"
    elif usual == "united" and not wrong.any():
        wrong, problem = filled & (np.array(units)[codes] != said), f"is not in {said!r}"
    if wrong.any():
        at, remedy = int(np.argmax(wrong)), _MARKS if counts["grouped"] else _CELL
        flaw = Flaw(at, f"{words[codes[at]][:40]!r} {problem}", remedy)
        return Column(name, np.full(codes.size, np.nan), unit, flaw=flaw)
    plain = (match[1] if (match := parts.get(word)) else word for word in words)
    base = 16 if usual == "hexadecimal" else None
    values = [_number(word, dialect.decimal, base) for word in plain]
    return Column(name, np.array(values)[codes], said if usual == "united" else unit)


def _number(word: str, decimal: str, base: int | None) -> float:
    if not word:
        return np.nan
    return float(word.replace(decimal, ".") if base is None else int(word, base))


def _doubt(
    place: int, values: Array, lines: _Lines, dialect: Dialect
) -> tuple[int, str, bool] | None:
    """Return a number of a column whose mark may be of thousands, if no other shows that it is not.

    "1,000" is a thousand to some and one to others. A mark is for decimals where a number shows it: by
    another count of digits after it than three, more than three before it, or a zero there.

    Returns
    -------
    (int, str, bool) or None
        The first such sample, counted from 0, as written, and whether all are: then they are decimals.
    """
    if not (_no_proof(values[:_FIRST]) and _no_proof(values)):
        return None
    signs, mark = np.frombuffer(lines.data, np.uint8), ord(dialect.decimal)
    at = np.concatenate([[0], lines.upto[:-1]]) + place
    there = np.flatnonzero(at < lines.upto)  # lines may end before the last column
    starts, stops = _trimmed(signs, lines.starts[at[there]], lines.stops[at[there]], _AROUND)
    marks = np.flatnonzero(signs == mark)
    marked = np.searchsorted(marks, starts) < np.searchsorted(marks, stops)
    there, starts, stops = there[marked], starts[marked], stops[marked]
    first = starts + np.isin(signs[starts], list(b"+-"))
    alike = (stops - first >= 5) & (stops - first <= 7) & (signs[stops - 4] == mark)
    alike &= signs[first] != ord("0")
    for digit in (first, stops - 1, stops - 2, stops - 3):
        alike &= (signs[digit] >= ord("0")) & (signs[digit] <= ord("9"))
    if not alike.size or not alike.all():
        return None
    cell = lines.data[starts[0] : stops[0]].decode()
    return int(there[0]), cell, alike.size == np.count_nonzero(np.isfinite(values))


def _no_proof(values: Array) -> bool:
    """Return whether no number shows by its value alone that its mark is for decimals."""
    sizes = np.abs(values[np.isfinite(values)])
    fractions = sizes[sizes != np.rint(sizes)]
    if not fractions.size:
        return True
    if fractions.min() < 1 or fractions.max() >= 1000:
        return False
    return bool(np.all(np.abs(1000 * fractions - np.rint(1000 * fractions)) < 1e-6))


def _two_ways(header: str, sample: int, cell: str) -> Flaw:
    whole = re.sub("[.,]", "", cell)
    return Flaw(
        sample,
        f"in column {header!r}, {cell!r} may be a number with decimals or {whole}, since others in it "
        "have no mark",
        _MARKS,
    )
