"""Results as lines of text, for a terminal: texts and tables without figures."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import Any

from mckibben.report.builder import Code, Item, Table, Text, cell


def lines(items: Sequence[Item]) -> Iterator[str]:
    """Return texts and tables as lines; notes begin with ``Note: ``.

    A blank line is before every lead, and before a table that does not follow one.
    """
    after_lead = True
    for item in filter(None, items):
        lead = isinstance(item, Text) and item.style == "lead"
        if lead or (isinstance(item, Table) and not after_lead):
            yield ""
        after_lead = lead
        if isinstance(item, Text):
            start = "Note: " if item.style == "note" else "- " if item.listed else ""
            yield from (f"{start}{sentence}" for sentence in item.sentences)
        elif isinstance(item, Table):
            yield table(item)
        elif isinstance(item, Code):
            yield f"{item.what}: {item.text}"


def lines_of_result(result: Any) -> Iterator[str]:
    """Return the lines of a result, by its ``face``, and its notes."""
    from mckibben.report.results import FACES

    yield from lines(FACES[result.face](result))


def table(content: Table) -> str:
    """Return a table of the terminal's width; numbers are aligned right, text left."""
    from rich.console import Console
    from rich.table import Table as Grid
    from rich.text import Text as Verbatim

    grid = Grid(box=None, pad_edge=False, header_style="bold")
    for place, heading in enumerate(content.headings):
        side: Any = "right" if place in content.numeric_columns else "left"
        grid.add_column(Verbatim(heading), justify=side, overflow="fold")
    for row in content.rows:
        grid.add_row(*(Verbatim(cell(value, 4)) for value in row))
    console = Console() if sys.stdout is not None and sys.stdout.isatty() else Console(width=200)
    with console.capture() as printed:
        console.print(grid)
    return "\n".join(line.rstrip() for line in printed.get().splitlines())
