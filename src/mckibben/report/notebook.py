"""Display of results in Python: three lines of text, and a card in notebooks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from textwrap import wrap
from types import MappingProxyType
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import in_terms_of
from mckibben.recording import Recording
from mckibben.report import results, words
from mckibben.report.builder import Item, Table, Text, cell
from mckibben.report.drawing import along
from mckibben.report.figures import pair_of
from mckibben.report.printed import verbatim

WIDTH = 80
"""Of a line of text [columns]."""

MOST_ROWS = 12
"""Rows of a card's table; the result itself has all."""

POINTS, BREADTH, HEIGHT = 240, 150, 110
"""Of the small loop: points, and size [px]."""

_BOX = "padding:.5em .9em;border:1px solid #8887;border-radius:4px;display:inline-block"
_CELL = "padding:.12em .9em .12em 0;border:0;background:none;color:inherit;text-align:left"


@dataclass(frozen=True)
class Card:
    """A title, the texts and tables of a result, and a loop as a small picture."""

    title: str
    items: Sequence[Item]
    path: tuple[Array, Array] | None = None

    @property
    def lines(self) -> list[str]:
        """Every sentence."""
        texts = [item for item in self.items if isinstance(item, Text)]
        return [in_terms_of(line) for item in texts for line in item.sentences]

    @property
    def tables(self) -> list[Table]:
        """Every table."""
        return [item for item in self.items if isinstance(item, Table)]

    def text(self) -> str:
        """Return the title and sentences, or rows if there are none, in at most three lines."""
        first, *_ = wrap(verbatim(self.title), WIDTH, max_lines=1, placeholder=" …") or [""]
        body = verbatim(" ".join(self.lines or map(_read_out, self.tables)))
        return "\n".join([first, *wrap(body, WIDTH, max_lines=2, placeholder=" …")])

    def html(self) -> str:
        """Return it for a notebook: escaped, without scripts or colours of its own."""
        parts = [f"<strong>{_escaped(self.title)}</strong>"]
        parts += [f"<div>{_escaped(line)}</div>" for line in self.lines]
        for table in self.tables:
            rows = [_row(table.headings, "th"), *(_row(x, "td") for x in table.rows[:MOST_ROWS])]
            parts.append(f'<table style="border-collapse:collapse">{"".join(rows)}</table>')
            if len(table.rows) > MOST_ROWS:
                parts.append(f"<div>and {len(table.rows) - MOST_ROWS} more</div>")
        if self.path is not None:
            parts.append(_picture(*self.path))
        return f'<div style="{_BOX}">{"".join(parts)}</div>'


def card(thing: Any) -> Card:
    """Return the card of an object, by its ``face``."""
    pair = pair_of(thing) if isinstance(thing, Recording) else None
    path = None if pair is None else (thing[pair[0]], thing[pair[1]])
    title = TITLES.get(thing.face, lambda value: type(value).__name__)(thing)
    return Card(title, results.FACES[thing.face](thing), path)


def _read_out(table: Table) -> str:
    """Return a table as a sentence: every cell after its heading, if there are several."""
    heads = [f"{heading} " * (len(table.headings) > 2) for heading in table.headings[1:]]
    rows = [
        f"{row[0]} {', '.join(f'{head}{cell(x)}' for head, x in zip(heads, row[1:], strict=True))}"
        for row in table.rows
    ]
    return f"{'; '.join(rows)}."


def _row(cells: Sequence[Any], tag: str) -> str:
    cells_html = "".join(
        f'<{tag} style="{_CELL}">{_escaped(cell(value))}</{tag}>' for value in cells
    )
    return f"<tr>{cells_html}</tr>"


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


TITLES: Mapping[str, Callable[[Any], str]] = MappingProxyType(
    {
        "block": lambda one: f"{'Compensator' if one.inverts else 'Model'} {one.title}",
        "characterization": lambda one: f"Characterization, {one.input} to {one.output}",
        "leaderboard": lambda one: f"Leaderboard, {one.input} to {one.output}",
        "recording": lambda one: f"Recording {one.name}: {words.duration(one)}",
        "review": lambda one: "Review",
        "rig": lambda one: f"Rig {one.name}: {one.title}".rstrip(": "),
        "study": lambda one: f"Study, {one.input} to {one.output}",
        "tracked": lambda one: "Tracked",
        "validation": lambda one: f"Check of {one.model}",
    }
)
"""Name of a thing -> title of its card."""
