"""The page of all tasks: one table of all sets, then a section a task."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mckibben.checkpoints import Checkpoints
from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.errors import DataError
from mckibben.measured.running import Outcome, outcomes
from mckibben.measured.sets import chosen_in
from mckibben.numerals import numeral
from mckibben.report import words
from mckibben.report.builder import Code, Item, Page, Section, Table, Text
from mckibben.report.results import board_table

MODELS_SHOWN = 8
"""Models of a section, and the chosen one; the rest are in ``measured.csv``."""

FILES = ["measured.html", "measured.md", "measured.csv"]
"""What is written."""

KEYS = ("test", "interval", "chosen", "rank", "gap", "parameters", "seconds", "step")
"""Columns of a section."""

BOLD_FACTOR = 1.1
"""Times the least error that is set in bold."""

ABOUT = (
    "Models are fitted and chosen on one side of each split and tested free-running on the other; the "
    "test decides nothing. All rows are in measured.csv."
)
OVERVIEW = (
    "Test RMSE in per cent of the range of what is tested on. Bold: within a tenth of the least of a "
    "column; underlined: chosen by cross-validation; a dash: not offered for such channels."
)

CHOICE = ("set", "chosen", "its test RMSE", "rank", "least test RMSE", "above it", "time")


def page(outcomes: Sequence[Outcome], command: str) -> Page:
    """Return the page of all tasks."""
    sections = []
    with_board = [outcome for outcome in outcomes if outcome.board and outcome.board.rows]
    if with_board:
        choices = Table(CHOICE, [_choice(outcome) for outcome in with_board])
        sections.append(Section("choice", "How good the choice is", [choices]))
    if complete := [outcome for outcome in with_board if not outcome.left_out]:
        items: list[Item | None] = [
            Text([OVERVIEW]),
            _matrix(complete, [outcome.heading for outcome in complete]),
        ]
        sections.append(Section("all", "All models on all sets", items))
    for place, name in enumerate(dict.fromkeys(outcome.set.name for outcome in outcomes)):
        of_set = [outcome for outcome in outcomes if outcome.set.name == name]
        about = of_set[0].set.split.about
        set_items: list[Item | None] = [Text([about])] if about.strip() else []
        for outcome in of_set:
            if not outcome.left_out:
                set_items += _section(outcome)
        for task in dict.fromkeys(outcome.task.name for outcome in of_set if outcome.left_out):
            set_items += _in_turn(
                [outcome for outcome in of_set if outcome.left_out and outcome.task.name == task]
            )
        sections.append(Section(f"set-{place}", of_set[0].set.title, set_items))
    sections.append(Section("method", "How to repeat", [Code("", command)]))
    return Page("Every model on recordings", ABOUT, sections)


def table(outcomes: Iterable[Outcome]) -> pd.DataFrame:
    """Return every row of every task, one under another."""
    frames = {
        (outcome.set.name, outcome.task.name, outcome.left_out): outcome.board.to_frame().assign(
            unit=outcome.board.unit, range=outcome.span
        )
        for outcome in outcomes
        if outcome.board is not None
    }
    keys = ["set", "task", "left_out"]
    return pd.concat(frames, names=keys).reset_index(keys) if frames else pd.DataFrame()


def _choice(outcome: Outcome) -> list[Any]:
    board, seconds = outcome.board, f"{outcome.seconds:.0f} s"
    assert board is not None
    best, lowest = board.best, board.lowest
    if best is None or lowest is None:
        return [
            outcome.label,
            f"none: {words.chosen(board) or outcome.failed}",
            "",
            "",
            "",
            "",
            seconds,
        ]
    above = f"{100 * (best.test_error / lowest.test_error - 1):.0f} %"
    return [
        *(outcome.label, best.model, _error(best, board), best.test_rank),
        *(f"{lowest.model} {_error(lowest, board)}", "–" if lowest is best else above, seconds),
    ]


def _error(row: Row, board: Leaderboard) -> str:
    return f"{numeral(row.test_error, 3)} {board.unit}".strip()


def _tested(outcome: Outcome) -> list[Row]:
    rows = outcome.board.rows if outcome.board else ()
    return sorted((row for row in rows if row.test is not None), key=lambda row: row.test_error)


def _matrix(outcomes: Sequence[Outcome], headings: Sequence[str]) -> Table:
    """Return a table of models by tasks, those of most tasks and least errors first."""
    errors = pd.DataFrame(
        [
            {row.model: 100 * row.test_error / outcome.span for row in _tested(outcome)}
            for outcome in outcomes
        ]
    ).T
    ratios = errors / errors.min().clip(1e-12)
    order = pd.DataFrame({"tasks": -ratios.count(axis=1), "error": ratios.median(axis=1)})
    models = [*order.sort_values(["tasks", "error"]).index]
    values = errors.loc[models].to_numpy()
    chosen = [
        outcome.board.best.model if outcome.board and outcome.board.best else ""
        for outcome in outcomes
    ]
    rows: list[list[str]] = []
    marked: dict[tuple[int, int], str] = {}
    for place, model in enumerate(models):
        row = [model]
        for column, error in enumerate(values[place]):
            row.append("–" if np.isnan(error) else numeral(error, 3) if error < 100 else "> 100")
            marks = ["least"] * bool(error <= BOLD_FACTOR * np.nanmin(values[:, column]))
            marked[place, column + 1] = " ".join([*marks, *["chosen"] * (model == chosen[column])])
        rows.append(row)
    return Table(["model", *headings], rows, marked=marked)


def _in_turn(parts: Sequence[Outcome]) -> list[Any]:
    """Return the items of a task that leaves out in turn."""
    items: list[Any] = [Text([parts[0].task.name or "Each left out in turn"], "lead")]
    tested = [one for one in parts if _tested(one)]
    if tested:
        about = "Test RMSE on what is left out, in per cent of the range of all recordings."
        items += [Text([about]), _matrix(tested, [f"without {one.left_out}" for one in tested])]
    failed = [
        f"without {part.left_out}: not compared: {part.failed}"
        for part in parts
        if part not in tested
    ]
    return [*items, Text(failed, listed=True)] if failed else items


def _section(outcome: Outcome) -> list[Any]:
    items: list[Any] = [Text([outcome.task.name], "lead")] if outcome.task.name else []
    board, tested = outcome.board, _tested(outcome)
    if board is None or not board.rows:
        return [*items, Text([f"Not compared: {outcome.failed}"])]
    chosen = board.best.model if board.best else ""
    rows = [row for k, row in enumerate(tested) if k < MODELS_SHOWN or row.model == chosen]
    table = board_table(board, rows, KEYS)
    printed = [
        [
            f"{figure.what} (printed)",
            *(
                f"{figure.rmse:g}" if name.startswith("test RMSE") else "–"
                for name in table.headings[1:]
            ),
        ]
        for figure in outcome.task.published
    ]
    notes = []
    if outcome.notes:  # that of the first file in full
        more = f" (and {len(outcome.notes) - 1} more of the kind)" if len(outcome.notes) > 1 else ""
        notes = [f"as read: {outcome.notes[0]}{more}"]
    notes += [*words.marks(board), *words.comparison(board)]
    notes += [f"failed: {row.model}: {row.reason}" for row in board.rows if row.reason]
    items += [
        Text([f"Split: {board.split}. {'' if chosen else words.chosen(board)}".strip()]),
        replace(table, rows=[*table.rows, *printed], titles=(), keys=()),
    ]
    return [*items, Text(notes, "note", listed=True)] if notes else items


def measure(
    folder: Path,
    out: Path,
    *,
    only: Sequence[str] = (),
    models: str | Sequence[str] = "all",
    seed: int = 0,
    jobs: int | None = None,
    executor: Executor | None = None,
    force: bool = False,
    command: str = "",
    progress: Callable[[float, str], None] | None = None,
    found: Callable[[Outcome], None] | None = None,
) -> list[Outcome]:
    """Compare all models on all sets of a folder, and write one page, as HTML and Markdown, and a table.

    Parameters
    ----------
    folder, out : Path
        With a folder for every set; where to write, outside of it.
    only : sequence of str
        Names of sets; default all.
    models, seed, jobs, executor
        As for `outcomes`.
    force : bool
        Whether files of the user's may be replaced.
    command : str
        By which the page is made.
    progress, found : callable, optional
        Called with the share done and words; and with every outcome.

    Raises
    ------
    DataError
        On sets that are not there, or an ``out`` that may not be written.
    """
    from mckibben.outputs import results_in
    from mckibben.system import workers

    sets = chosen_in(folder, only)
    if out.resolve().is_relative_to(folder.resolve()):
        problem = f"it is inside {folder}, where the next run would read results as recordings"
        raise DataError(problem, file=out, remedy="give a folder elsewhere")
    if jobs != 1:
        workers.prepare()
    inputs = [item.folder for item in sets]
    with results_in(out, FILES, inputs=inputs, force=force, kind="measured") as results:
        finished: list[Outcome] = []
        for item in outcomes(
            sets, models=models, seed=seed, jobs=jobs, executor=executor, folder=out, tell=progress
        ):
            finished.append(item)
            if found is not None:
                found(item)
        if results is not None:
            report = page(finished, command)
            results.write_text("measured.html", report.html())
            results.write_text("measured.md", report.markdown())
            results.write_text("measured.csv", table(finished).to_csv(index=False))
            results.commit()
        Checkpoints(out).clear()
    return finished
