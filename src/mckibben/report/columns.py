"""Columns of leaderboards, the same in all interfaces: content, unit and rounding."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mckibben.comparison.leaderboard import Leaderboard
from mckibben.numerals import numeral
from mckibben.report.words import CHOICES

Given = Mapping[str, Any]
"""A row as ``leaderboard.json`` holds it."""

FORGOTTEN = 1e-6
"""Share of a gap between branches below which none is left: the rest is rounding."""


@dataclass(frozen=True)
class Column:
    """A column of figures.

    Parameters
    ----------
    key : str
        Short name.
    heading : str
        In words.
    unit : str
        Empty for none.
    value : callable
        What a row holds there: a number, two ends, or None.
    digits : int
        Significant ones that are shown.
    """

    key: str
    heading: str
    unit: str
    value: Callable[[Given], Any]
    digits: int = 3

    @property
    def label(self) -> str:
        """Heading and unit."""
        return f"{self.heading} [{self.unit}]" if self.unit else self.heading

    def text(self, row: Given) -> str:
        """Return the text of a row's value; a dash for nothing."""
        value = self.value(row)
        if isinstance(value, str):
            return value
        if self.key == "r2" and value is not None and value < 0:
            return "below 0"  # how far is a matter of how little the test varies
        if isinstance(value, list):
            return " to ".join(numeral(end, self.digits) for end in value)
        return numeral(value, self.digits)

    def sorted_by(self, row: Given) -> float | str | None:
        """Return the sort key of a value: the midpoint of an interval."""
        value = self.value(row)
        return sum(value) / len(value) if isinstance(value, list) else value


def columns_of(
    rows: Sequence[Given],
    unit: str,
    outputs: Sequence[str] = (),
    chosen_by: str = "cross-validation",
) -> tuple[Column, ...]:
    """Return the non-empty columns of a leaderboard, in order.

    Parameters
    ----------
    rows : sequence of mapping
        As `Row.to_dict` gives them.
    unit : str
        Of the outputs.
    outputs : sequence of str
        Where there are several, each has a column of its own.
    chosen_by : str
        One of `CHOICES`.
    """
    by_output = tuple(
        Column(name, f"test RMSE of {name}", unit, _inside("outputs", name, "rmse"))
        for name in (outputs if len(outputs) > 1 else ())
    )
    on_train, validated = _inside("train", "rmse"), _inside("validation_rmse")
    by_fit = chosen_by == "fit"
    columns = (
        Column("chosen", CHOICES[chosen_by][0], unit, on_train if by_fit else validated),
        Column("test", "test RMSE", unit, _inside("test", "rmse")),
        Column("interval", "95 % interval", unit, _inside("test", "rmse_interval")),
        Column(
            "difference",
            "minus the chosen’s",
            unit,
            _inside("test", "difference_to_chosen_interval"),
        ),
        *by_output,
        Column("rank", "rank", "", _inside("test", "rank")),
        Column("inverse", "inverse", "", _inside("inverse")),
        *(() if by_fit else (Column("train", CHOICES["fit"][0], unit, on_train),)),
        Column("worst", "worst", unit, _inside("test", "max_error")),
        Column("r2", "R²", "%", _share("test", "r2"), 4),
        Column("gap", "width reproduced", "%", _share("memory", "gap_ratio"), 2),
        Column("hold", "width held", "%", _share("memory", "hold_ratio"), 2),
        Column("parameters", "parameters", "", _inside("n_parameters")),
        Column("seconds", "fit time", "s", _inside("fit_seconds"), 2),
        Column("step", "step", "ns", _inside("step_ns")),
    )
    return tuple(column for column in columns if any(column.value(row) is not None for row in rows))


def columns_of_board(board: Leaderboard) -> tuple[Column, ...]:
    """Return the columns of a leaderboard."""
    rows = [row.to_dict() for row in board.ranking]
    return columns_of(rows, board.unit, board.outputs, board.chosen_by)


DIVERGED = 10.0
"""Error, relative to the output's standard deviation, above which a model counts as diverged."""


def diverged(row: Given) -> bool:
    """Return whether a model diverged in the test."""
    share = (row.get("test") or {}).get("r2")
    return share is not None and share < 1 - DIVERGED**2


def _inside(*path: str) -> Callable[[Given], Any]:
    def value(row: Given) -> Any:
        content: Any = row
        for name in path:
            content = (content or {}).get(name)
        return content

    return value


def _share(*path: str) -> Callable[[Given], Any]:
    inside = _inside(*path)

    def value(row: Given) -> Any:
        share = inside(row)
        if share is None:
            return None
        return 100.0 * share if abs(share) > FORGOTTEN else 0.0

    return value
