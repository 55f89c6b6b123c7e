"""Leaderboards as the commands print them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from mckibben.cli.output import print_table, say

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.comparison.ranking import Standing


PRINTED = ("chosen", "test", "interval", "rank", "gap")
"""Columns for a terminal of 80; the files have the rest."""


def told(tell: Callable[[float, str], None], last: str = "") -> Callable[[Standing], None]:
    """Return what a comparison tells how far it is, passed on in words.

    Parameters
    ----------
    tell : callable
        Shows the share done, and words.
    last : str
        What is done when all models are.
    """

    def pass_on(standing: Standing) -> None:
        text = str(standing)
        if standing.done == standing.total and last:
            text += f"; {last}"
        tell(standing.done / standing.total, text)

    return pass_on


def print_leaderboard(board: Leaderboard) -> None:
    """Print a leaderboard as a table, what is chosen, and what is to be said of models that failed."""
    from mckibben.report import words
    from mckibben.report.columns import columns_of_board

    columns = [column for column in columns_of_board(board) if column.key in PRINTED]
    rows = []
    for row in board.ranking:
        if row.test is not None:
            given = row.to_dict()
            level = " ≈" if row.model in board.level else ""
            name = row.model + level + ("*" if row.caution else "")
            rows.append([name, *(column.text(given) for column in columns)])
    say(f"Split: {board.split}.")
    print_table(["model", *(column.label for column in columns)], rows)
    say(f"All errors are free-run simulation errors. {words.STARTED}")
    say("Rank: by test RMSE. Width reproduced: of the hysteresis loop (100 % is exact).")
    if board.level:
        say(f"≈ {words.LEVEL}.")
    if board.constant is not None and board.rows:
        say("constant: the mean of the training output, which every model has to beat.")
    if said := words.chosen(board):
        say(said)
    if any(row.reason is None and row.caution for row in board.rows):
        say(f"* {words.CAREFUL[0].upper()}{words.CAREFUL[1:]}.")
    for sentence in words.not_validated(board):
        say(sentence)
    for reason, models in board.failures.items():
        say(f"{', '.join(models)}: failed, {reason}")
    for note in (*board.notes, *words.comparison(board)):
        say(f"Note: {note}")
    if board.left_out:
        say(f"Left out: {len(board.left_out)} models do not apply to these channels.")
