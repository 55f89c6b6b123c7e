"""Pictures on a page, in the colours of its theme: when that changes they alone are drawn anew."""

from __future__ import annotations

from nicegui import ui

from mckibben.app import plots
from mckibben.app.desk import Desk, named


def picture(desk: Desk, figure: plots.Json, name: str = "") -> ui.plotly:
    """Show a figure, whose colours are names, and give it a name."""
    shown = ui.plotly({}).classes("w-full")

    def colour() -> None:
        shown.update_figure(plots.coloured(figure, desk.dark))

    colour()
    with shown:  # which is listened for as long as it is there
        desk.when("theme", colour)
    return named(shown, name) if name else shown
