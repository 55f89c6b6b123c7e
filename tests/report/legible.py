"""What makes a drawing legible in print: nothing cut off or overlapping, series that differ in grey."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations
from typing import Any, Literal

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text

from mckibben.report import printed
from mckibben.report.drawing import Drawing, jumps

SERIES = {colour for name, colour in printed.COLOURS.items() if name.startswith("series")}
MILLIMETRES = {1: 88.0, 2: 180.0}
LINES = {"line", "fine", "broad", "beads"}


@contextmanager
def made(drawing: Drawing, columns: Literal[1, 2] | None = None) -> Iterator[Figure]:
    """Yield a drawing as it is printed."""
    with rc_context(dict(printed.STYLE)):
        figure = printed.draw_figure(drawing, columns)
        figure.draw_without_rendering()
        yield figure


def legends(figure: Figure) -> list[Any]:
    return figure.findobj(Legend)


def lightness(colour: Any) -> float:
    """Return CIE L* of a colour, which grey prints show."""
    linear = np.array([c / 12.92 if c <= 0.04 else ((c + 0.055) / 1.055) ** 2.4 for c in colour])
    luminance = float(linear @ [0.2126, 0.7152, 0.0722])
    return 116 * luminance ** (1 / 3) - 16


def distinct(legend: Any) -> bool:
    """Return whether no two entries of a legend look alike, also in grey."""
    lines = [one for one in legend.legend_handles if hasattr(one, "get_color")]
    grey = sorted(lightness(to_rgb(one.get_color())) for one in lines)
    series = [one for one in lines if one.get_color() in SERIES]
    looks = {(one.get_linestyle(), str(one.get_marker())) for one in series}
    few = len(series) <= printed.PLAIN
    return bool(np.all(np.diff(grey) > 5)) and (few or len(looks) == len(series))


def numbers(axis: Any) -> list[Any]:
    """Return the numbers along axes that are inside them."""
    shown = []
    for place, side in enumerate((axis.xaxis, axis.yaxis)):
        low, high = sorted(side.get_view_interval())
        shown += [x for x in side.get_ticklabels() if low <= x.get_position()[place] <= high]
    return [one for one in shown if one.get_text() and one.get_visible()]


def assert_legible(figure: Figure, columns: Literal[1, 2] | None = None) -> None:
    """Check that nothing is cut off, overlaps or looks alike."""
    width, height = figure.get_size_inches()
    widths = [MILLIMETRES[columns]] if columns else [*MILLIMETRES.values()]
    assert any(25.4 * width == pytest.approx(allowed) for allowed in widths)
    whole = figure.get_tightbbox()
    assert min(whole.x0, whole.y0) >= -0.01
    assert max(whole.x1 - width, whole.y1 - height) <= 0.01
    parts: list[Any] = [*legends(figure)]
    for axis in figure.axes:
        if axis.axison:
            parts += [axis.patch, axis.xaxis.label, axis.yaxis.label, axis._left_title]  # type: ignore[attr-defined]
            parts += numbers(axis)
    boxes = [part.get_window_extent().padded(-0.5) for part in parts]
    for one, other in combinations([box for box in boxes if box.width > 0], 2):
        assert not one.overlaps(other), (one, other)
    sizes: list[Any] = [one.get_fontsize() for one in figure.findobj(Text) if one.get_text()]
    assert min(sizes) >= 7
    assert max(sizes) <= 9
    assert all(map(distinct, legends(figure)))


def assert_readable(drawing: Drawing) -> None:
    """Check a figure of a paper: a colour a name, units on axes, lines that are paths."""
    curves = [curve for panel in drawing.panels for curve in panel.curves]
    named = [(curve.name, curve.colour) for curve in curves if curve.name]
    assert len({name for name, _ in named}) == len({colour for _, colour in named}) == len(named)
    for panel in drawing.panels:
        assert panel.curves
        for label in (panel.x_label, panel.y_label):
            assert str(label).endswith("]") or (panel.categories and not str(label)), label
        for curve in panel.curves:
            assert np.isfinite(curve.y).any()
            assert curve.style not in LINES or not jumps(curve.x), (panel.title, curve.name)
    with made(drawing) as figure:
        assert_legible(figure)
