"""Instants: ISO 8601, day or month first, or the time of day alone."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.files.request import Source

_FORM = (
    r"(?:(?P<first>\d{4}|\d{1,2})(?P<mark>[./-])(?P<second>\d{1,2}|[A-Za-z]{3})(?P=mark)"
    r"(?P<third>\d{4}|\d{1,2})(?:[ T,]\s*(?=\d)|$))?"
    r"(?P<clock>\d{1,2}:\d{2})?(?::(?P<whole>\d{2})(?:[.,:](?P<part>\d{1,9}))?)?"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)? ?(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2})?$"
)
_MINUTES = re.compile(r"(\d{1,2}):(\d{2}[.,]\d+)", re.ASCII)
"""Minutes and seconds of a stopwatch, ``12:58.000``."""
_BEGINNING = re.compile(
    r"\d{4}\D?\d\d|\d{1,2}[./-](?:\d{1,2}|[A-Za-z]{3})[./-]\d{2}|\d{1,2}:\d\d", re.ASCII
)


def may_be_instant(text: str) -> bool:
    """Return whether a text starts like an instant.

    >>> [may_be_instant(text) for text in ("2026-01-31", "31.1.26 12:00", "12:00:00", "up", "1.5")]
    [True, True, True, False, False]
    """
    return _BEGINNING.match(text) is not None


def seconds(texts: Sequence[str], source: Source) -> tuple[Array, str | None]:
    """Return instants as seconds since the first, NaN where blank; and the first as ISO 8601.

    Minutes and seconds are no instants: there is no first.

    Parameters
    ----------
    texts : sequence of str
        All in one form: ISO 8601, ``31.12.2026 12:00:00.5``, ``31-Dec-2026 12:00``,
        ``2026/12/31 12:00:00,5``, ``12/31/2026 12:00`` (with the day first or the month, as the
        numbers show), or ``12:00:00.5`` alone; with a zone or without.

    Raises
    ------
    DataError
        On a text that is none, or where the result depends on whether the day is first.
    """
    import pandas as pd

    cells = pd.Series(list(texts), dtype=object)
    first = next((text for text in texts if text), "")
    if _MINUTES.fullmatch(first):
        return _of_minutes(texts, source), None
    form = re.match(_FORM, first, re.ASCII)
    if form is None or (form["mark"] == "-" and len(form["first"]) == 4):
        form, patterns = None, ["ISO8601"]
        cells = cells.str.replace(",", ".").str.replace(r" ?(?:UTC|GMT)$", "Z", regex=True)
    else:
        cells, patterns = _in_one_form(cells.str.extract(_FORM, flags=re.ASCII), form)
    zoned = form is None or form["zone"] is not None
    parsings = []
    for pattern in patterns:
        read = pd.to_datetime(cells, format=pattern, errors="coerce", utc=zoned)
        parsings.append((read.dt.tz_localize(None) if zoned else read).to_numpy("datetime64[ns]"))
    instants, *alternatives = sorted(parsings, key=lambda each: np.isnat(each).sum())
    blank = np.array([not text for text in texts])
    bad = np.flatnonzero(np.isnat(instants) & ~blank)
    if bad.size:
        like = "" if form is None or bad[0] == 0 else f" as {first[:40]!r} is"
        problem = f"{texts[bad[0]][:40]!r} is no time{like}"
        remedy = "write times in seconds or as 2026-01-31T12:00:00.5, or give `rate`"
        raise source.error(problem, remedy, "time", int(bad[0]))
    at = int(np.argmin(blank))  # the first with a time
    elapsed = (instants - instants[at])[~blank]
    for alternative in alternatives:
        found_else = (alternative - alternative[at])[~blank]
        if not np.isnat(found_else).any() and np.any(found_else != elapsed):
            problem = f"{first[:40]!r} may have the day first or the month"
            remedy = "write dates as 2026-01-31, or with the day first and dots, or give `rate`"
            raise source.error(problem, remedy, "time", 0)
    since: Array = np.where(blank, np.nan, (instants - instants[at]).astype(np.float64) * 1e-9)
    if form is not None and form["first"] is None:  # times of day go on after midnight
        since[1:] += 86400.0 * np.cumsum(np.diff(since) < -43200.0)
    date = str(instants[at])
    return since, date.partition("T")[2] if form is not None and form["first"] is None else date


def _of_minutes(texts: Sequence[str], source: Source) -> Array:
    """Return minutes and seconds as seconds, NaN where blank."""
    minutes = np.full(len(texts), np.nan)
    for at, text in enumerate(texts):
        parts = _MINUTES.fullmatch(text)
        if parts is not None:
            minutes[at] = 60.0 * float(parts[1]) + float(parts[2].replace(",", "."))
        elif text:
            problem = f"{text[:40]!r} is no time in minutes and seconds"
            raise source.error(problem, "correct that cell, or give `rate`", "time", at)
    return minutes


def moment(began: str) -> float:
    """Return the seconds from 1970 to an instant, or from midnight to a time of day.

    >>> moment("2026-01-31T12:00:00"), moment("00:01:00.5")
    (1769860800.0, 60.5)
    """
    return (
        float(np.datetime64(began if "T" in began else f"1970-01-01T{began}", "ns").astype(int))
        / 1e9
    )


def instant(seconds: float) -> str:
    """Return the instant so many seconds after 1970 as ISO 8601.

    >>> instant(1769860800.25)
    '2026-01-31T12:00:00.250000'
    """
    return str(np.datetime64(round(seconds * 1e6), "us"))


def _in_one_form(parts: Any, form: re.Match[str]) -> tuple[Any, list[str]]:
    """Return instants of one form from their parts, and formats for `pandas.to_datetime`."""
    clock = parts["clock"] if form["clock"] else parts["clock"].fillna("00:00")
    cells = clock + ":" + parts["whole"].fillna("00") + "." + parts["part"].fillna("0")
    pattern = "%H:%M:%S.%f"
    if form["half"]:
        cells, pattern = cells + " " + parts["half"] + "M", "%I:%M:%S.%f %p"
    if form["zone"]:
        cells = cells + parts["zone"].str.replace("UTC|GMT", "Z", regex=True)
        pattern += "%z"
    if form["first"] is None:  # the time of day alone
        return cells.where(parts["first"].isna()), [pattern]
    month = "%b" if form["second"].isalpha() else "%m"
    year = "%Y" if len(form["third"]) == 4 else "%y"
    orders = [f"%d/{month}/{year}"]
    if len(form["first"]) == 4:
        orders = [f"%Y/{month}/%d"]
    elif form["mark"] != "." and month == "%m":
        orders.append(f"%m/%d/{year}")
    dates = parts["first"] + "/" + parts["second"] + "/" + parts["third"]
    return dates + " " + cells, [f"{order} {pattern}" for order in orders]
