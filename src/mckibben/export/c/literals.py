"""Numbers as C writes them: the shortest decimals that give back every bit."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

WIDTH = 96


def literal(value: float, *, single: bool = False) -> str:
    """Return a number as a C constant, exact in its precision.

    >>> literal(0.1), literal(0.1, single=True), literal(3.0), literal(float("inf"))
    ('0.1', '0.1f', '3.0', 'MCK_INFINITY')
    """
    if math.isinf(value):
        return "MCK_INFINITY" if value > 0 else "-MCK_INFINITY"
    if not single:
        return repr(float(value))
    # what single precision cannot hold becomes its largest number, not infinity
    limit = float(np.finfo(np.float32).max)
    text = str(np.float32(min(max(value, -limit), limit)))
    return f"{text if any(mark in text for mark in '.e') else text + '.0'}f"


def rows(values: Iterable[float], *, single: bool = False) -> list[str]:
    """Return lines of an initialiser, each ending in a comma."""
    lines, line = [], ""
    for value in values:
        item = f"{literal(float(value), single=single)},"
        if line and len(line) + 1 + len(item) > WIDTH - 4:
            lines.append(line)
            line = item
        else:
            line = f"{line} {item}".strip()
    return [*lines, line] if line else lines
