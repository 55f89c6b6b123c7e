"""Figures for plotly.js: plain dicts with packed numbers.

Nothing of plotly is imported: the page's own script unpacks the numbers and looks up the colours,
which depend on whether the page is dark or light.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.notation import in_unicode
from mckibben.report.drawing import Arrow, Curve, Drawing, Label, Mark, Panel

Json = dict[str, Any]

CLOSED: Json = {"displaylogo": False, "showSendToCloud": False, "plotlyServerURL": ""}
"""Settings without which plotly.js has a button that uploads the data."""

BAR: Json = CLOSED | {
    "modeBarButtons": [["toImage"], ["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]]
}
"""The tool bar of every plot of a page: its buttons are named, so that none comes with a new version."""

_WIDTHS = {"line": 1.5, "fine": 0.8, "broad": 5.0, "beads": 1.0}
"""Of lines [px], by style."""

_SYMBOLS = {"dots": "circle", "rings": "circle-open", "ticks": "line-ns-open"} | {
    "above": "triangle-up",
    "below": "triangle-down",
}
"""Separate marks, by style."""

_GAP = 0.3
"""Height between stacked panels, relative to that of a panel."""


def plots(drawing: Drawing) -> list[Json]:
    """Return the plots of a drawing: one for stacked panels, else one each."""
    if drawing.stacked:
        return [_plot(drawing.panels)]
    return [_plot((panel,)) for panel in drawing.panels]


def packed(values: Array) -> Json:
    """Return numbers packed for the page's script: seven digits relative to a base.

    The base keeps the digits of numbers that are large and close together, such as times.

    Parameters
    ----------
    values : array, shape (n,)
        NaN is a gap.
    """
    values = np.asarray(values, dtype=np.float64)
    finite = values[np.isfinite(values)]
    base = float(finite[0]) if finite.size else 0.0
    return {"base": base, "f4": b64encode((values - base).astype("<f4").tobytes()).decode("ascii")}


def unpacked(numbers: Json) -> Array:
    """Return the numbers of `packed`, as the page's script does."""
    return np.frombuffer(b64decode(numbers["f4"]), dtype="<f4").astype(float) + numbers["base"]


def text(words: str) -> str:
    """Return text that plotly.js shows verbatim, with its markup escaped."""
    return escape(words, quote=False)


def labelled(label: Label | str) -> str:
    r"""Return a label with its symbol in plotly.js's markup.

    >>> labelled(Label("pressure_1", "bar", "p_{1}")), labelled(Label("contraction", "", r"\epsilon"))
    ('pressure_1 <i>p</i><sub>1</sub> [bar]', 'contraction <i>ε</i>')
    """
    if isinstance(label, str):
        return text(label)
    letter, _, below = in_unicode(label.symbol).partition("_")
    under = f"<sub>{text(below.strip('{}'))}</sub>" if below else ""
    symbol = f" <i>{text(letter)}</i>{under}" if letter else ""
    return f"{text(label.name)}{symbol}{text(f' [{label.unit}]') if label.unit else ''}"


def resolved(value: Any, colours: Mapping[str, str]) -> Any:
    """Return plain numbers for packed ones, and colours for names, as the page's script does."""
    if isinstance(value, dict):
        if set(value) == {"base", "f4"}:
            return unpacked(value)
        return {key: resolved(item, colours) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [resolved(item, colours) for item in value]
    if isinstance(value, str) and value.startswith("--"):
        return colours.get(value[2:], "#222222")
    return value


def _plot(panels: tuple[Panel, ...]) -> Json:
    layout: Json = {"annotations": [], "shapes": [], "showlegend": False}
    traces: list[Json] = []
    height = 1 / (len(panels) + _GAP * (len(panels) - 1))
    for row, panel in enumerate(panels):
        x, y = (f"{axis}{row + 1 if row else ''}" for axis in "xy")
        bottom = (len(panels) - 1 - row) * height * (1 + _GAP)
        last = row == len(panels) - 1
        layout[f"xaxis{x[1:]}"] = _axis(panel.x_label if last else "") | {
            "anchor": y,
            "rangemode": "tozero" if panel.categories else "normal",
            "showticklabels": last,
            **({"matches": "x"} if row else {}),
        }
        layout[f"yaxis{y[1:]}"] = _axis(panel.y_label) | {
            "domain": [bottom, min(bottom + height, 1.0)],
            "zeroline": panel.zero,
            **({"range": list(panel.y_range)} if panel.y_range else {}),
            **_ticks(panel),
        }
        named = [_trace(curve, x, y) for curve in panel.curves]
        traces += named
        layout["showlegend"] |= any(curve.name and curve.model is None for curve in panel.curves)
        layout["annotations"] += [_arrow(arrow, x, y) for arrow in panel.arrows]
        for mark in panel.marks:
            shapes, word = _mark(mark, {"xref": x, "yref": f"{y} domain"})
            layout["shapes"] += shapes
            layout["annotations"].append(word)
        if panel.title:
            layout["title"] = {"text": text(panel.title)}
    return {"data": traces, "layout": layout}


def _arrow(arrow: Arrow, x: str, y: str) -> Json:
    (x0, y0), (x1, y1) = arrow.tail, arrow.head
    return (
        {"xref": x, "yref": y, "axref": x, "ayref": y, "x": x1, "y": y1, "ax": x0, "ay": y0}
        | {"text": "", "showarrow": True, "arrowhead": 2, "arrowsize": 1.3}
        | {"arrowwidth": 1.6, "arrowcolor": "--ink"}
    )


def _mark(mark: Mark, axes: Json) -> tuple[list[Json], Json]:
    """Return the line of a mark, with its shaded interval if it has one, and its name."""
    line: Json = {"type": "line", "x0": mark.x, "x1": mark.x, "y0": 0, "y1": 1}
    line["line"] = {"color": "--muted", "width": 1, "dash": "dot"}
    shapes = [axes | line]
    position, anchor = (mark.x, "left") if mark.until is None else (mark.until, "right")
    word = {"x": position, "y": 1, "text": text(mark.text), "showarrow": False}
    if mark.until is not None:
        area = {"type": "rect", "x1": mark.until, "line": {"width": 0}}
        look = {"fillcolor": "--accent", "opacity": 0.12, "layer": "below"}
        shapes.append(axes | line | area | look)
    return shapes, axes | word | {"xanchor": anchor, "yanchor": "bottom"}


def _axis(label: Label | str) -> Json:
    return {"title": {"text": labelled(label)}} if str(label) else {}


def _ticks(panel: Panel) -> Json:
    if not panel.categories:
        return {}
    places = list(range(len(panel.categories)))
    return {
        "tickvals": places,
        "ticktext": [text(word) for word in panel.categories],
        "range": [len(places) - 0.5, -0.5],
        "ticklabelstandoff": 8,
    }


def _trace(curve: Curve, x: str, y: str) -> Json:
    colour = f"--{curve.colour}"
    trace: Json = {
        "type": "scatter",
        "x": packed(curve.x),
        "y": packed(curve.y),
        "xaxis": x,
        "yaxis": y,
        "name": text(curve.name or curve.model or ""),
        "showlegend": bool(curve.name),
        "meta": curve.model,
    }
    if curve.style in _WIDTHS:
        trace |= {"mode": "lines", "line": {"color": colour, "width": _WIDTHS[curve.style]}}
        if curve.style == "broad":
            trace["opacity"] = 0.35
        if curve.style == "beads":
            trace |= {"mode": "lines+markers", "marker": {"color": colour, "size": 4}}
        return trace
    if curve.style == "specks":
        return trace | {"mode": "markers", "marker": {"color": colour, "size": 4}}
    if curve.style == "stems":
        n = curve.x.size
        gap = np.full(n, np.nan)
        return trace | {
            "x": packed(np.column_stack([curve.x, curve.x, gap]).ravel()),
            "y": packed(np.column_stack([np.zeros(n), curve.y, gap]).ravel()),
            "mode": "lines+markers",
            "line": {"color": colour, "width": 2},
            "marker": {"color": colour, "size": [0, 8, 0] * n, "opacity": 1, "line": {"width": 0}},
        }
    symbol = _SYMBOLS[curve.style]
    marker = {"color": colour, "size": 10, "symbol": symbol, "line": {"color": colour, "width": 2}}
    trace |= {"mode": "markers", "marker": marker}
    if curve.interval is not None:
        low, high = curve.interval
        bars = {"array": packed(high - curve.x), "arrayminus": packed(curve.x - low)}
        trace["error_x"] = {"type": "data", "symmetric": False, "color": colour, "width": 5, **bars}
    return trace
