"""Instants as people and programs write them: ISO 8601, day or month first, or the time of day alone."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.table import Table

_CLOCK = r"(?P<clock>\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d{1,9})?)?)(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?"
_DAY = re.compile(
    r"(?P<first>\d{1,2})(?P<mark>[./-])(?P<second>\d{1,2}|[A-Za-z]{3})(?P=mark)(?P<year>\d{4}|\d{2})"
    rf"(?:[ T,]\s*{_CLOCK})?",
    re.ASCII,
)
_TIME = re.compile(_CLOCK, re.ASCII)
_BEGINNING = re.compile(
    r"\d{4}\D?\d\d|\d{1,2}[./-](?:\d{1,2}|[A-Za-z]{3})[./-]\d{2}|\d{1,2}:\d\d", re.ASCII
)


_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


def may_be_instant(text: str) -> bool:
    """Tell whether a text begins like an instant.

    >>> [may_be_instant(text) for text in ("2026-01-31", "31.1.26 12:00", "12:00:00", "up", "1.5")]
    [True, True, True, False, False]
    """
    return _BEGINNING.match(text) is not None


def seconds(texts: Sequence[str], table: Table, path: Path) -> Array:
    """Return instants as seconds since the first.

    Parameters
    ----------
    texts : sequence of str
        All in one form: ISO 8601, with a zone or without; ``31.12.2026 12:00:00.5`` or
        ``31-Dec-2026 12:00:00.5`` (the day first);
        ``12/31/2026 12:00:00.5`` (with the day first or the month, as the numbers show); or
        ``12:00:00.5`` alone.

    Raises
    ------
    DataError
        On a text that is none, naming the row; or where the day cannot be told from the month and
        the result depends on it.
    """
    first = next((text for text in texts if text), "")
    form = next((each for each in (_DAY, _TIME) if each.fullmatch(first)), None)
    instants = _iso(texts) if form is None else _matched(texts, form, table, path)
    bad = np.flatnonzero(np.isnat(instants))
    if bad.size:
        raise DataError(
            f"{texts[bad[0]][:40]!r} is no time"
            + ("" if form is None or bad[0] == 0 else f" as {first[:40]!r} is"),
            file=path,
            channel="time",
            row=table.row(int(bad[0])),
            remedy="write times in seconds or as 2026-01-31T12:00:00.5, or give --rate",
        )
    return (instants - instants[0]).astype(np.float64) * 1e-9


def _iso(texts: Sequence[str]) -> NDArray[np.datetime64]:
    import pandas as pd

    found = pd.to_datetime(
        pd.Series(texts).str.replace(",", "."), format="ISO8601", utc=True, errors="coerce"
    )
    return found.dt.tz_localize(None).to_numpy("datetime64[ns]")


def _matched(
    texts: Sequence[str], form: re.Pattern[str], table: Table, path: Path
) -> NDArray[np.datetime64]:
    matches = [form.fullmatch(text) for text in texts]
    found = [match for match in matches if match is not None]
    day_first = form is _TIME or _day_first(found, table, path)
    return np.array(
        [None if match is None else _instant(match, day_first) for match in matches],
        dtype="datetime64[ns]",
    )


def _day_first(found: Sequence[re.Match[str]], table: Table, path: Path) -> bool:
    """Tell whether the day is before the month: where no number shows it, after dots it is."""
    if any(match["second"].isalpha() for match in found):
        return True
    firsts = {int(match["first"]) for match in found}
    seconds_ = {int(match["second"]) for match in found}
    if found[0]["mark"] == "." or max(firsts) > 12:
        return True
    if max(seconds_) > 12:
        return False
    days = {(match["first"], match["second"], match["year"]) for match in found}
    if len(days) > 1 and any(int(one) != int(other) for one, other, _ in days):
        raise DataError(
            f"{found[0].group()[:40]!r} may have the day first or the month",
            file=path,
            channel="time",
            row=table.row(0),
            remedy="write dates as 2026-01-31, or with the day first and dots as in 31.01.2026; or "
            "give --rate",
        )
    return True  # of one day, only the time of day matters


def _instant(match: re.Match[str], day_first: bool) -> np.datetime64 | None:
    groups = match.groupdict()
    hour, minute, second = f"{groups['clock'] or '00:00'}:00".replace(",", ".").split(":")[:3]
    hours = int(hour)
    if groups["half"] is not None:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + (12 if groups["half"] in "pP" else 0)
    day = "1970-01-01"
    if "year" in groups:
        year = groups["year"] if len(groups["year"]) == 4 else f"20{groups['year']}"
        one, other = groups["first"], groups["second"]
        one, other = (one, other) if day_first else (other, one)
        name = other.casefold()
        month = _MONTHS.index(name) + 1 if name in _MONTHS else 0 if name.isalpha() else int(other)
        day = f"{year}-{month:02d}-{int(one):02d}"
    try:
        return np.datetime64(f"{day}T{hours:02d}:{minute}:{second}", "ns")
    except ValueError:
        return None
