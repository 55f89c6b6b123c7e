"""Leaderboards as the commands print them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben.cli.output import figure, print_table

if TYPE_CHECKING:
    from mckibben.comparison.results import Leaderboard


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
    print(f"Models ranked by free-running test RMSE [{board.unit}]; {board.split}.")
    print_table(["model", "test RMSE", "95 % interval", "CV RMSE", "branch gap kept"], rows)
    for row in board.rows:
        if row.reason is not None:
            print(f"{row.model}: failed, {row.reason}")
    for note in board.notes:
        print(f"Note: {note}")
    if board.left_out:
        print(f"Left out, made for other channels: {', '.join(board.left_out)}.")
