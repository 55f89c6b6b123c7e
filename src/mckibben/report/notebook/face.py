"""How one kind of thing is shown: its card, and its drawings for matplotlib and plotly."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben.errors import DataError, ModelError
from mckibben.report import interactive, printed
from mckibben.report.drawing import Drawing
from mckibben.report.notebook.card import Card
from mckibben.system.extras import demand

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Draw = Callable[..., Drawing]


class Face(ABC):
    """How one kind of thing is shown."""

    @abstractmethod
    def card(self) -> Card:
        """Return what is said of it."""

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return what draws it, by kind, the usual one first; perhaps by what is chosen."""
        del choices
        return {}

    def text(self) -> str:
        """Return its card for a terminal."""
        return self.card().text()

    def html(self) -> str:
        """Return its card for a notebook."""
        return self.card().html()

    def drawing(self, kind: str | None, choices: Mapping[str, Any]) -> Drawing:
        """Return a figure of it.

        Raises
        ------
        ModelError
            On an unknown kind.
        """
        known = self.drawings(choices)
        if kind is None:
            kind = next(iter(known))
        if kind not in known:
            raise ModelError(
                f"there is no figure {kind!r} of it", remedy=f"use one of {', '.join(known)}"
            )
        return known[kind](**choices)

    def plot(self, kind: str | None, ax: Any, choices: Mapping[str, Any]) -> Axes | list[Axes]:
        """Draw a figure of it with matplotlib; see `DrawsItself.plot`."""
        demand("matplotlib", "figures", "plots")
        from matplotlib import rc_context

        drawing = self.drawing(kind, choices)
        with rc_context({"text.parse_math": False}):
            given = None if ax is None else list(np.ravel(np.asarray(ax, dtype=object)))
            axes = given or _new_axes(drawing)
            if len(axes) != len(drawing.panels):
                raise DataError(
                    f"the figure has {len(drawing.panels)} panels, and there are {len(axes)} axes",
                    remedy="give as many, as ax=[...], or none for a new figure",
                )
            for place, (axis, panel) in enumerate(zip(axes, drawing.panels, strict=True)):
                last = not drawing.stacked or place == len(axes) - 1
                printed.draw_panel(axis, panel, bottom=last)
        return axes[0] if len(axes) == 1 else axes

    def interactive(self, kind: str | None, choices: Mapping[str, Any]) -> Any:
        """Draw a figure of it with plotly; see `DrawsItself.interactive`."""
        demand("plotly", "notebook", "interactive figures")
        from plotly.graph_objects import Figure

        drawing = replace(self.drawing(kind, choices), stacked=True)
        (plot,) = interactive.plots(drawing)
        # a page of its own colours lies behind, so that it is readable in dark notebooks too
        look = {
            "template": "plotly_white",
            "height": 420 if len(drawing.panels) == 1 else 240 * len(drawing.panels),
            "legend": {"orientation": "h", "y": 1, "yanchor": "bottom", "x": 0},
        }
        plain = _resolved(plot)
        return Figure(data=plain["data"], layout=look | plain["layout"])


def _new_axes(drawing: Drawing) -> list[Axes]:
    from matplotlib import pyplot

    n = len(drawing.panels)
    columns = 1 if drawing.stacked else min(n, drawing.columns)
    rows = -(-n // columns)
    wide = 6.4 if columns == 1 else 4.2 * columns
    high = 2.4 if drawing.stacked and n > 1 else 4.0
    categories = len(drawing.panels[0].categories)
    high = 1.6 + 0.28 * categories if categories else high
    figure, axes = pyplot.subplots(
        *(rows, columns),
        figsize=(wide, high * rows),
        layout="constrained",
        sharex=drawing.stacked,
        squeeze=False,
    )
    for axis in axes.ravel()[n:]:
        axis.set_axis_off()
    if drawing.note:
        figure.supxlabel(printed.verbatim(drawing.note), fontsize="small", wrap=True)
    return list(axes.ravel()[:n])


def _resolved(value: Any) -> Any:
    """Return plain numbers for packed ones, and colours of print for their names."""
    if isinstance(value, dict):
        if set(value) == {"base", "f4"}:
            return interactive.unpacked(value)
        return {key: _resolved(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_resolved(item) for item in value]
    if isinstance(value, str) and value.startswith("--"):
        return printed.COLOURS.get(value[2:], "#222222")
    return value


def table_of(pairs: Mapping[str, str | None]) -> list[tuple[str, str]]:
    """Return what is known as rows of two cells."""
    return list(_known(pairs))


def _known(pairs: Mapping[str, str | None]) -> Iterator[tuple[str, str]]:
    for name, value in pairs.items():
        if value:
            yield name, value
