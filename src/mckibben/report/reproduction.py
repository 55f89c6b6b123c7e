"""The report of a paper's re-run: one HTML file that needs nothing but itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben.report import interactive, templating, wording
from mckibben.report.drawing import N_COLOURS, Curve, Drawing, Panel

if TYPE_CHECKING:
    from mckibben.papers.reproduction import Figure, Reproduction


def reproduction_page(found: Reproduction) -> str:
    """Return the report of a re-run as HTML."""
    figures = {
        f"figure-{place}": [interactive.plots(drawing(figure))]
        for place, figure in enumerate(found.figures)
    }
    return templating.page(
        "reproduction.html.j2", figures, found=found, versions=wording.versions()
    )


def drawing(figure: Figure) -> Drawing:
    """Return a paper's figure as a drawing: what was measured in ink, models in colours on top."""
    curves = []
    shown = list(figure.curves.items())[: N_COLOURS + 1]
    models = 0
    for place, (name, (x, y)) in enumerate(shown):
        measured = place == 0 and name in ("", "measured", "extracted")
        models += not measured
        colour = "measured" if measured else f"series-{(models - 1) % N_COLOURS + 1}"
        curves.append(Curve(x, y, name, colour))
    return Drawing((Panel(figure.x_label, figure.y_label, tuple(curves)),))
