"""Formatting of numbers, the same on a terminal, in a report, and in the workbench."""

from __future__ import annotations

import math
import re


def numeral(value: float | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, without exponent if readable.

    Counts are whole, and nothing is a dash.

    >>> numeral(0.012345), numeral(-12345.6), numeral(1.5e-12), numeral(7), numeral(None)
    ('0.0123', '-12346', '1.5e-12', '7', '-')
    """
    if isinstance(value, int):
        return str(value)
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    form = f".{max(0, digits - 1 - size)}f" if -4 <= size <= 6 else f".{digits}g"
    return f"{value:{form}}"


def typeset_within(sentence: str) -> str:
    """Return a sentence with typeset numbers; hyphens in words are unchanged.

    >>> typeset_within("A closed-loop from -20 to 1.5e-12, and -.5")
    'A closed-loop from −20 to 1.5e−12, and −.5'
    """
    return re.sub(r"(?<![\w.])-(?=\.?\d)|(?<=\de)-(?=\d)", "−", sentence)


def typeset(text: str) -> str:
    """Return a number for print: with a minus sign for a hyphen, and a dash for nothing.

    >>> typeset("-1.5e-12"), typeset("-")
    ('−1.5e−12', '–')
    """
    return "–" if text == "-" else text.replace("-", "−")


ROUNDING = 1e-9
"""Relative size below which a number is shown as 0."""


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, for print.

    >>> number(-12345.6), number(None)
    ('−12346', '–')
    """
    return typeset(numeral(value, digits))


def percent(value: float | None, digits: int = 2) -> str:
    """Return a share as a percentage.

    >>> percent(0.0123), percent(-1.8e-15), percent(None)
    ('1.2 %', '0 %', '–')
    """
    if value is None:
        return "–"
    shown = 0.0 if abs(value) < ROUNDING else value
    return f"{number(100 * shown, digits)} %"


def duration(seconds: float) -> str:
    """Return a remaining time in words, rounded.

    >>> duration(3.2), duration(41.0), duration(200.0)
    ('5 s', '40 s', '3 min')
    """
    if seconds < 100:
        return f"{max(5 * round(seconds / 5), 5)} s"
    return f"{round(seconds / 60)} min"


def counted(count: int, what: str) -> str:
    """Return a count with its noun, in the plural unless it is 1.

    >>> counted(1, "part"), counted(3, "part")
    ('1 part', '3 parts')
    """
    return f"{count} {what}" if count == 1 else f"{count} {what}s"
