"""One thing that recordings cannot tell, in words, with the run that would tell it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from mckibben.numerals import numeral

SAME = 0.02
"""Share of a value by which another may differ to be called the same."""


@dataclass(frozen=True)
class Gap:
    """Something that recordings cannot tell.

    Parameters
    ----------
    what : str
        Its name: "rate", "creep", "reversals" and so on.
    sentence : str
        What cannot be told, and by what that is seen.
    remedy : str
        The run that would tell.
    effect : str
        Which parameters and models it concerns.
    severity : float
        From 0 to 1: how much a model from these recordings may be wrong by it.
    evidence : mapping of str to float
        The numbers behind the sentence.
    channels : tuple of str
        Those it is about.
    """

    what: str
    sentence: str
    remedy: str
    effect: str
    severity: float
    evidence: Mapping[str, float] = field(default_factory=dict)
    channels: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return it and its remedy, as two sentences."""
        return f"{self.sentence} {self.remedy}".strip()

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def value(number: float, unit: str = "") -> str:
    """Return a number with its unit.

    >>> value(0.50001, "bar"), value(2.0)
    ('0.5 bar', '2')
    """
    text = numeral(number, 2)
    text = text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text
    return f"{text} {unit}".strip()


def between(low: float, high: float, unit: str = "") -> str:
    """Return a range to about a percent of its size, or the one value that it is.

    >>> between(-0.003, 2.512, "bar"), between(0.5, 0.501, "bar")
    ('0 to 2.5 bar', '0.5 bar')
    """
    if high - low <= SAME * max(abs(low), abs(high)):
        return value(low, unit)
    digits = 1 - math.floor(math.log10(high - low))
    first, second = (f"{round(limit, digits) + 0.0:.6g}" for limit in (low, high))
    return f"{first} to {second} {unit}".strip()


def lasting(seconds: float) -> str:
    """Return a duration as a person plans it.

    >>> lasting(42.0), lasting(95.0), lasting(600.0)
    ('45 s', '2 min', '10 min')
    """
    if seconds <= 60:
        return f"{max(5, 5 * -(-seconds // 5)):.0f} s"
    return f"{-(-seconds // 60):.0f} min"


def listing(names: Sequence[str]) -> str:
    """Return names as a sentence has them.

    >>> listing(["a", "b", "c"])
    'a, b and c'
    """
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def counted(n: int, what: str, many: str | None = None) -> str:
    """Return how many of something there are.

    >>> counted(1, "branch", "branches"), counted(3, "run")
    ('1 branch', '3 runs')
    """
    return f"{n} {what if n == 1 else many or what + 's'}"
