"""Parsers of options: values of texts, as they are typed on a command line.

A ValueError is raised for a text of another form.
"""

from __future__ import annotations

import json
import re
from typing import Any


def pair(text: str) -> tuple[str, str]:
    """Return name and value of ``NAME=VALUE``."""
    name, _, value = text.partition("=")
    if not (name and value):
        raise ValueError
    return name.strip(), value.strip()


def setting(text: str) -> tuple[str, Any]:
    """Return name and value of ``NAME=VALUE``, the value parsed as JSON if possible.

    >>> setting("n-operators=4"), setting("initial=rest")
    (('n_operators', 4), ('initial', 'rest'))
    """
    name, value = pair(text)
    try:
        found = json.loads(value)
    except (ValueError, RecursionError):
        found = None if value.lower() == "none" else value
    return name.replace("-", "_"), tuple(found) if isinstance(found, list) else found


def number(text: str) -> tuple[str, float]:
    """Return name and number of ``NAME=NUMBER``."""
    name, value = pair(text)
    return name, float(value)


def constant(text: str) -> tuple[str, tuple[float, str]]:
    """Return channel, value and unit of ``force=200 g``."""
    name, value = pair(text)
    found = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*)?", value)
    if found is None:
        raise ValueError
    return name, (float(found[1]), found[2] or "")


def calibration(
    text: str,
) -> tuple[str, tuple[float, float] | tuple[str, float, float, str]]:
    """Return channel, and column, gain, offset and unit of ``pressure=A0:2.5:-0.5:bar``.

    >>> calibration("displacement=-1:0")
    ('displacement', (-1.0, 0.0))
    """
    channel, value = pair(text)
    if value.count(":") == 1:
        gain, offset = value.split(":")
        return channel, (float(gain), float(offset))
    column, gain, offset, unit = value.rsplit(":", 3)
    if not (column and unit):
        raise ValueError
    return channel, (column, float(gain), float(offset), unit)


def span(text: str) -> tuple[float, float]:
    """Return the two numbers of ``START:END``, infinite where left out."""
    start, end = text.split(":")
    return float(start or "-inf"), float(end or "inf")


def limits(text: str) -> tuple[str, tuple[float | None, ...]]:
    """Return channel and limits of ``CHANNEL=LOW:HIGH[:RATE]``, None where left out.

    >>> limits("pressure=1:5.5"), limits("force=::20")
    (('pressure', (1.0, 5.5)), ('force', (None, None, 20.0)))
    """
    channel, value = pair(text)
    parts = value.split(":")
    if not 2 <= len(parts) <= 3:
        raise ValueError
    return channel, tuple(float(part) if part else None for part in parts)


def names(text: str) -> str | tuple[str, ...]:
    """Return the names in ``all``, ``quick``, ``none`` or ``NAME,NAME``."""
    if text in ("all", "quick", "none"):
        return text
    return tuple(name.strip() for name in text.split(",") if name.strip())
