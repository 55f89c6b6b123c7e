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

SHOWN = 8
"""Models of a section, and the chosen one; the rest are in ``measured.csv``."""

FILES = ["measured.html", "measured.md", "measured.csv"]
"""What is written."""

KEYS = ("test", "interval", "chosen", "rank", "gap", "parameters", "seconds", "step")
"""Columns of a section."""

BEST = 1.1
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
    compared = [one for one in outcomes if one.board and one.board.rows]
    if compared:
        choices = Table(CHOICE, [_choice(one) for one in compared])
        sections.append(Section("choice", "How good the choice is", [choices]))
    if done := [one for one in compared if not one.left_out]:
        items: list[Item | None] = [Text([OVERVIEW]), _matrix(done, [one.heading for one in done])]
        sections.append(Section("all", "All models on all sets", items))
    for place, name in enumerate(dict.fromkeys(one.set.name for one in outcomes)):
        own = [one for one in outcomes if one.set.name == name]
        about = own[0].set.split.about
        own_items: list[Item | None] = [Text([about])] if about.strip() else []
        for one in own:
            if not one.left_out:
                own_items += _section(one)
        for task in dict.fromkeys(one.task.name for one in own if one.left_out):
            own_items += _in_turn([one for one in own if one.left_out and one.task.name == task])
        sections.append(Section(f"set-{place}", own[0].set.title, own_items))
    sections.append(Section("method", "How to repeat", [Code("", command)]))
    return Page("Every model on recordings", ABOUT, sections)


def table(outcomes: Iterable[Outcome]) -> pd.DataFrame:
    """Return every row of every task, one under another."""
    frames = {
        (one.set.name, one.task.name, one.left_out): one.board.to_frame().assign(
            unit=one.board.unit, range=one.span
        )
        for one in outcomes
        if one.board is not None
    }
    keys = ["set", "task", "left_out"]
    return pd.concat(frames, names=keys).reset_index(keys) if frames else pd.DataFrame()


def _choice(one: Outcome) -> list[Any]:
    board, seconds = one.board, f"{one.seconds:.0f} s"
    assert board is not None
    best, lowest = board.best, board.lowest
    if best is None or lowest is None:
        return [one.label, f"none: {words.chosen(board) or one.failed}", "", "", "", "", seconds]
    above = f"{100 * (best.test_error / lowest.test_error - 1):.0f} %"
    return [
        *(one.label, best.model, _error(best, board), best.test_rank),
        *(f"{lowest.model} {_error(lowest, board)}", "–" if lowest is best else above, seconds),
    ]


def _error(row: Row, board: Leaderboard) -> str:
    return f"{numeral(row.test_error, 3)} {board.unit}".strip()


def _tested(one: Outcome) -> list[Row]:
    rows = one.board.rows if one.board else ()
    return sorted((row for row in rows if row.test is not None), key=lambda row: row.test_error)


def _matrix(done: Sequence[Outcome], headings: Sequence[str]) -> Table:
    """Return a table of models by tasks, those of most tasks and least errors first."""
    errors = pd.DataFrame(
        [{row.model: 100 * row.test_error / one.span for row in _tested(one)} for one in done]
    ).T
    ratios = errors / errors.min().clip(1e-12)
    places = pd.DataFrame({"tasks": -ratios.count(axis=1), "error": ratios.median(axis=1)})
    models = [*places.sort_values(["tasks", "error"]).index]
    values = errors.loc[models].to_numpy()
    chosen = [one.board.best.model if one.board and one.board.best else "" for one in done]
    rows: list[list[str]] = []
    marked: dict[tuple[int, int], str] = {}
    for place, model in enumerate(models):
        row = [model]
        for column, error in enumerate(values[place]):
            row.append("–" if np.isnan(error) else numeral(error, 3) if error < 100 else "> 100")
            marks = ["least"] * bool(error <= BEST * np.nanmin(values[:, column]))
            marked[place, column + 1] = " ".join([*marks, *["chosen"] * (model == chosen[column])])
        rows.append(row)
    return Table(["model", *headings], rows, marked=marked)


def _in_turn(parts: Sequence[Outcome]) -> list[Any]:
    """Return the items of a task that leaves out in turn."""
    items: list[Any] = [Text([parts[0].task.name or "Each left out in turn"], "lead")]
    done = [one for one in parts if _tested(one)]
    if done:
        about = "Test RMSE on what is left out, in per cent of the range of all recordings."
        items += [Text([about]), _matrix(done, [f"without {one.left_out}" for one in done])]
    failed = [f"without {o.left_out}: not compared: {o.failed}" for o in parts if o not in done]
    return [*items, Text(failed, listed=True)] if failed else items


def _section(one: Outcome) -> list[Any]:
    items: list[Any] = [Text([one.task.name], "lead")] if one.task.name else []
    board, tested = one.board, _tested(one)
    if board is None or not board.rows:
        return [*items, Text([f"Not compared: {one.failed}"])]
    chosen = board.best.model if board.best else ""
    shown = [row for k, row in enumerate(tested) if k < SHOWN or row.model == chosen]
    table = board_table(board, shown, KEYS)
    printed = [
        [
            f"{figure.what} (printed)",
            *(
                f"{figure.rmse:g}" if name.startswith("test RMSE") else "–"
                for name in table.headings[1:]
            ),
        ]
        for figure in one.task.published
    ]
    notes = []
    if one.notes:  # that of the first file in full
        more = f" (and {len(one.notes) - 1} more of the kind)" if len(one.notes) > 1 else ""
        notes = [f"as read: {one.notes[0]}{more}"]
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

    chosen = chosen_in(folder, only)
    if out.resolve().is_relative_to(folder.resolve()):
        problem = f"it is inside {folder}, where the next run would read results as recordings"
        raise DataError(problem, file=out, remedy="give a folder elsewhere")
    if jobs != 1:
        workers.prepare()
    inputs = [one.folder for one in chosen]
    with results_in(out, FILES, inputs=inputs, force=force, kind="measured") as results:
        every: list[Outcome] = []
        for one in outcomes(
            chosen,
            models=models,
            seed=seed,
            jobs=jobs,
            executor=executor,
            folder=out,
            tell=progress,
        ):
            every.append(one)
            if found is not None:
                found(one)
        if results is not None:
            whole = page(every, command)
            results.write_text("measured.html", whole.html())
            results.write_text("measured.md", whole.markdown())
            results.write_text("measured.csv", table(every).to_csv(index=False))
            results.commit()
        Checkpoints(out).clear()
    return every
