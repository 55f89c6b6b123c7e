"""How far a case's answer is from what is stored."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.golden.case import EXACT, Case, Leaf
from tests.golden.stored import AT_MOST, Stored

OTHER_MACHINE = 1e-11
"""What ``EXACT`` means for computed numbers on a machine of another kind than the stored one's."""


@dataclass(frozen=True)
class Moved:
    """One value that is not as stored."""

    case: str
    leaf: str
    expected: str
    found: str
    by: float | None
    """Relative to the stored value; None where there is no such number."""
    tolerance: float | None


def moved(case: Case, stored: Stored, found: Mapping[str, Leaf], here: str) -> list[Moved]:
    """Return every leaf of an answer that is outside its tolerance."""
    rows: list[Moved] = []
    for leaf in sorted({*stored.leaves, *found}):
        tolerance = case.tolerance(leaf)
        if tolerance == EXACT and here != stored.machine:
            tolerance = OTHER_MACHINE
        if leaf not in found:
            rows.append(Moved(case.name, leaf, _shown(stored.leaves[leaf]), "-", None, tolerance))
        elif leaf not in stored.leaves:
            rows.append(Moved(case.name, leaf, "-", _shown(found[leaf]), None, tolerance))
        else:
            expected, value = stored.leaves[leaf], found[leaf]
            by = distance(expected, value, tolerance)
            if by is None or by > (tolerance or 0.0):
                rows.append(Moved(case.name, leaf, _shown(expected), _shown(value), by, tolerance))
    return rows


def distance(expected: Any, found: Leaf, tolerance: float | None) -> float | None:
    """Return how far a value is from its stored one, relative to it; None where it is another thing."""
    if isinstance(expected, dict):
        bound = float(expected[AT_MOST])
        value = float(found) if _number(found) else math.nan  # type: ignore[arg-type]
        if math.isnan(value):
            return None
        return 0.0 if value <= bound else (value - bound) / (abs(bound) or 1.0)
    if tolerance == EXACT and not _alike(expected, found):
        return _far(expected, found, tolerance) or None
    return _far(expected, found, tolerance)


def _alike(expected: Any, found: Any) -> bool:
    """Return whether two values are of one type and equal to the bit."""
    if isinstance(expected, np.ndarray) and isinstance(found, np.ndarray):
        return expected.dtype == found.dtype and expected.tobytes() == found.tobytes()
    return type(expected) is type(found) and repr(expected) == repr(found)


def _far(expected: Any, found: Leaf, tolerance: float | None) -> float | None:
    if isinstance(expected, np.ndarray) or isinstance(found, np.ndarray):
        return _arrays(expected, found, tolerance)
    if _number(expected) and _number(found):
        a, b = float(expected), float(found)  # type: ignore[arg-type]
        if tolerance is None or a == b or (math.isnan(a) and math.isnan(b)):
            return 0.0
        return abs(b - a) / (abs(a) or 1.0) if math.isfinite(a) and math.isfinite(b) else None
    if type(expected) is not type(found):
        return None
    return 0.0 if tolerance is None or expected == found else None


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _arrays(expected: Any, found: Any, tolerance: float | None) -> float | None:
    a, b = np.asarray(expected), np.asarray(found)
    if a.dtype.kind != b.dtype.kind or (tolerance is not None and a.shape != b.shape):
        return None
    if tolerance is None:
        return 0.0
    if a.dtype.kind not in "fiu" or a.size == 0:
        return 0.0 if np.array_equal(a, b) and a.dtype == b.dtype else None
    finite = np.isfinite(a)
    if (
        not np.array_equal(a[~finite], b[~finite], equal_nan=True)
        or not np.isfinite(b[finite]).all()
    ):
        return None
    if not finite.any():
        return 0.0
    largest = float(np.abs(a[finite]).max())
    return float(np.abs(b[finite].astype(float) - a[finite]).max()) / (largest or 1.0)


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if not value.size:
            return f"{value.dtype}{list(value.shape)}"
        middle = value.reshape(-1)[value.size // 2]
        return f"{value.dtype}{list(value.shape)} … {middle} …"
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}…"
