"""Model choice: by cross-validated error, never by the test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Protocol, TypeVar

from mckibben.metrics import useful

CONSTANT = "constant"
"""Name of the row that predicts the mean of the training output, whatever the input: never chosen."""

CAUTION = 2.0
"""Factor on the ranking error of a model that is reliable only near its training data, or whose error is
that of the fit.
"""

Against = Literal["validation", "test"]
"""The data on which no model is clearly better than the constant, so that none is recommended."""


class Ranked(Protocol):
    """A row of a ranking."""

    @property
    def reason(self) -> str | None:
        """Reason of a failure, or None."""

    @property
    def skill_least(self) -> float | None:
        """Lower bound of the skill over the constant in the cross-validation."""

    @property
    def test_error(self) -> float:
        """RMSE on the test data, infinite if there is none."""


R = TypeVar("R", bound=Ranked)


def order(
    model: str,
    validated: float | None,
    fitted: float | None,
    skill_least: float | None = None,
    *,
    doubted: bool = False,
) -> tuple[bool, bool, float, str]:
    """Return the sort key of models: validated ones first, by their error; independent of the test.

    Those that are known to be no better than the constant come last. Parts of the same motion cannot
    show how a model extrapolates, so the error of one with a caution counts `CAUTION` times.

    Parameters
    ----------
    validated, fitted : float or None
        Error of the cross-validation, and on the data fitted, by which the others are sorted.
    skill_least : float or None
        Lower bound of the skill over the constant.
    doubted : bool
        Whether the error counts `CAUTION` times.
    """
    error = fitted if validated is None else validated
    counted = float("inf") if error is None else error * (CAUTION if doubted else 1.0)
    idle = skill_least is not None and not skill_least > 0
    return validated is None, idle, counted, model


def recommended(rows: Sequence[R], constant: Ranked | None) -> tuple[R | None, Against | None]:
    """Return the recommended model, or None and the data on which it is no better than the constant.

    It is the first in the order of the choice that beats the constant in the cross-validation beyond
    chance. The test does not choose, but it may take the recommendation away: no other is chosen in
    its place, since that would be a choice by the test.

    Parameters
    ----------
    rows : sequence of rows
        In the order of the choice.
    constant : row or None
        The constant's; without one the first that did not fail is recommended.
    """
    working = [row for row in rows if row.reason is None]
    if not working:
        return None, None
    judged = [row.skill_least for row in working if row.skill_least is not None]
    if judged and max(judged) <= 0:
        return None, "validation"
    first = next((row for row in working if (row.skill_least or 0.0) > 0), working[0])
    return (None, "test") if constant and not _beats(first, constant) else (first, None)


def acceptable(row: Ranked, constant: Ranked | None) -> bool:
    """Return whether a row has no known defect compared with a recommended one."""
    if row.reason is not None or constant is None:
        return row.reason is None
    return (row.skill_least is None or row.skill_least > 0) and _beats(row, constant)


def _beats(row: Ranked, constant: Ranked) -> bool:
    return useful(row.test_error, constant.test_error)
