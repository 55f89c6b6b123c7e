"""What is drawn anew only where it would look otherwise: no click on it, nor what is typed, is lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import ui

from mckibben.app.desk import Desk, named


class Drawn:
    """A part of a page that is drawn anew when its state has changed, and else stays as it is.

    Parameters
    ----------
    desk : Desk
    state : callable
        Returns what all that is drawn depends on, to be compared.
    draw : callable
        Draws it.
    topics : str
        After which it is looked whether the state has changed.
    """

    def __init__(
        self, desk: Desk, state: Callable[[], Any], draw: Callable[[], None], *topics: str
    ) -> None:
        self._state, self._draw = state, ui.refreshable(draw)
        self._shown: Any = state()
        self._draw()
        for topic in topics:
            desk.when(topic, self.update)

    def update(self) -> None:
        """Draw it anew, unless it would be the same."""
        now = self._state()
        if now != self._shown:
            self._shown = object()  # where it fails, it is tried again
            self._draw.refresh()
            self._shown = now


def picture(desk: Desk, figure: dict[str, Any], name: str = "") -> ui.plotly:
    """Show a figure whose colours are names: in those of the theme, now and when that changes."""
    from mckibben.app.plots import coloured

    shown = ui.plotly({}).classes("w-full")

    def colour() -> None:
        shown.update_figure(coloured(figure, desk.dark))

    colour()
    with shown:  # it listens for as long as it is there
        desk.when("theme", colour)
    return named(shown, name) if name else shown
