"""The report of a paper's re-run: one HTML file that needs nothing but itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mckibben.report import interactive, templating
from mckibben.report.drawing import N_COLOURS, Curve, Drawing, Mark, Panel

if TYPE_CHECKING:
    from mckibben.papers.reproduction import Figure, Points, Reproduction, Table


def reproduction_page(found: Reproduction) -> str:
    """Return the report of a re-run as HTML: what is printed beside ours first, raw signals last."""
    pictured = [table for table in found.tables if table.drawn is not None]
    shown = sorted(found.figures, key=lambda figure: len(figure.curves) == 1)
    drawings = {f"beside-{place}": beside(table) for place, table in enumerate(pictured)}
    drawings |= {f"figure-{place}": drawing(figure) for place, figure in enumerate(shown)}
    return templating.page(
        "reproduction.html.j2",
        {name: [interactive.plots(each)] for name, each in drawings.items()},
        found=found,
        pictured=pictured,
        shown=shown,
        versions=templating.versions(),
    )


def beside(table: Table) -> Drawing:
    """Return a table's drawn columns: what is printed in rings of ink, what was found in colours."""
    points: Points | None = table.drawn
    assert points is not None
    curves: list[Curve] = []
    found = n_printed = 0
    for column in points.columns:
        if column not in table.columns:  # nothing was to be said in it
            continue
        cells = [row[table.columns.index(column)] for row in table.rows]
        places = [place for place, cell in enumerate(cells) if isinstance(cell, int | float)]
        printed = "printed" in column
        n_printed += printed
        found += not printed
        curves.append(
            Curve(
                np.array([cells[place] for place in places], dtype=float),
                np.array(places, dtype=float),
                column,
                ("measured" if n_printed == 1 else "input")
                if printed
                else f"series-{(found - 1) % N_COLOURS + 1}",
                "rings" if printed else "dots",
            )
        )
    bound = () if points.bound is None else (Mark(points.bound, "printed: below"),)
    names = tuple(str(row[0]) for row in table.rows)
    return Drawing((Panel(points.measure, "", tuple(curves), marks=bound, categories=names),))


def drawing(figure: Figure) -> Drawing:
    """Return a paper's figure as a drawing: what a muscle did in ink, models in colours on top."""
    curves = []
    shown = list(figure.curves.items())[: N_COLOURS + 1]
    models = 0
    for place, (name, (x, y)) in enumerate(shown):
        recorded = place == 0 and name in ("", "virtual", "measured", "sensor", "extracted")
        models += not recorded
        colour = "measured" if recorded else f"series-{(models - 1) % N_COLOURS + 1}"
        curves.append(Curve(x, y, name, colour))
    return Drawing((Panel(figure.x_label, figure.y_label, tuple(curves)),))
