"""Figures for print: drawings rendered by matplotlib at the width of a journal's column.

Neither pyplot nor any global state is touched, and the same drawing gives the same bytes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from mckibben.errors import DataError
from mckibben.outputs import MAKER
from mckibben.report.drawing import N_COLOURS, Curve, Drawing, Label, Panel
from mckibben.system.atomic import replacing
from mckibben.system.extras import demand

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN, PAGE = 88 / 25.4, 180 / 25.4
"""Width of one column of a journal, and of two with the space between them [in]."""

PAGE_HEIGHT, LEAST_HEIGHT = 240 / 25.4, 0.5
"""Largest height of a figure, and least height of axes, which has priority [in]."""

LABEL_HEIGHT = 0.9
"""Up to which a label beside axes is not broken [in]."""

PASSES = 3
"""Labels are broken where axes end, and axes begin where labels end: so often both are laid out."""

RESOLUTION = 600
"""Of PNG [dots per inch], as journals ask for lines."""

COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "measured": "#222222",
        "input": "#7c7c7c",
        "series-1": "#0071b0",
        "series-2": "#e7a209",
        "series-3": "#701c46",
        "series-4": "#ee5a63",
        "series-5": "#86c9ef",
        "series-6": "#0d5926",
        "series-7": "#d187b0",
        "series-8": "#896ebd",
        "series-9": "#2d1e79",
        "series-10": "#a03b11",
        "age-1": "#FDB42F",
        "age-2": "#ED7953",
        "age-3": "#C23C81",
        "age-4": "#7E03A8",
        "age-5": "#0D0887",
    }
)
"""Hues that colour-blind readers distinguish, each of a lightness of its own, for prints in grey."""

PLAIN = 3
"""Up to so many series are solid lines; more also differ by dashes and markers."""

DASHES, MARKERS = ("-", "--", "-.", ":"), ("", "o", "^")
"""Of lines: every dash without a marker, then with one after the other."""

DOTS = "os^DvP*X<>"
"""Markers of points without a line, by series."""

BEAD, STYLED_BEAD, LARGEST_BEAD, SMALLER, FEW_BEADS = 1.6, 2.4, 6.0, 1.8, 40
"""Size of a bead on a line, of one with a form of its own, of the first series' where a line has few:
there beads become smaller from series to series, so that equal ones show [pt]; how many are few."""

N_MARKERS = 8
"""Markers along a line."""

STYLE: Mapping[Any, Any] = MappingProxyType(
    {
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica"],
        "font.size": 8,
        "mathtext.fontset": "dejavusans",
        "axes.linewidth": 0.6,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlesize": 8,
        "axes.labelsize": 8,
        "xtick.labelsize": 7,
        "ytick.labelsize": 7,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "legend.frameon": False,
        "legend.fontsize": 7,
        "figure.facecolor": "white",
        "savefig.facecolor": "white",
        "pdf.fonttype": 42,
        "svg.fonttype": "none",
        "svg.hashsalt": "mckibben",
        "path.simplify": False,
        "text.parse_math": False,
    }
)
"""Letters of 7 to 8 pt, which vector formats hold as text."""

MOST_TICKS, APART = 7, 0.6
"""Ticks along x that are tried first where numbers touch, and the least gap between [letter heights]."""

_WIDTHS = {"line": 0.9, "fine": 0.4, "broad": 3.2, "beads": 0.5}
"""Of lines [pt], by style."""

_POINTERS = {"ticks": "|", "above": "^", "below": "v"}
"""Markers that are the same for every series, by style."""

_POINTS = 72
"""In an inch."""

_CATEGORIES = 0.35
"""Largest share of a figure's width for the words beside an axis."""

_HANDLE, _GAP, _BETWEEN = 2.4, 0.6, 1.4
"""Of a legend: length of a line, its distance from its name, and between columns [letter heights]."""

METADATA: Mapping[str, Mapping[str, str | None]] = MappingProxyType(
    {
        "png": {"Software": MAKER},
        "svg": {"Creator": MAKER, "Date": None},
        "pdf": {"Creator": MAKER, "CreationDate": None},
    }
)
"""What each format records of what it was made by, and not of when."""


def save(drawing: Drawing, path: str | Path, columns: Literal[1, 2] | None = None) -> None:
    """Write a drawing; on failure an earlier file is unchanged.

    Parameters
    ----------
    drawing : Drawing
        What to draw.
    path : path
        File to write; its suffix is ``.png`` (600 dots per inch), ``.svg`` or ``.pdf``.
    columns : {1, 2}, optional
        Width: one column of a journal, 88 mm, or two, 180 mm. Default: one, or two for panels side by
        side.

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
        canvas = draw_figure(drawing, columns)
        canvas.savefig(figure, format=kind, dpi=RESOLUTION, metadata=dict(METADATA[kind]))
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


def draw_figure(drawing: Drawing, columns: Literal[1, 2] | None = None) -> Figure:
    """Return a drawing as a matplotlib figure; `save` adds the style of this module."""
    demand("matplotlib", "figures", "figures for print")
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained", dpi=RESOLUTION)  # letters are measured as they are drawn
    draw_on(figure, drawing, columns)
    return figure


def draw_on(
    figure: Figure, drawing: Drawing, columns: Literal[1, 2] | None = None, scale: float = 1.0
) -> list[Axes]:
    """Draw into a new figure, and return its axes.

    The figure is as high as its axes, labels and legends need; so no text is cut off or lies on
    another.

    Parameters
    ----------
    figure : Figure
        Empty, with the layout ``"constrained"``.
    drawing : Drawing
    columns : {1, 2}, optional
        Width, as in `save`.
    scale : float
        Of width and height.
    """
    n = len(drawing.panels)
    abreast = 1 if drawing.stacked or columns == 1 else min(n, drawing.abreast)
    rows = -(-n // abreast)
    width = scale * (COLUMN if (columns or min(abreast, 2)) == 1 else PAGE)
    height = scale * _axes_height(drawing, width / scale / abreast)
    figure.set_size_inches(width, 3 * rows * height)
    all_axes = list(figure.subplots(rows, abreast, squeeze=False, sharex=drawing.stacked).ravel())
    axes = all_axes[:n]
    for axis in all_axes[n:]:
        axis.set_axis_off()
    styles = styled(drawing)
    for index, (panel, axis) in enumerate(zip(drawing.panels, axes, strict=True)):
        below = drawing.panels[index + abreast : index + abreast + 1]
        beside = drawing.panels[index - 1 : index] if index % abreast else ()
        last = all(neighbour.x_label != panel.x_label for neighbour in below)
        first = all(neighbour.y_label != panel.y_label for neighbour in beside)
        draw_panel(axis, panel, bottom=last, left=first, styled=styles)
    if drawing.note:
        size = _size("legend.fontsize")
        note = wrapped(verbatim(drawing.note), _POINTS * width - 2 * size, size)
        figure.supxlabel(note, fontsize=size)
    for repetition in range(PASSES):
        figure.draw_without_rendering()
        boxes = [axis.get_window_extent().height / figure.dpi for axis in all_axes[::abreast]]
        other_height = figure.get_size_inches()[1] - sum(boxes)
        fitting = min(height, max((scale * PAGE_HEIGHT - other_height) / rows, LEAST_HEIGHT))
        for panel, axis in zip(drawing.panels, axes, strict=True):
            wrap_labels(axis, panel, _POINTS * max(fitting, LABEL_HEIGHT))
            thin_ticks(axis)
        if repetition:
            figure.set_size_inches(width, other_height + rows * fitting)
        else:
            _legends(figure, axes)
    return axes


def _legends(figure: Figure, axes: Sequence[Axes]) -> None:
    """Add one legend above all axes, or one to each where a look has several names.

    The figure becomes as high as the legends need at most.
    """
    by_axes = [_entries(axis) for axis in axes]
    unique = list(
        {(entry.name, entry.look): entry for entries in by_axes for entry in entries}.values()
    )
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + sum(map(len, by_axes)))
    if len({entry.look for entry in unique}) == len(unique):
        _legend(figure, unique, _POINTS * width, loc="outside upper left")
    else:
        for axis in axes:
            axis_legend(axis)


def draw_into(axes: Sequence[Axes], drawing: Drawing) -> None:
    """Draw every panel into given axes, each with its legend above."""
    last = len(axes) - 1
    for index, (panel, axis) in enumerate(zip(drawing.panels, axes, strict=True)):
        draw_panel(axis, panel, not drawing.stacked or index == last, styled=styled(drawing))
        wrap_labels(axis, panel, _inside(axis)[1])
        axis_legend(axis)


def verbatim(words: str) -> str:
    """Return text without line breaks and unprintable characters."""
    return "".join(letter if letter.isprintable() else " " for letter in words)


def wrapped(words: str, width: float, size: float) -> str:
    """Return text in lines of a width, broken where words end, or within words that are longer.

    Parameters
    ----------
    words : str
        In one line.
    width, size : float
        Of a line, and of the letters [pt].
    """
    lines = [""]
    for piece in re.findall(rf"[^{_ENDS}]*[{_ENDS}]+|[^{_ENDS}]+", words):
        if lines[-1] and _width(lines[-1] + piece.rstrip(), size) > width:
            lines.append("")
        while (fits := _letters(piece.rstrip(), width, size)) < len(piece.rstrip()):
            lines[-1], piece = piece[:fits], piece[fits:]
            lines.append("")
        lines[-1] += piece
    return "\n".join(line.strip() for line in lines)


_ENDS = r"\s_/,;\-"
"""Letters after which a name may be broken."""


def _letters(words: str, width: float, size: float) -> int:
    """Return how many letters fit into a width, at least one."""
    fits = len(words)
    while fits > 1 and _width(words[:fits], size) > width:
        fits -= 1
    return max(fits, 1)


def _width(words: str, size: float, mathematics: bool = False) -> float:
    """Return the width of text [pt]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    if not words:
        return 0.0
    extent = text_to_path.get_text_width_height_descent(
        words, FontProperties(size=size), mathematics
    )
    return float(extent[0])


def _size(name: str) -> float:
    """Return a size of letters from matplotlib's settings [pt]."""
    from matplotlib import rcParams
    from matplotlib.font_manager import FontProperties

    settings: Mapping[Any, Any] = rcParams
    return float(FontProperties(size=settings[name]).get_size_in_points())


def _figure(axis: Axes) -> Figure:
    figure = axis.get_figure(root=True)
    assert figure is not None
    return figure


def _inside(axis: Axes) -> tuple[float, float]:
    """Return width and height of axes [pt]."""
    box = axis.get_window_extent()
    points = _POINTS / _figure(axis).dpi
    return box.width * points, box.height * points


def _axes_height(drawing: Drawing, width: float) -> float:
    """Return the height of axes [in] in panels of a width."""
    if words := drawing.panels[0].categories:
        size, widest = _size("ytick.labelsize"), _POINTS * width * _CATEGORIES
        lines = max(wrapped(verbatim(category), widest, size).count("\n") for category in words)
        return 0.3 + (0.2 + 1.2 * lines * size / _POINTS) * len(words)
    if drawing.stacked or drawing.abreast == 1:
        return 1.2
    return min(0.62 * width, 2.2)


def styled(drawing: Drawing) -> bool:
    """Return whether a drawing has more series than differ by colour alone."""
    curves = [curve for panel in drawing.panels for curve in panel.curves]
    return len({curve.colour for curve in curves if curve.colour.startswith("series")}) > PLAIN


def draw_panel(
    axis: Axes, panel: Panel, bottom: bool, left: bool = True, styled: bool = False
) -> None:
    """Draw a panel into axes, with the labels of x and y that no neighbour below or beside has."""
    if panel.zero:
        axis.axhline(0, color="#aaaaaa", linewidth=0.6, zorder=0)
    for curve in panel.curves:
        _curve(axis, curve, styled)
    for arrow in panel.arrows:
        axis.annotate(
            "",
            xy=arrow.head,
            xytext=arrow.tail,
            arrowprops={"arrowstyle": "-|>", "color": "#222222", "linewidth": 0.8},
        )
    for mark in panel.marks:
        look: dict[str, Any] = {"label": verbatim(mark.text)}
        if mark.until is not None:
            axis.axvspan(mark.x, mark.until, color="#e5eef5", linewidth=0, zorder=0, **look)
            look = {}
        axis.axvline(mark.x, color=COLOURS["input"], linewidth=0.6, linestyle=":", zorder=0, **look)
    if panel.y_range is not None:
        axis.set_ylim(panel.y_range)
    if bottom:
        axis.set_xlabel("x")  # holds the place until `wrap_labels`
    axis.set_ylabel("y" if left and str(panel.y_label) else "")
    if panel.title:
        axis.set_title("title", loc="left")
    if panel.categories:
        widest = _POINTS * _figure(axis).get_size_inches()[0] * _CATEGORIES
        size = _size("ytick.labelsize")
        words = [wrapped(verbatim(one), widest, size) for one in panel.categories]
        axis.set_yticks(range(len(words)), words)
        axis.set_ylim(len(words) - 0.5, -0.5)
        axis.set_xlim(left=0)


def wrap_labels(axis: Axes, panel: Panel, height: float) -> None:
    """Write labels and title of axes in lines as long as these; ``height`` of the axes in pt."""
    width, size = _inside(axis)[0], _size("axes.labelsize")
    if axis.get_xlabel():
        axis.set_xlabel(_worded(panel.x_label, width, size), parse_math=True)
    if axis.get_ylabel():
        axis.set_ylabel(_worded(panel.y_label, height, size), parse_math=True)
    if panel.title:
        words = wrapped(verbatim(panel.title), width, _size("axes.titlesize"))
        legend = axis.get_legend()
        axis.set_title(words, loc="left") if legend is None else legend.set_title(words)


def thin_ticks(axis: Axes) -> None:
    """Take fewer ticks along x as long as their numbers touch."""
    for n in range(MOST_TICKS, 1, -1):
        low, high = sorted(axis.get_xlim())
        labels = [
            label for label in axis.get_xticklabels() if low <= label.get_position()[0] <= high
        ]
        boxes = [label.get_window_extent() for label in labels if label.get_text()]
        gap = APART * _size("xtick.labelsize") * _figure(axis).dpi / _POINTS
        if all(next_.x0 - label.x1 > gap for label, next_ in pairwise(boxes)):
            return
        axis.locator_params(axis="x", nbins=n)


def _worded(label: Label | str, width: float, size: float) -> str:
    """Return a label in lines, with its symbol as mathematics."""
    if isinstance(label, str):
        label = Label(label)
    symbol = f"${label.symbol}$" if label.symbol else ""
    unit = f"[{verbatim(label.unit)}]" if label.unit else ""
    tail = " ".join(filter(None, (symbol, unit.replace("$", r"\$"))))
    words = wrapped(verbatim(label.name), width, size)
    last = _width(words.rpartition("\n")[2] + " ", size) + _width(tail, size, bool(symbol))
    return words.replace("$", r"\$") + ("\n" if last > width else " ") * bool(tail) + tail


class _Entry(NamedTuple):
    """What is in a legend: a name, what is drawn, and how it looks."""

    name: str
    handle: Any
    look: tuple[Any, ...]


def _entries(axis: Axes) -> list[_Entry]:
    """Return what is in the legend of axes."""
    entries = []
    for handle, name in zip(*axis.get_legend_handles_labels(), strict=True):
        attributes = ("color", "linestyle", "linewidth", "marker", "markerfacecolor", "facecolor")
        look = (getattr(handle, f"get_{attribute}", lambda: None)() for attribute in attributes)
        entries.append(_Entry(name, handle, tuple(map(str, look))))
    return entries


def axis_legend(axis: Axes) -> None:
    """Add a legend above axes, no wider than these, and with their title."""
    _legend(axis, _entries(axis), _inside(axis)[0], loc="lower left", bbox_to_anchor=(0, 1))
    title, legend = axis.get_title(loc="left"), axis.get_legend()
    if title and legend is not None:
        axis.set_title("", loc="left")
        legend.set_title(title)


def _legend(parent: Axes | Figure, entries: Sequence[_Entry], width: float, **place: Any) -> None:
    """Add a legend with as many columns as a width [pt] has room for."""
    size = _size("legend.fontsize")
    handle_width, gap = (_HANDLE + _GAP) * size, _BETWEEN * size
    room = width - 2 * size
    names = [wrapped(entry.name, room - handle_width, size) for entry in entries]
    sizes = [handle_width + max(_width(line, size) for line in name.split("\n")) for name in names]

    def needed(columns: int) -> float:
        """Return the width of a legend that is filled column by column, as matplotlib does."""
        return sum(max(entry) + gap for entry in np.array_split(sizes, columns)) - gap

    fitting = [n for n in range(1, len(names) + 1) if needed(n) <= room]
    if names:
        parent.legend(
            *([entry.handle for entry in entries], names),
            ncols=max(fitting, default=1),
            handlelength=_HANDLE,
            handletextpad=_GAP,
            columnspacing=_BETWEEN,
            borderaxespad=0.2,
            alignment="left",
            **place,
        )


def _curve(axis: Axes, curve: Curve, styled: bool) -> None:
    colour = COLOURS[curve.colour]
    # A name that begins with an underscore would be left out of the legend.
    label = f" {verbatim(curve.name)}" if curve.name.startswith("_") else verbatim(curve.name)
    look: dict[str, Any] = {"color": colour, "label": label or None}
    series = int(curve.colour.removeprefix("series-")) - 1 if "series" in curve.colour else None
    bead = BEAD
    if curve.x.size <= FEW_BEADS and series is not None:
        bead = max(bead, LARGEST_BEAD - SMALLER * series)
    if not styled:
        series = None
    if curve.style in _WIDTHS:
        look["linewidth"] = _WIDTHS[curve.style]
        if curve.style == "broad":
            look["alpha"] = 0.35
        if series is not None:
            look["linestyle"] = DASHES[series % len(DASHES)]
            look["marker"] = MARKERS[series // len(DASHES)]
            step = max(curve.x.size // N_MARKERS, 1)
            look |= {"markersize": 3, "markevery": (series * step // N_COLOURS, step)}
        if curve.style == "beads":
            look |= {"marker": "o" if series is None else DOTS[series], "markevery": 1}
            look["markersize"] = bead if series is None else max(bead, STYLED_BEAD)
        axis.plot(curve.x, curve.y, **look)
        return
    look |= {"linestyle": "none", "marker": DOTS[series or 0], "markersize": 4}
    if curve.style == "specks":
        look["markersize"] = BEAD if series is None else STYLED_BEAD
    elif curve.style == "rings":
        look["markerfacecolor"] = "none"
    elif curve.style in _POINTERS:
        look |= {"marker": _POINTERS[curve.style], "markersize": 5, "clip_on": False}
    elif curve.style == "stems":
        axis.vlines(curve.x, np.minimum(curve.y, 0), np.maximum(curve.y, 0), color=colour)
    if curve.interval is not None:
        axis.hlines(curve.y, *curve.interval, color=colour)
    axis.plot(curve.x, curve.y, **look)
