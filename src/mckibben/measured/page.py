"""The page of all tasks: one table of all sets, then a section a task."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mckibben.checkpoints import Checkpoints
from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.errors import DataError
from mckibben.measured.running import Outcome, outcomes
from mckibben.measured.sets import sets_in
from mckibben.numerals import numeral
from mckibben.report import words
from mckibben.report.columns import columns_of_board

SHOWN = 8
"""Models of a section, and the chosen one; the rest are in the file beside."""

KEYS = ("test", "interval", "chosen", "rank", "gap", "parameters", "seconds", "step")
"""Columns of a section."""

BEST = 1.1
"""Times the least error that is set in bold."""

HEAD = """# Every model on recordings

Made by `{command}`; do not edit. Models are fitted and chosen on one side of each split and
tested free-running on the other; the test decides nothing. All rows are in `measured.csv` beside this.
"""

OVERVIEW = """
## All models on all sets

Test RMSE in per cent of the range of what is tested on. Bold: the least of a column, and those within a
tenth of it; underlined: chosen by cross-validation. A dash: not offered for such channels.
"""

CHOICE = ("set", "chosen", "its test RMSE", "rank", "least test RMSE", "above it", "time")


def page(outcomes: Sequence[Outcome], command: str) -> str:
    """Return the page, in Markdown."""
    return "\n".join(_lines(outcomes, command)).rstrip("\n") + "\n"


def _lines(outcomes: Sequence[Outcome], command: str) -> Iterator[str]:
    yield HEAD.format(command=command)
    compared = [one for one in outcomes if one.board and one.board.rows]
    if compared:
        yield "## How good the choice is\n"
        yield from _table(CHOICE, map(_choice, compared))
    if done := [one for one in compared if not one.left_out]:
        yield OVERVIEW
        yield from _matrix(done, lambda one: one.heading)
    for name in dict.fromkeys(one.set.name for one in outcomes):
        own = [one for one in outcomes if one.set.name == name]
        yield f"\n## {_inline(own[0].set.title)}\n"
        if about := own[0].set.split.about.strip():
            yield f"{about}\n"
        for one in own:
            if not one.left_out:
                yield from _section(one)
        for task in dict.fromkeys(one.task.name for one in own if one.left_out):
            yield from _in_turn([one for one in own if one.left_out and one.task.name == task])


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


def _inline(text: str) -> str:
    """Return words of a description as such: on one line, and nothing that Markdown would take up."""
    return re.sub(r"([\\`*\[\]<>|#])", r"\\\1", " ".join(text.split()))


def _table(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    first, *others = headings
    yield f"| {' | '.join([first, *others])} |"
    yield "|---|" + "---:|" * len(others)
    for row in rows:
        yield f"| {' | '.join(row)} |"


def _choice(one: Outcome) -> list[str]:
    board, seconds = one.board, f"{one.seconds:.0f} s"
    assert board is not None
    best, lowest = board.best, board.lowest
    if best is None or lowest is None:
        why = _inline(words.chosen(board) or one.failed)
        return [_inline(one.label), f"none: {why}", "", "", "", "", seconds]
    above = f"{100 * (best.test_error / lowest.test_error - 1):.0f} %"
    return [
        *(_inline(one.label), f"`{best.model}`", _error(best, board), str(best.test_rank)),
        *(f"`{lowest.model}` {_error(lowest, board)}", "–" if lowest is best else above, seconds),
    ]


def _error(row: Row, board: Leaderboard) -> str:
    return f"{numeral(row.test_error, 3)} {board.unit}".strip()


def _tested(one: Outcome) -> list[Row]:
    rows = one.board.rows if one.board else ()
    return sorted((row for row in rows if row.test is not None), key=lambda row: row.test_error)


def _matrix(done: Sequence[Outcome], heading: Callable[[Outcome], str]) -> Iterator[str]:
    """Give a table of models by tasks, those of most tasks and least errors first."""
    errors = pd.DataFrame(
        [{row.model: 100 * row.test_error / one.span for row in _tested(one)} for one in done]
    ).T
    ratios = errors / errors.min().clip(1e-12)
    places = pd.DataFrame({"tasks": -ratios.count(axis=1), "error": ratios.median(axis=1)})
    models = places.sort_values(["tasks", "error"]).index
    values = errors.loc[models].to_numpy()
    chosen = [one.board.best.model if one.board and one.board.best else "" for one in done]

    def cells(row: int, model: str) -> Iterator[str]:
        for error, column, best in zip(values[row], values.T, chosen, strict=True):
            text = numeral(error, 3) if error < 100 else ">100"
            text = f"**{text}**" if error <= BEST * np.nanmin(column) else text
            text = f"<u>{text}</u>" if model == best else text
            yield "–" if np.isnan(error) else text

    rows = ([f"`{model}`", *cells(row, model)] for row, model in enumerate(models))
    yield from _table(["model", *(_inline(heading(one)) for one in done)], rows)


def _in_turn(parts: Sequence[Outcome]) -> Iterator[str]:
    """Give the section of a task that leaves out in turn."""
    yield f"### {_inline(parts[0].task.name) or 'Each left out in turn'}\n"
    done = [one for one in parts if _tested(one)]
    if done:
        yield "Test RMSE on what is left out, in per cent of the range of all recordings.\n"
        yield from _matrix(done, lambda one: f"without {one.left_out}")
        yield ""
    for one in parts:
        if one not in done:
            yield f"- without {one.left_out}: not compared: {one.failed}\n"


def _section(one: Outcome) -> Iterator[str]:
    if one.task.name:
        yield f"### {_inline(one.task.name)}\n"
    board, tested = one.board, _tested(one)
    if board is None or not board.rows:
        yield f"Not compared: {one.failed}\n"
        return
    columns = [column for column in columns_of_board(board) if column.key in KEYS]
    yield f"Split: {board.split}. {words.chosen(board)}\n"
    chosen = board.best.model if board.best else ""
    shown = [row for k, row in enumerate(tested) if k < SHOWN or row.model == chosen]
    given = [row.to_dict() for row in shown]
    rows = [[f"`{row['model']}`", *(column.text(row) for column in columns)] for row in given]
    for figure in one.task.published:
        cells = [f"{figure.rmse:g}" if column.key == "test" else "–" for column in columns]
        rows.append([f"{_inline(figure.what)} (printed)", *cells])
    yield from _table(["model", *(column.label for column in columns)], rows)
    yield ""
    notes = []
    if one.notes:  # that of the first file in full
        more = f" (and {len(one.notes) - 1} more of the kind)" if len(one.notes) > 1 else ""
        notes = [f"as read: {one.notes[0]}{more}"]
    notes += words.comparison(board)
    notes += [f"failed: `{row.model}`: {row.reason}" for row in board.rows if row.reason]
    yield from (f"- {note}" for note in notes)
    if notes:
        yield ""


def measure(
    folder: Path,
    out: Path,
    *,
    only: Sequence[str] = (),
    models: str | Sequence[str] = "all",
    seed: int = 0,
    jobs: int | None = None,
    force: bool = False,
    command: str = "",
    progress: Callable[[float, str], None] | None = None,
    found: Callable[[Outcome], None] | None = None,
) -> list[Outcome]:
    """Compare all models on all sets of a folder, and write one page, ``measured.md``, and a table.

    Parameters
    ----------
    folder, out : Path
        With a folder for every set; where to write, outside of it.
    only : sequence of str
        Names of sets; default all.
    models, seed, jobs
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

    sets = sets_in(folder)
    if unknown := sorted({*only} - {one.name for one in sets}):
        listed = ", ".join(one.name for one in sets)
        problem = f"there is no set {unknown[0]!r} in it"
        raise DataError(problem, file=folder, remedy=f"use one of {listed}")
    if out.resolve().is_relative_to(folder.resolve()):
        problem = f"it is inside {folder}, where the next run would read results as recordings"
        raise DataError(problem, file=out, remedy="give a folder elsewhere")
    chosen = [one for one in sets if not only or one.name in only]
    if jobs != 1:
        workers.prepare()
    inputs = [one.folder for one in chosen]
    with results_in(out, ["measured.md", "measured.csv"], inputs=inputs, force=force) as results:
        every: list[Outcome] = []
        for one in outcomes(chosen, models=models, seed=seed, jobs=jobs, folder=out, tell=progress):
            every.append(one)
            if found is not None:
                found(one)
        if results is not None:
            results.write_text("measured.md", page(every, command))
            results.write_text("measured.csv", table(every).to_csv(index=False))
            results.commit()
        Checkpoints(out).clear()
    return every
