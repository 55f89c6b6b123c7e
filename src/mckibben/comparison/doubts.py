"""What is doubtful about a choice: one bad part, a level second model, a test that contradicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.comparison.choosing import CAUTION
from mckibben.numerics.statistics import half_interval

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Row

BAD_PART = 3.0
"""Error on a part, relative to the cross-validated error, above which it is bad."""

FEWEST_PARTS = 3
"""Smallest number of parts on which two models are compared."""

LEVEL = 0.95
"""Confidence level of the interval of two models' ratio of errors."""


@dataclass(frozen=True)
class Span:
    """Samples of one recording that belong to a part: from and to, in a unit (none: sample numbers)."""

    recording: str
    start: float
    stop: float
    unit: str


@dataclass(frozen=True)
class Doubt:
    """What is doubtful, and the data that would decide.

    Parameters
    ----------
    kind : {"test", "part", "level"}
        Another model is better on the test, beyond its interval; the chosen model is bad on one part; or
        another one is level with it in the cross-validation.
    model : str
        That model: another one, or of a bad part the chosen one.
    ratio : float
        Error of the chosen model over the other's on the test; of a bad part, over its cross-validated
        error; of a level model, its error over the chosen one's in the cross-validation, as they count
        in the choice.
    interval : (float, float) or None
        95 % interval of the last.
    spans : tuple of Span
        The bad part, or that on which two level models differ most; empty where the test is meant.
    """

    kind: Literal["test", "part", "level"]
    model: str
    ratio: float
    interval: tuple[float, float] | None = None
    spans: tuple[Span, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def doubts_of(
    best: Row, others: Sequence[Row], parts: Sequence[tuple[Span, ...]]
) -> tuple[Doubt, ...]:
    """Return what is doubtful about a choice, most important first.

    Parameters
    ----------
    best : Row
        Of the chosen model.
    others : sequence of Row
        Of the others, in the order of the choice.
    parts : sequence of tuple of Span
        Of the cross-validation.
    """
    sound = [row for row in others if row.sound]
    found = []
    beyond = [
        r for r in sound if r.difference_interval is not None and r.difference_interval[1] < 0
    ]
    if beyond:
        better = min(beyond, key=lambda row: row.test_error)
        found.append(Doubt("test", better.model, best.test_error / better.test_error))
    errors = np.array(best.validation_by_part)
    if best.validation_rmse and errors.size:
        worst = int(np.argmax(errors))
        ratio = float(errors[worst] / best.validation_rmse)
        if ratio > BAD_PART:
            found.append(Doubt("part", best.model, ratio, None, tuple(parts[worst])))
    second = next((row for row in sound if row.validation_rmse is not None), None)
    if second is not None and best.validation_rmse is not None and errors.size >= FEWEST_PARTS:
        ratios = np.log(_counted(second)) - np.log(_counted(best))
        half = half_interval(ratios, LEVEL)
        low, high = ratios.mean() - half, ratios.mean() + half
        if low <= 0:
            places = int(np.argmax(np.abs(ratios)))
            ends = float(np.exp(low)), float(np.exp(high))
            ratio = float(np.exp(ratios.mean()))
            found.append(Doubt("level", second.model, ratio, ends, tuple(parts[places])))
    return tuple(found)


def _counted(row: Row) -> Array:
    """Return the errors on all parts as they count in the choice."""
    least = np.finfo(float).tiny
    return np.asarray(np.maximum(row.validation_by_part, least) * (CAUTION if row.doubted else 1.0))
