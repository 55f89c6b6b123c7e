"""The page of all tasks: one table of all sets, then a section a task."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.measured.running import Outcome
from mckibben.numerals import numeral
from mckibben.report import words
from mckibben.report.columns import columns_of_board

SHOWN = 8
"""Models of a section, and the chosen one; the rest are in the file beside."""

KEYS = ("test", "interval", "chosen", "rank", "gap", "parameters", "seconds", "step")
"""Columns of a section."""

BEST = 1.1
"""Times the least error that is set in bold."""

PER_CENT = 100.0

HEAD = """# Every model on recordings

Made by `{command}`; do not edit. Models are fitted and chosen on one side of each split and
tested free-running on the other; the test decides nothing. All rows are in `measured.csv` beside this.
"""

OVERVIEW = """
## All models on all sets

Test RMSE in per cent of the range of what is tested on. Bold: the least of a column, and those within a
tenth of it; underlined: chosen by cross-validation. A dash: not offered for such channels.
"""

CHOICE = """
## How good the choice is

| set | chosen | its test RMSE | rank | least test RMSE | above it | time |
|---|---|---:|---:|---|---:|---:|
"""


def page(outcomes: Sequence[Outcome], command: str) -> str:
    """Return the page, in Markdown."""
    compared = [one for one in outcomes if one.board and one.board.rows]
    done = [one for one in compared if not one.left_out]
    lines = [HEAD.format(command=command)]
    if compared:
        lines += [CHOICE.strip("\n"), *(_choice(one) for one in compared)]
    if done:
        lines += [OVERVIEW]
        lines += [*_matrix(done, lambda one: one.heading)]
    for name in dict.fromkeys(one.set.name for one in outcomes):
        own = [one for one in outcomes if one.set.name == name]
        lines += ["", f"## {_inline(own[0].set.title)}", ""]
        if own[0].set.split.about:
            lines += [own[0].set.split.about.strip(), ""]
        for one in own:
            if not one.left_out:
                lines += [*_section(one)]
        for task in dict.fromkeys(one.task.name for one in own if one.left_out):
            lines += [*_in_turn([one for one in own if one.left_out and one.task.name == task])]
    return "\n".join(lines).rstrip("\n") + "\n"


def table(outcomes: Iterable[Outcome]) -> pd.DataFrame:
    """Return every row of every task, one under another."""
    frames = []
    for one in outcomes:
        if one.board is not None:
            frame = one.board.to_frame()
            frame.insert(0, "left_out", one.left_out)
            frame.insert(0, "task", one.task.name)
            frame.insert(0, "set", one.set.name)
            frames.append(frame.assign(unit=one.board.unit, range=one.span))
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def _inline(text: str) -> str:
    """Return words of a description as such: on one line, and nothing that Markdown would take up."""
    return re.sub(r"([\\`*\[\]<>|#])", r"\\\1", " ".join(text.split()))


def _tested(board: Leaderboard) -> list[Row]:
    return [row for row in board.rows if row.test is not None]


def _choice(one: Outcome) -> str:
    board = one.board
    assert board is not None
    best, lowest = board.best, board.lowest
    seconds = f"{one.seconds:.0f} s"
    if best is None or lowest is None:
        why = _inline(words.chosen(board) or one.failed)
        return f"| {_inline(one.label)} | none: {why} | | | | | {seconds} |"
    above = "–" if lowest.model == best.model else f"{PER_CENT * (one.regret or 0.0):.0f} %"
    return (
        f"| {_inline(one.label)} | `{best.model}` | {_figure(best, board)} | {best.test_rank} "
        f"| `{lowest.model}` {_figure(lowest, board)} | {above} | {seconds} |"
    )


def _figure(row: Row, board: Leaderboard) -> str:
    return f"{numeral(row.test_error, 3)} {board.unit}".strip()


def _matrix(done: Sequence[Outcome], heading: Callable[[Outcome], str]) -> Iterator[str]:
    """Give a table of models by tasks."""
    shares: list[dict[str, float]] = []
    for one in done:
        assert one.board is not None
        shares.append({r.model: PER_CENT * r.test_error / one.span for r in _tested(one.board)})
    models = {model for column in shares for model in column}
    beside = [{m: e / max(min(c.values()), 1e-12) for m, e in c.items()} for c in shares]

    def place(model: str) -> tuple[int, float]:
        ratios = [column[model] for column in beside if model in column]
        return -len(ratios), float(np.median(ratios))

    yield "| model | " + " | ".join(_inline(heading(one)) for one in done) + " |"
    yield "|---|" + "---:|" * len(done)
    for model in sorted(models, key=place):
        cells = [_cell(model, *both) for both in zip(done, shares, strict=True)]
        yield f"| `{model}` | " + " | ".join(cells) + " |"


def _cell(model: str, one: Outcome, column: Mapping[str, float]) -> str:
    assert one.board is not None
    if model not in column:
        return "–"
    text = numeral(column[model], 3) if column[model] < PER_CENT else ">100"
    text = f"**{text}**" if column[model] <= BEST * min(column.values()) else text
    chosen = one.board.best is not None and one.board.best.model == model
    return f"<u>{text}</u>" if chosen else text


def _in_turn(parts: Sequence[Outcome]) -> Iterator[str]:
    """Give the section of a task that leaves out in turn."""
    yield f"### {_inline(parts[0].task.name) or 'Each left out in turn'}"
    yield ""
    done = [one for one in parts if one.board is not None and one.board.rows]
    if done:
        yield "Test RMSE on what is left out, in per cent of the range of all recordings."
        yield ""
        yield from _matrix(done, lambda one: f"without {one.left_out}")
        yield ""
    for one in parts:
        if one not in done:
            yield from (f"- without {one.left_out}: not compared: {one.reason}", "")


def _section(one: Outcome) -> Iterator[str]:
    if one.task.name:
        yield f"### {_inline(one.task.name)}"
        yield ""
    board = one.board
    if board is None or not board.rows:
        yield from (f"Not compared: {one.reason or 'no model has a place on these channels.'}", "")
        return
    columns = [c for c in columns_of_board(board) if c.key in KEYS]
    yield f"Split: {board.split}. {words.chosen(board)}"
    yield ""
    yield "| model | " + " | ".join(column.label for column in columns) + " |"
    yield "|---|" + "---:|" * len(columns)
    tested = sorted(_tested(board), key=lambda row: row.test_error)
    shown = [
        *tested[:SHOWN],
        *(r for r in tested[SHOWN:] if board.best and r.model == board.best.model),
    ]
    for row in shown:
        given = row.to_dict()
        yield f"| `{row.model}` | " + " | ".join(column.text(given) for column in columns) + " |"
    for figure in one.task.published:
        cells = [f"{figure.rmse:g}" if column.key == "test" else "–" for column in columns]
        yield f"| {_inline(figure.what)} (printed) | " + " | ".join(cells) + " |"
    yield ""
    failed = [f"failed: `{row.model}`: {row.reason}" for row in board.rows if row.reason]
    notes = [*_mended(one.notes), *words.comparison(board), *failed]
    yield from (f"- {note}" for note in notes)
    if notes:
        yield ""


def _mended(notes: Sequence[str]) -> Iterator[str]:
    """Give what was mended in reading, that of the first file in full."""
    if notes:
        more = f" (and {len(notes) - 1} more of the kind)" if len(notes) > 1 else ""
        yield f"as read: {notes[0]}{more}"
