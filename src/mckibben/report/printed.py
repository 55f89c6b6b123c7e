"""Figures for print: drawings rendered by matplotlib at the width of a journal's column.

Neither pyplot nor any global state is touched, and the same drawing gives the same bytes.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben.errors import DataError
from mckibben.outputs import MAKER
from mckibben.report.drawing import Curve, Drawing, Panel
from mckibben.system.atomic import replacing
from mckibben.system.extras import demand

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN = 3.5
"""Width of a column [in]."""

PAGE = 7.2
"""Width of two columns and the space between them [in]."""

RESOLUTION = 300
"""Of PNG [dots per inch]."""

COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "measured": "#222222",
        "input": "#777777",
        "series-1": "#0072B2",
        "series-2": "#E69F00",
        "series-3": "#009E73",
        "series-4": "#CC79A7",
        "series-5": "#56B4E9",
        "series-6": "#D55E00",
        "age-1": "#FDB42F",
        "age-2": "#ED7953",
        "age-3": "#C23C81",
        "age-4": "#7E03A8",
        "age-5": "#0D0887",
    }
)
"""Okabe and Ito's colours for what differs in kind, a scale from light to dark for time."""

STYLE: Mapping[Any, Any] = MappingProxyType(
    {
        "font.family": "DejaVu Sans",
        "font.size": 7.5,
        "axes.linewidth": 0.6,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlesize": 7.5,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "legend.frameon": False,
        "legend.fontsize": 6.5,
        "figure.facecolor": "white",
        "savefig.facecolor": "white",
        "pdf.fonttype": 42,
        "svg.fonttype": "path",
        "svg.hashsalt": "mckibben",
        "path.simplify": False,
        "text.parse_math": False,
    }
)

_WIDTHS = {"line": 0.9, "fine": 0.4, "broad": 2.6, "beads": 0.5}
"""Of lines [pt], by style."""

_LEGEND = 45
"""Largest number of letters of three names in one line of a legend."""

_LEGEND_LINE = 0.14
"""Height that a figure gains by every line of a legend beyond two [in]."""

METADATA: Mapping[str, Mapping[str, str | None]] = MappingProxyType(
    {
        "png": {"Software": MAKER},
        "svg": {"Creator": MAKER, "Date": None},
        "pdf": {"Creator": MAKER, "CreationDate": None},
    }
)
"""What each format records of what it was made by, and not of when."""


def save(drawing: Drawing, path: str | Path) -> None:
    """Write a drawing; on failure an earlier file is unchanged.

    Parameters
    ----------
    drawing : Drawing
        What to draw.
    path : path
        File to write; its suffix is ``.png`` (300 dots per inch), ``.svg`` or ``.pdf``.

    Raises
    ------
    DataError
        On another suffix, or a folder that does not exist.
    """
    path, style = Path(path), dict(STYLE)
    kind = format_of(path)
    from matplotlib import rc_context

    figure = io.BytesIO()
    with rc_context(style):
        drawn(drawing).savefig(figure, format=kind, dpi=RESOLUTION, metadata=dict(METADATA[kind]))
    with replacing(path) as new:
        new.write_bytes(figure.getvalue())


def format_of(path: Path) -> str:
    """Return the format of a figure's file name; raise an error as `save` does."""
    demand("matplotlib", "figures", "figures for print")
    kind = path.suffix.lower().lstrip(".")
    if kind not in METADATA:
        raise DataError(
            f"figures cannot be written as {path.suffix or 'a file without suffix'}",
            file=path,
            remedy="name it .png, .svg or .pdf",
        )
    return kind


def drawn(drawing: Drawing) -> Figure:
    """Return a drawing as a matplotlib figure; `save` adds the style of this module."""
    demand("matplotlib", "figures", "figures for print")
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained")
    draw_into(axes_in(figure, drawing), drawing)
    return figure


def axes_in(figure: Figure, drawing: Drawing, scale: float = 1.0) -> list[Axes]:
    """Return the axes of a drawing's panels in a new figure of suitable size."""
    n = len(drawing.panels)
    columns = 1 if drawing.stacked else min(n, drawing.columns)
    rows = -(-n // columns)
    width = COLUMN if columns == 1 else PAGE
    panel_height = 1.4 if drawing.stacked else min(0.8 * width / columns, 2.6)
    if drawing.panels[0].categories:
        panel_height = 0.9 + 0.2 * len(drawing.panels[0].categories)
    elif drawing.columns == 1:
        panel_height = 1.7
    note = 0.25 if drawing.note else 0.0
    names = [[curve.name for curve in panel.curves if curve.name] for panel in drawing.panels]
    lines = max(-(-len(own) // _legend_columns(own)) for own in names)
    height = rows * panel_height + 0.2 + note + _LEGEND_LINE * max(lines - 2, 0)
    figure.set_size_inches(scale * width, scale * height)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=drawing.stacked).ravel()
    for axis in axes[n:]:
        axis.set_axis_off()
    if drawing.note:
        figure.supxlabel(verbatim(drawing.note), fontsize="small", wrap=True)
    return list(axes[:n])


def draw_into(axes: Sequence[Axes], drawing: Drawing) -> None:
    """Draw every panel into its axes."""
    for place, (panel, axis) in enumerate(zip(drawing.panels, axes, strict=True)):
        draw_panel(axis, panel, bottom=not drawing.stacked or place == len(axes) - 1)


def verbatim(words: str) -> str:
    """Return text without line breaks and unprintable characters."""
    return "".join(letter if letter.isprintable() else " " for letter in words)


def draw_panel(axis: Axes, panel: Panel, bottom: bool) -> None:
    """Draw a panel into axes, with the label of x if it is the lowest of a stack."""
    if panel.zero:
        axis.axhline(0, color="#aaaaaa", linewidth=0.6, zorder=0)
    for curve in panel.curves:
        _curve(axis, curve)
    for arrow in panel.arrows:
        axis.annotate(
            "",
            xy=arrow.head,
            xytext=arrow.tail,
            arrowprops={"arrowstyle": "-|>", "color": "#222222", "linewidth": 0.8},
        )
    for mark in panel.marks:
        if mark.until is not None:
            axis.axvspan(mark.x, mark.until, color="#0072b2", alpha=0.1, linewidth=0, zorder=0)
        axis.axvline(mark.x, color="#777777", linewidth=0.6, linestyle=":")
        axis.annotate(
            verbatim(mark.text),
            xy=(mark.x, 1),
            xycoords=("data", "axes fraction"),
            xytext=(2, 1),
            textcoords="offset points",
            fontsize=6,
        )
    if panel.y_range is not None:
        axis.set_ylim(panel.y_range)
    if bottom:
        axis.set_xlabel(verbatim(panel.x_label))
    axis.set_ylabel(verbatim(panel.y_label))
    if panel.categories:
        axis.set_yticks(range(len(panel.categories)), [verbatim(w) for w in panel.categories])
        axis.set_ylim(len(panel.categories) - 0.5, -0.5)
        axis.set_xlim(left=0)
    handles, names = axis.get_legend_handles_labels()
    if handles:
        axis.legend(
            *(handles, names),
            title=verbatim(panel.title) or None,
            ncols=_legend_columns(names),
            loc="lower left",
            bbox_to_anchor=(0, 1),
            borderaxespad=0.2,
            alignment="left",
        )
    else:
        axis.set_title(verbatim(panel.title), loc="left")


def _legend_columns(names: Sequence[str]) -> int:
    return 3 if sum(map(len, names[:3])) < _LEGEND else 1


def _curve(axis: Axes, curve: Curve) -> None:
    colour = COLOURS[curve.colour]
    # A name that begins with an underscore would be left out of the legend.
    label = f" {verbatim(curve.name)}" if curve.name.startswith("_") else verbatim(curve.name)
    look: dict[str, Any] = {"color": colour, "label": label or None}
    if curve.style in _WIDTHS:
        look["linewidth"] = _WIDTHS[curve.style]
        if curve.style == "broad":
            look["alpha"] = 0.35
        if curve.style == "beads":
            look |= {"marker": "o", "markersize": 1.6}
        axis.plot(curve.x, curve.y, **look)
        return
    look |= {"linestyle": "none", "marker": "o", "markersize": 4}
    if curve.style == "specks":
        look["markersize"] = 1.6
    elif curve.style == "rings":
        look["markerfacecolor"] = "none"
    elif curve.style == "ticks":
        look["marker"] = "|"
    elif curve.style == "stems":
        axis.vlines(curve.x, np.minimum(curve.y, 0), np.maximum(curve.y, 0), color=colour)
    if curve.interval is not None:
        axis.hlines(curve.y, *curve.interval, color=colour)
    axis.plot(curve.x, curve.y, **look)
