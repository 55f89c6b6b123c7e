"""Layout of a text table from its first lines: separator, decimal mark, header, units.

`RULES` are tried in order on what is above the samples; the first that finds names gives the header.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from mckibben.errors import DataError
from mckibben.files.cells import Dialect
from mckibben.files.headers import is_standard, is_time
from mckibben.files.notices import warn
from mckibben.files.units import convert, find, find_listed

SEPARATORS = ("\t", ";", "|", ",", None)
"""Separators in order of preference; None is whitespace."""

Row = tuple[int, list[str]]
"""A line, counted from 0, and its cells."""

_IDENTIFIER = re.compile(r"[0-9A-F]{16,}")
_STATED = {
    mark: re.compile(
        r"(?<![A-Za-z])(?P<name>(?P<rate>(?:sampl(?:e|ing)|frame|scan|acquisition)[ _]?"
        r"(?:rate|freq(?:uency)?)|samples per second"
        r"|abtast(?:rate|frequenz)|(?:fréquence|taux) d'échantillonnage|frequenza di campionamento"
        r"|frecuencia de muestreo|frequência de amostragem|サンプリング(?:周波数|レート)|采样(?:频率|率)"
        r"|(?-i:fs|Fs|Trajectories|NO_OF_FRAMES[\s\S]*?\nFREQUENCY))"
        r"|sampl(?:e|ing)[ _]?(?:interval|increment|step|period)|sample[ _]?time"
        r"|abtast(?:zeit|intervall)|サンプリング(?:間隔|周期)|采样(?:间隔|周期)"
        r"|time[ _]?(?:interval|increment|step)|x[ _]?increment|delta[ _]?x|(?-i:dt|Ts))"
        r"\b[ \"]*[\[(]?(?P<in>[A-Za-zµμ]*)[\])]?[\s\",;:=|]+"
        rf"(?P<value>\d+(?:[{mark}]\d+)?(?:e[+-]?\d+)?)(?![.,']?\d)[ ]?(?P<unit>[A-Za-zµμ]*)",
        re.IGNORECASE,
    )
    for mark in ".,"
}
"""Decimal mark -> a rate or sample time: ``Sample Interval,4e-4``, ``sampling rate [kHz]: 2``."""


@dataclass(frozen=True)
class Layout:
    """First line of samples, counted from 0, the first below them, and the column names.

    A line of samples has at least ``least`` cells. ``rates`` are rates and sample times that the lines
    above state.
    """

    dialect: Dialect
    headers: list[str]
    units: list[str | None]
    first: int
    least: int
    stop: int | None = None
    rates: Mapping[str, float] = field(default_factory=dict)
    start_time: float = 0.0


LinesWithLayout = tuple[Sequence[bytes], Layout]
"""The lines of a text, and their layout."""


@dataclass(frozen=True)
class Names:
    """The names of columns, their units or blanks, and the line of names and the last of the header."""

    headers: list[str]
    units: Sequence[str]
    at: int = -1
    last: int = -1


@dataclass(frozen=True)
class Head:
    """What is above the samples: rows and comments; and the number of columns.

    The samples have ``width`` cells, of which the first ``used`` are not all blank.
    """

    dialect: Dialect
    width: int
    used: int
    above: Sequence[Row]
    comments: Sequence[Row]

    @cached_property
    def rows(self) -> list[Row]:
        """Rows of the samples' width, but for blanks at their ends; comments if no row has words."""
        rows, notes = (
            [
                (at, [*row[: self.width], *[""] * (self.width - len(row))])
                for at, row in each
                if len(row) >= self.used and not any(row[self.width :])
            ]
            for each in (self.above, self.comments)
        )
        return rows if any(self.dialect.balance(row) < 0 for _, row in rows) else notes


def units_alone(head: Head) -> Names | None:
    """Take a first row of units: the columns are called column_1, and known by their units."""
    at, row = head.rows[0] if head.rows else (-1, [])
    cells = [_bare(cell) for cell in row if cell]
    if len(cells) < 2 or not all(map(_is_unit, cells)) or max(map(len, row)) < 2:
        return None
    return Names(_numbered(head.width), row, at, at)


def named(head: Head) -> Names | None:
    """Take a row of words: that with the most standard channels, and of several the last."""
    return _named(head.rows, head)


def markers(head: Head) -> Names | None:
    """Take names of markers, each with three columns of samples, as Qualisys writes them."""
    for at, (first, *names) in head.above:
        if first == "MARKER_NAMES" and head.used - 3 * len(names) in (0, 2):
            before = ["Frame", "Time"] if head.used % 3 else []
            headers = [*before, *(f"{name} {axis}" for name in names for axis in "XYZ")]
            headers += [""] * (head.width - head.used)  # lines end with a separator
            return Names(headers, [""] * len(headers), at, at)
    return None


def longer(head: Head) -> Names | None:
    """Take a row with more names than the samples have columns: the last names have no samples.

    Some are known, or have units below; others may be a title.
    """
    rows_found = _named([(at, row) for at, row in head.above if len(row) > head.used], head)
    sure = rows_found and (any(rows_found.units) or _known(rows_found.headers[: head.used]))
    return rows_found if sure and head.dialect.separator else None


def numbered(head: Head) -> Names:
    """Count the columns; with names of another number above the samples they are refused."""
    shorter = [row for _, row in head.above if len(row) not in (1, head.width)]
    headers = shorter[-1] if shorter else _numbered(head.width)
    return Names(headers, [""] * len(headers))


RULES: tuple[Callable[[Head], Names | None], ...] = (units_alone, named, markers, longer, numbered)
"""Where names of columns are sought; the last always answers."""


def sniff(lines: Sequence[str], path: Path, separators: Sequence[str | None]) -> Layout:
    """Return the layout of a table; raise a `DataError` for comments and blanks only.

    Names behind those of the columns are settings of the device, as ``X,CH1,Start,Increment`` of a
    scope, with their values in the row of units.
    """
    head, first_sample = _head(lines, path, separators)
    names = next(names for rule in RULES if (names := rule(head)) is not None)
    if names.headers == _numbered(head.width) and not any(names.units):
        warn(path, f"no line of names: the columns are called column_1 to column_{head.width}")

    first = _with_damaged(head, names, first_sample)
    headers = _merged(names, head)
    settings = [*zip(headers, names.units, strict=True)][head.used :]
    text = "\n".join([*lines[:first], *(f"x {name} {cell}" for name, cell in settings if cell)])

    stated = _STATED[head.dialect.decimal].finditer(unicodedata.normalize("NFKC", text))
    start = dict(settings).get("Start", "")
    return Layout(
        head.dialect,
        headers,
        _units(names, headers, text),
        first,
        _least_cells(head, names, headers),
        rates=dict(filter(None, map(_stated, stated))),
        start_time=head.dialect.value(head.dialect.form(start)[1]) if start else 0.0,
    )


def _with_damaged(head: Head, names: Names, first: int) -> int:
    """Return the first line of samples, with those above it that have any value: damaged samples."""
    for at, row in reversed(head.above):
        fits = names.last >= 0 or len(row) == head.width
        if at > names.last and fits and any(map(head.dialect.is_value, row)):
            first = at
    return first


def _units(names: Names, headers: Sequence[str], text: str) -> list[str | None]:
    """Return the units of columns; positions of Motive have that stated above the table."""
    units = [_bare(cell) or None for cell in names.units]
    stated = re.search(r"Length Units\W+(\w+)", text)
    if stated is None:
        return units
    pairs = zip(headers, units, strict=True)
    return [stated[1] if "Position" in header else unit for header, unit in pairs]


def _least_cells(head: Head, names: Names, headers: Sequence[str]) -> int:
    """Return the smallest number of cells of a line of samples."""
    if names.at < 0:
        return len(headers)
    return head.width if any(headers[head.used : head.width]) else head.used


def _head(lines: Sequence[str], path: Path, separators: Sequence[str | None]) -> tuple[Head, int]:
    """Return what is above the samples, and their first line."""
    dialects = [Dialect(s, d) for s in separators for d in ".," if s != d]
    *_, width, dialect = max((_fitness(each, lines) for each in dialects), key=lambda fit: fit[:3])
    comments = [at for at, line in enumerate(lines) if dialect.is_comment(line)]
    filled = [at for at, line in enumerate(lines) if line.strip() and at not in comments]
    rows = [(at, dialect.split(lines[at], width)) for at in filled]
    if not rows:
        problem, remedy = "there is nothing in it", "give a file with a header and samples"
        raise DataError(problem, file=path, remedy=remedy)
    later = [row for _, row in rows[len(rows) // 2 :] if len(row) == width]
    solid = [i for i in range(width) if dialect.balance([row[i] for row in later]) > 0]
    used = max((i + 1 for i in range(width) if any(row[i] for row in later)), default=width)
    samples = [
        len(row) == width and dialect.balance([row[i] for i in solid]) > 0 for _, row in rows
    ]
    # one row of numbers between words is a part of the header
    n_above = next((k for k in range(len(rows)) if all(samples[k : k + 2])), int(not solid))
    first = [*filled, len(lines)][n_above]
    notes = [(at, dialect.split(lines[at].lstrip("#%/; \t"), width)) for at in comments]
    notes = [(at, row) for at, row in notes if at < first]
    return Head(dialect, width, used, rows[:n_above], notes), first


def _named(rows: Sequence[Row], head: Head) -> Names | None:
    """Return the names in rows, with the units in a row below them."""
    cells = [row[: head.used] for _, row in rows]
    units = [k for k in range(1, len(cells)) if _are_units(cells[k], cells[k - 1])]
    names = [
        k
        for k, row in enumerate(cells)
        if k not in units and (k + 1 in units or head.dialect.balance(row) < 0)
    ]
    if not names:
        return None
    best = max(names, key=lambda k: (_known(cells[k]), k))
    headers = rows[best][1]
    last = next((k for k in units if k > best), best)
    below = rows[last][1] if last > best else []
    stated = [*below, *[""] * (len(headers) - len(below))][: len(headers)]
    return Names(headers, stated, rows[best][0], rows[last][0])


def _merged(names: Names, head: Head) -> list[str]:
    """Return names that are repeated with those of merged cells above them, as ``M1 X``."""
    headers = names.headers
    for at, row in reversed(head.above):
        several = [name for name in headers if name and not is_time(name)]
        if len(set(several)) == len(several):
            break
        over = [cell.rpartition(":")[2] for cell in row]
        words = {cell for cell in over if cell}
        if at >= names.at or len(words) < 2 or len(row) > len(headers):
            continue
        if any(map(_IDENTIFIER.fullmatch, words)) or head.dialect.balance(row) >= 0:
            continue
        filled = [next(filter(None, reversed(over[: i + 1])), "") for i in range(len(headers))]
        both = zip(filled, headers, strict=True)
        headers = [name if not name or is_time(name) else f"{a} {name}".strip() for a, name in both]
    return headers


def _stated(match: re.Match[str]) -> tuple[str, float] | None:
    """Return a rate [Hz] or sample time [s] with its name; None if its unit is of another kind."""
    value, text = float(match["value"].replace(",", ".")), match["unit"] or match["in"]
    target = "Hz" if match["rate"] else "s"
    unit = find(text) if text else None
    if text and (unit is None or unit.target != target):
        return None
    name = " ".join(match["name"].rpartition("\n")[2].split())
    size = convert(np.array([value]), unit.name, target) if unit else [value]
    return f"{name}/{'sample_rate' if match['rate'] else 'dt'}", float(size[0])


def _fitness(dialect: Dialect, lines: Sequence[str]) -> tuple[float, bool, bool, int, Dialect]:
    """Return the fitness of a dialect: the number of numeric rows of one width.

    Then whether it cuts the row above these to that width, and whether it cuts at all.
    """
    texts = [line for line in lines if line.strip() and not dialect.is_comment(line)]
    rows = [dialect.split(text) for text in texts]
    shares = []
    for row in rows:
        forms = [form for cell in row if (form := dialect.form(cell)[0]) != "missing"]
        shares.append(sum(form not in ("text", "grouped") for form in forms) / max(len(forms), 1))

    def score(width: int) -> tuple[float, float]:
        alike = [share for row, share in zip(rows, shares, strict=True) if len(row) == width]
        return sum(share for share in alike if share > 0.5), sum(alike)

    width = max(dict.fromkeys(map(len, rows)), key=score, default=1)
    numbers, rest = score(width)
    first = next((k for k, row in enumerate(rows) if len(row) == width and shares[k] > 0.5), 0)
    fits = len(dialect.split(texts[first - 1] if first else "", width)) == width
    # the rest counts for titles, and tables with more words than numbers
    return round(numbers or rest / (1 + len(lines)), 6), fits, width > 1, width, dialect


def _are_units(row: Sequence[str], above: Sequence[str]) -> bool:
    """Return whether a row of words has units that are not names."""
    cells = [_bare(cell) for cell in row if cell]
    return _known(row) <= _known(above) and 2 * sum(map(_is_unit, cells)) >= len(cells)


def _is_unit(cell: str) -> bool:
    composed = find(cell) if re.search(r"[/*·^]", cell) else None
    return bool(find_listed(cell) or (composed and composed.target))


def _bare(cell: str) -> str:
    return cell.strip("[]() ")


def _known(row: Sequence[str]) -> int:
    """Return the number of standard channels that cells of a row name."""
    return len({cell for cell in row if is_standard(cell)})


def _numbered(width: int) -> list[str]:
    return [f"column_{i}" for i in range(1, width + 1)]
