"""Leaderboards as the commands print and write them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mckibben.cli.output import figure, print_table, to_json

if TYPE_CHECKING:
    from mckibben.comparison.results import Leaderboard


def print_leaderboard(board: Leaderboard) -> None:
    """Print a leaderboard as a table, then the models that failed, each with its reason."""
    rows = []
    for row in board.rows:
        if row.train is None or row.test is None:
            continue
        interval = row.rmse_interval or (float("nan"), float("nan"))
        memory = None if row.memory is None else row.memory.gap_ratio
        rows.append(
            [
                row.model,
                figure(row.test.rmse),
                f"{figure(interval[0])} to {figure(interval[1])}",
                figure(row.test.max_error),
                figure(100 * row.test.r2, 4),
                figure(row.validation_rmse),
                figure(row.train.rmse),
                figure(memory, 2),
                str(row.n_parameters),
                figure(row.fit_seconds, 2),
                figure(row.step_ns, 3),
            ]
        )
    print(f"Models ranked by free-running test RMSE [{board.unit}]; {board.split}.")
    print_table(
        [
            *("model", "test RMSE", "95 % interval", "worst", "R² [%]", "CV RMSE", "train RMSE"),
            *("memory", "parameters", "fit [s]", "step [ns]"),
        ],
        rows,
    )
    for row in board.rows:
        if row.reason is not None:
            print(f"{row.model}: failed, {row.reason}")
    if board.left_out:
        print(f"Left out, made for other channels: {', '.join(board.left_out)}.")


def write_leaderboard(board: Leaderboard, folder: Path) -> None:
    """Write ``leaderboard.json`` and ``leaderboard.csv``."""
    from mckibben.atomic import write_text

    write_text(folder / "leaderboard.json", to_json(board.to_dict()) + "\n")
    write_text(folder / "leaderboard.csv", board.to_frame().to_csv(index=False))
