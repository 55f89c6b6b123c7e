"""A short account of one thing, for a terminal of 80 columns and for a notebook, light or dark."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from textwrap import shorten, wrap

import numpy as np

from mckibben.arrays import Array
from mckibben.report.drawing import along
from mckibben.report.printed import verbatim

WIDTH = 80
"""Of a terminal [columns]."""

WIDEST = 30
"""Of a cell that is not the last of its row [columns]."""

POINTS = 240
"""Of the small picture."""

BREADTH, HEIGHT = 150, 110
"""Of the small picture [px]."""

_BOX = (
    "display:inline-block;max-width:100%;box-sizing:border-box;padding:.5em .9em;"
    "border:1px solid rgba(128,128,128,.45);border-radius:4px;font-size:.92em;line-height:1.4"
)
_CELL = "padding:.12em .9em .12em 0;vertical-align:top;border:0;background:none;color:inherit"
_HEAD = f"{_CELL};border-bottom:1px solid rgba(128,128,128,.45);font-weight:600"


@dataclass(frozen=True)
class Card:
    """What is said of one thing.

    Parameters
    ----------
    title : str
        What it is.
    said : sequence of str
        Sentences.
    headings : sequence of str
        Of the table's columns; none where its first column names the rows.
    rows : sequence of sequence of str
        Of the table.
    marked : int or None
        The row that matters most.
    notes : sequence of str
        Below the table.
    path : (array, array) or None
        A loop to be shown as a small picture.
    """

    title: str
    said: Sequence[str] = ()
    headings: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    marked: int | None = None
    notes: Sequence[str] = ()
    path: tuple[Array, Array] | None = None

    def text(self) -> str:
        """Return it for a terminal."""
        lines = [*_wrapped(self.title), *(line for one in self.said for line in _wrapped(one))]
        lines += _table(self.headings, self.rows)
        return "\n".join([*lines, *(line for one in self.notes for line in _wrapped(one))])

    def html(self) -> str:
        """Return it for a notebook: escaped, without scripts or colours of its own."""
        parts = [f"<div><strong>{_shown(self.title)}</strong></div>"]
        parts += [f"<div>{_shown(one)}</div>" for one in self.said]
        table = "".join(self._html_rows())
        if table:
            parts.append(
                '<table style="border-collapse:collapse;margin:.35em 0;border:0;font-size:inherit;'
                f'color:inherit;background:none">{table}</table>'
            )
        parts += [f'<div style="opacity:.8">{_shown(one)}</div>' for one in self.notes]
        said = "".join(parts)
        if self.path is not None:
            said = (
                '<div style="display:flex;flex-wrap:wrap;gap:.5em 1.5em;align-items:center">'
                f"<div>{said}</div>{_picture(*self.path)}</div>"
            )
        return f'<div style="{_BOX}">{said}</div>'

    def _html_rows(self) -> Iterator[str]:
        sides = ["right" if figures else "left" for figures in _of_figures(self.rows)]
        if self.headings:
            yield _html_row(self.headings, sides, "th", _HEAD)
        for place, row in enumerate(self.rows):
            style = f"{_CELL};font-weight:600" if place == self.marked else _CELL
            yield _html_row(row, sides, "td", style)


def _html_row(cells: Sequence[str], sides: Sequence[str], tag: str, style: str) -> str:
    found = "".join(
        f'<{tag} style="{style};text-align:{side}">{_shown(cell)}</{tag}>'
        for cell, side in zip(cells, sides, strict=True)
    )
    return f'<tr style="background:none">{found}</tr>'


def _shown(words: str) -> str:
    return escape(verbatim(words))


def _wrapped(words: str) -> list[str]:
    return wrap(verbatim(words), WIDTH, subsequent_indent="  ") or [""]


def _of_figures(rows: Sequence[Sequence[str]]) -> list[bool]:
    """Tell of every column whether it holds nothing but numbers, which are aligned right."""
    return [all(cell[:1] in "-0123456789" for cell in column) for column in zip(*rows, strict=True)]


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    if not rows:
        return []
    right = _of_figures(rows)
    whole = [headings, *rows] if headings else rows
    cells = [
        [
            *(shorten(verbatim(cell), WIDEST, placeholder=" …") for cell in row[:-1]),
            verbatim(row[-1]),
        ]
        for row in whole
    ]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [
        "  ".join(
            cell.rjust(width) if aligned else cell.ljust(width)
            for cell, width, aligned in zip(row, widths, right, strict=True)
        ).rstrip()
        for row in cells
    ]
    return [line if len(line) <= WIDTH else f"{line[: WIDTH - 2]} …" for line in lines]


def _picture(x: Array, y: Array) -> str:
    _, x, y = along(x, y, POINTS)
    px = 3 + (BREADTH - 6) * _unit(x)
    py = 3 + (HEIGHT - 6) * (1 - _unit(y))
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px, py, strict=True))
    return (
        f'<svg width="{BREADTH}" height="{HEIGHT}" role="img" aria-label="loop">'
        f'<polyline points="{points}" fill="none" stroke="currentColor" stroke-width="1"/></svg>'
    )


def _unit(values: Array) -> Array:
    span = float(np.ptp(values))
    return (values - values.min()) / span if span > 0 else np.full(values.shape, 0.5)
