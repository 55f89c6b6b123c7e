"""Leaderboards as the commands print them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from mckibben.cli.output import figure, print_table

if TYPE_CHECKING:
    from mckibben.comparison.results import Leaderboard, Standing


def told(tell: Callable[[float, str], None], last: str = "") -> Callable[[Standing], None]:
    """Return what a comparison tells how far it is, passed on in words.

    Parameters
    ----------
    tell : callable
        Shows the share done, and words.
    last : str
        What is done when all models are.
    """
    begun = False

    def pass_on(standing: Standing) -> None:
        nonlocal begun
        text = str(standing)
        if standing.done and not begun:
            text = f"going on from what was finished: {text}"
        if standing.done == standing.total and last:
            text += f"; {last}"
        begun = True
        tell(standing.done / standing.total, text)

    return pass_on


def print_leaderboard(board: Leaderboard) -> None:
    """Print a leaderboard as a table, then the models that failed, each with its reason.

    Five columns, for a terminal of 80; the files have the rest.
    """
    rows = []
    for row in board.rows:
        if row.test is None:
            continue
        interval = row.rmse_interval or (float("nan"), float("nan"))
        memory = None if row.memory is None else row.memory.gap_ratio
        rows.append(
            [
                row.model,
                figure(row.test.rmse),
                f"{figure(interval[0])} to {figure(interval[1])}",
                figure(row.validation_rmse),
                figure(memory, 2),
            ]
        )
    unit = f" [{board.unit}]" if board.unit else ""
    print(f"Split: {board.split}.")
    headings = [f"test RMSE{unit}", "95 % interval", f"CV RMSE{unit}", "branch gap kept"]
    print_table(["model", *headings], rows)
    print("All run free. CV: cross-validated on the training side. Gap: 1 is right, 0 forgets.")
    for row in board.rows:
        if row.reason is not None:
            print(f"{row.model}: failed, {row.reason}")
    for note in board.notes:
        print(f"Note: {note}")
    if board.left_out:
        print(f"Left out: {len(board.left_out)} models that are made for other channels.")
