"""Which model is recommended, if any: one that says more than the mean of the training output does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

from mckibben.comparison.offered import caution
from mckibben.numerals import numeral

NONE = "No model is recommended: "
"""How the reasons begin."""

CONSTANT = "constant"
"""Name of the row that predicts the mean of the training output, whatever the input: never chosen."""


class Ranked(Protocol):
    """A row of a ranking."""

    @property
    def model(self) -> str:
        """Short name."""

    @property
    def reason(self) -> str | None:
        """Why it failed, or None."""

    @property
    def skill_least(self) -> float | None:
        """Lower bound of `skill`."""

    @property
    def test_error(self) -> float:
        """RMSE on the test data, infinite where there is none."""


USEFUL = 0.9
"""Share of the constant's error on the test from which on a model is of no use."""

DOUBTED = 0.5
"""The same where recordings are known not to go together."""

R = TypeVar("R", bound=Ranked)


def order(
    model: str,
    validated: float | None,
    fitted: float | None,
    skill_least: float | None = None,
) -> tuple[bool, bool, bool, float, str]:
    """Return what models are sorted by: the validated ones first, by that; nothing of the test is in it.

    Those that are known to say no more than the constant come last. Of the others, those that are good
    only near what they were trained on come after the rest, since parts of the same motion cannot tell.

    Parameters
    ----------
    model : str
        Short name.
    validated, fitted : float or None
        Error of the cross-validation, and on the data fitted, by which the others are sorted.
    skill_least : float or None
        Lower bound of the skill over the constant.
    """
    error = fitted if validated is None else validated
    last = float("inf") if error is None else error
    idle = skill_least is not None and not skill_least > 0
    return validated is None, idle, caution(model) is not None, last, model


def recommended(
    rows: Sequence[R], constant: Ranked | None, unit: str, apart: str = ""
) -> tuple[R | None, str]:
    """Return the model to recommend, or None and why there is none.

    It is the first in the order of the choice that beats the constant in the cross-validation beyond
    what resampling its blocks gives. The test does not choose, but it may take the recommendation
    away: a model that is hardly better there than the constant is not to be used, and no other is
    chosen in its place, since that would be a choice by the test.

    Parameters
    ----------
    rows : sequence of rows
        In the order of the choice.
    constant : row or None
        The constant's; without one the first that did not fail is recommended.
    unit : str
        Of the errors.
    apart : str
        What sets recordings apart, which is then why.
    """
    working = [row for row in rows if row.reason is None]
    if not working:
        return None, ""
    judged = [row for row in working if row.skill_least is not None]
    better = [row for row in judged if row.skill_least is not None and row.skill_least > 0]
    if judged and not better:
        told = [row for row in judged if _beats(row, constant)]
        return None, (
            f"{NONE}on what was left out to validate them, none predicts better than "
            "the mean of the training output beyond what chance gives. "
            + (
                apart
                or (
                    f"On the test {told[0].model} does, at {_error(told[0], unit)}: too little was left "
                    "out to tell. Record more, or give recordings to validate on"
                    if told
                    else "As far as these models can tell from so much data, the output does not depend "
                    "on the input; where it does, it may be by lags or dynamics that they lack, and "
                    "models of rate have"
                )
            )
        )
    first, several = (better or working)[0], len(working) > 1
    if constant is not None and not _beats(first, constant, DOUBTED if apart else USEFUL):
        return None, (
            f"{NONE}{f'{first.model} has the least error of those on the training side, but ' * several}"
            f"on the test data {'it' if several else first.model} is off by {_error(first, unit)} RMSE, "
            f"and the mean of the training output by {_error(constant, unit)}. "
            + (
                apart
                or "The test differs from what was trained on, or training is too little: record more, "
                "or more alike"
            )
        )
    return first, ""


def acceptable(row: Ranked, constant: Ranked | None) -> bool:
    """Tell whether nothing is known against a row beside one that is recommended."""
    if row.reason is not None or constant is None:
        return row.reason is None
    return (row.skill_least is None or row.skill_least > 0) and _beats(row, constant)


def _beats(row: Ranked, constant: Ranked | None, share: float = USEFUL) -> bool:
    return constant is not None and row.test_error < share * constant.test_error


def _error(row: Ranked, unit: str) -> str:
    return f"{numeral(row.test_error, 3)} {unit}".strip()
