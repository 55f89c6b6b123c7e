"""How results appear in Python: three lines of text, and a card in notebooks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from textwrap import wrap
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import MckibbenError
from mckibben.numerals import numeral
from mckibben.report import words
from mckibben.report.columns import columns_of_board
from mckibben.report.drawing import along
from mckibben.report.figures import pair_of
from mckibben.report.printed import verbatim

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.control import Tracked
    from mckibben.diagnosis.characterization import Characterization
    from mckibben.diagnosis.check import Validation
    from mckibben.diagnosis.review import Review
    from mckibben.recording import Recording
    from mckibben.rigs.rig import Rig
    from mckibben.studying.study import Study

WIDTH = 80
"""Of a line of text [columns]."""

MOST_ROWS = 12
"""Rows of a card's table; the result itself has all."""

COLUMNS = ("chosen", "test", "interval", "inverse")
"""Columns of a leaderboard's card."""

POINTS, BREADTH, HEIGHT = 240, 150, 110
"""Of the small loop: points, and size [px]."""

_BOX = "padding:.5em .9em;border:1px solid #8887;border-radius:4px;display:inline-block"
_CELL = "padding:.12em .9em .12em 0;border:0;background:none;color:inherit;text-align:left"


@dataclass(frozen=True)
class Card:
    """A title, sentences, a table, and a loop as a small picture."""

    title: str
    lines: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    headings: Sequence[str] = ()
    path: tuple[Array, Array] | None = None

    def text(self) -> str:
        """Return the title and sentences in at most three lines."""
        first, *_ = wrap(verbatim(self.title), WIDTH, max_lines=1, placeholder=" …") or [""]
        return "\n".join(
            [first, *wrap(verbatim(" ".join(self.lines)), WIDTH, max_lines=2, placeholder=" …")]
        )

    def html(self) -> str:
        """Return it for a notebook: escaped, without scripts or colours of its own."""
        parts = [f"<strong>{_escaped(self.title)}</strong>"]
        parts += [f"<div>{_escaped(line)}</div>" for line in self.lines]
        rows = [_row(self.headings, "th")] if self.headings else []
        rows += [_row(row, "td") for row in self.rows[:MOST_ROWS]]
        if rows:
            parts.append(f'<table style="border-collapse:collapse">{"".join(rows)}</table>')
        if len(self.rows) > MOST_ROWS:
            parts.append(f"<div>and {len(self.rows) - MOST_ROWS} more</div>")
        if self.path is not None:
            parts.append(_picture(*self.path))
        return f'<div style="{_BOX}">{"".join(parts)}</div>'


def card(thing: Any) -> Card:
    """Return the card of a thing, by the name that it has as its ``face``."""
    return CARDS[thing.face](thing)


def _row(cells: Sequence[str], tag: str) -> str:
    found = "".join(f'<{tag} style="{_CELL}">{_escaped(cell)}</{tag}>' for cell in cells)
    return f"<tr>{found}</tr>"


def _escaped(text: str) -> str:
    return escape(verbatim(text))


def _picture(x: Array, y: Array) -> str:
    _, x, y = along(x, y, POINTS)
    px = 3 + (BREADTH - 6) * (x - x.min()) / (np.ptp(x) or 1.0)
    py = 3 + (HEIGHT - 6) * (y.max() - y) / (np.ptp(y) or 1.0)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px, py, strict=True))
    return (
        f'<svg width="{BREADTH}" height="{HEIGHT}" role="img" aria-label="loop">'
        f'<polyline points="{points}" fill="none" stroke="currentColor"/></svg>'
    )


def _recording(found: Recording) -> Card:
    rows = [
        (name, found.units[name] or "–", numeral(float(y.min()), 4), numeral(float(y.max()), 4))
        for name, y in found.channels.items()
    ]
    ranges = [f"{name} {low} to {high} {unit}".rstrip(" –") for name, unit, low, high in rows]
    pair = pair_of(found)
    return Card(
        f"Recording {found.name}: {words.duration(found)}",
        [", ".join(ranges), *found.notes],
        rows,
        ("channel", "unit", "lowest", "highest"),
        None if pair is None else (found[pair[0]], found[pair[1]]),
    )


def _block(found: Block) -> Card:
    given, moved = (
        ", ".join(f"{one.name} [{one.unit}]" if one.unit else one.name for one in side)
        for side in (found.inputs, found.outputs)
    )
    rows = [
        (name, numeral(float(value), 4))
        for name, value in zip(found.parameter_names, found.pack(), strict=False)
    ]
    kind = "Compensator" if found.undoing else "Model"
    size = f"{found.n_parameters} parameters, {found.n_states} states{_inverse(found)}."
    return Card(f"{kind} {found.title}", [f"{given} to {moved}.", size], rows)


def _inverse(block: Block) -> str:
    if block.undoing:
        return ""
    try:
        return f", inverse: {block.inverse().title}"
    except MckibbenError:
        return ", no inverse"


def _leaderboard(board: Leaderboard) -> Card:
    columns = [one for one in columns_of_board(board) if one.key in COLUMNS]
    ranked = [row for row in board.ranking if row.reason is None]
    rows = [
        (row.model + "*" * bool(row.caution), *(one.text(row.to_dict()) for one in columns))
        for row in ranked
    ]
    failed = [row.model for row in board.rows if row.reason is not None]
    lines = [words.chosen(board) or "No model worked."]
    lines += [f"Failed: {', '.join(failed)}."] * bool(failed)
    lines += [f"Pending: {', '.join(board.pending)}."] * bool(board.pending)
    lines += [f"* {words.CAREFUL}."] * any(row.caution for row in ranked)
    headings = ("model", *(one.label for one in columns))
    return Card(f"Leaderboard, {board.input} to {board.output}", lines, rows, headings)


def _study(found: Study) -> Card:
    board, known = _leaderboard(found.leaderboard), found.characterization
    lines = [*board.lines, *(words.characterization_sentences(known) if known else ())]
    return Card(f"Study, {found.input} to {found.output}", lines, board.rows, board.headings)


def _characterization(found: Characterization) -> Card:
    rows = [
        (name, numeral(value, 3) if isinstance(value, float) else str(value), unit)
        for name, value, _, unit, _ in words.characterization_rows(found)
        if value is not None
    ]
    lines = words.characterization_sentences(found)
    return Card(f"Characterization, {found.input} to {found.output}", lines, rows)


def _tracked(found: Tracked) -> Card:
    units = found.recording.units
    rows = [
        (name, numeral(rmse), numeral(found.largest[name]), units.get(name) or "–")
        for name, rmse in found.rmse.items()
    ]
    lines = [f"{name}: {rmse} {unit} RMSE, {most} at most." for name, rmse, most, unit in rows]
    if found.clipped:
        lines.append(f"{found.clipped} steps at a limit, or beyond reach.")
    return Card("Tracked", lines, rows, ("output", "RMSE", "largest error", "unit"))


def _review(found: Review) -> Card:
    return Card("Review", words.reviewed(found))


def _validation(found: Validation) -> Card:
    lines = [words.check_verdict(found), *words.check_sentences(found)]
    return Card(f"Check of {found.model}", lines)


def _rig(found: Rig) -> Card:
    limits = {name: found.limits(name) for name in found.inputs}
    rows = [(name, f"{numeral(one.low)} to {numeral(one.high)}") for name, one in limits.items()]
    rows += [(name, "output") for name in found.outputs if name not in limits]
    line = f"Virtual: a simulation, a sample every {numeral(found.sample_time)} s."
    return Card(f"Rig {found.name}: {found.title}".rstrip(": "), [line, found.source], rows)


CARDS: Mapping[str, Callable[[Any], Card]] = MappingProxyType(
    {
        "block": _block,
        "characterization": _characterization,
        "leaderboard": _leaderboard,
        "recording": _recording,
        "review": _review,
        "rig": _rig,
        "study": _study,
        "tracked": _tracked,
        "validation": _validation,
    }
)
"""Name of a thing -> what makes its card."""
