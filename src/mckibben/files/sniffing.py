"""Layout of a text table from its first lines: encoding, separator, decimal mark, header, units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mckibben.errors import DataError
from mckibben.files.cells import Dialect
from mckibben.files.headers import foreign_words, is_standard
from mckibben.files.notices import warn
from mckibben.files.units import find, find_listed

SEPARATORS = ("\t", ";", "|", ",", None)
"""Separators in order of preference; None is whitespace."""

_ENCODINGS = ("cp1252", "cp932", "gb18030", "cp949", "latin-1")
_CONTROL = bytes([*range(0x09), *range(0x0E, 0x20), 0x7F])
_LOOKED_AT = 2**16  # bytes by which the encoding is recognised


@dataclass(frozen=True)
class Layout:
    """First line of samples, counted from 0, and the column names."""

    dialect: Dialect
    headers: list[str]
    units: list[str | None]
    first: int


def decoded(data: bytes, path: Path) -> bytes:
    """Return a text in UTF-8 with line feeds; raise a `DataError` for binary data."""
    start = data[:_LOOKED_AT]
    zeros = [start[at::2].count(0) * 4 > len(start) for at in (0, 1)]
    wide = "utf-16-be" if zeros[0] else "utf-16-le" if zeros[1] else "utf-8"
    try:
        text = data.decode("utf-16" if start.startswith((b"\xff\xfe", b"\xfe\xff")) else wide)
    except UnicodeDecodeError:
        text = _foreign(data, path)
    data = text.lstrip("\ufeff").rstrip("\x1a").encode()
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if len(data.translate(None, _CONTROL)) < len(data):
        better = "give the file the ending of its format, or export it as CSV"
        raise DataError("this is not text", file=path, remedy=better)
    return data


def _foreign(data: bytes, path: Path) -> str:
    """Decode text in a non-Unicode encoding: the one in which its header has words of `names`."""
    texts = {}
    for encoding in _ENCODINGS:
        with suppress(UnicodeDecodeError):
            texts[encoding] = data.decode(encoding)
    words = {encoding: foreign_words(text[:_LOOKED_AT]) for encoding, text in texts.items()}
    best = max(words, key=words.__getitem__)
    if not words[best]:
        warn(path, f"its encoding shows by no word; it was read as {best}, so names may be garbled")
    return texts[best]


def sniff(lines: Sequence[str], path: Path, separators: Sequence[str | None]) -> Layout:
    """Return the layout of a table; raise a `DataError` for comments and blanks only.

    The header is a row of words before the samples, or else a comment there: that with the most names
    of standard channels, and of several the last. Units are in the row below it.
    """
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
    samples = [
        len(row) == width and dialect.balance([row[i] for i in solid]) > 0 for _, row in rows
    ]
    # one row of numbers between words is a part of the header
    n_above = next((k for k in range(len(rows)) if all(samples[k : k + 2])), int(not solid))
    above, first = rows[:n_above], [*filled, len(lines)][n_above]
    for _, row in above:  # which may end with a separator that the samples lack, or lack theirs
        if len(row) == width + 1 and not row[-1]:
            row.pop()
        elif len(row) == width - 1 and not any(sample[-1] for sample in later):
            row.append("")
    heads = [(at, row) for at, row in above if len(row) == width]
    if not any(dialect.balance(row) < 0 for _, row in heads):
        notes = [(at, dialect.split(lines[at].lstrip("#%/; \t"), width)) for at in comments]
        heads = [(at, row) for at, row in notes if at < first and len(row) == width]
    units = [k for k in range(1, len(heads)) if _are_units(heads[k][1], heads[k - 1][1])]
    names = [
        k
        for k, (_, row) in enumerate(heads)
        if k not in units and (k + 1 in units or dialect.balance(row) < 0)
    ]
    best = max(names, key=lambda k: (_known(heads[k][1]), k), default=-1)
    last = heads[best + (best + 1 in units)][0] if names else -1  # line of the header
    for at, row in reversed(above):  # damaged samples
        if at > last and (names or len(row) == width) and any(map(dialect.is_value, row)):
            first = at
    others = [row for at, row in above if at < first and len(row) > 1]
    # without names, a header of more or fewer cells than the samples is refused with these
    headers = heads[best][1] if names else others[-1] if others else []
    if not headers:
        headers = [f"column_{i}" for i in range(1, width + 1)]
        warn(path, f"no line of names: the columns are called column_1 to column_{width}")
    stated = heads[best + 1][1] if best + 1 in units else [""] * len(headers)
    return Layout(dialect, headers, [cell.strip("[]() ") or None for cell in stated], first)


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
    cells = [cell.strip("[]() ") for cell in row if cell]
    found = [find_listed(cell) or (re.search(r"[/*·^]", cell) and find(cell)) for cell in cells]
    return _known(row) <= _known(above) and 2 * sum(map(bool, found)) >= len(cells)


def _known(row: Sequence[str]) -> int:
    """Return the number of cells in a row that name a standard channel."""
    return sum(map(is_standard, row))
