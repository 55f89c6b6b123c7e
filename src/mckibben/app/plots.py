"""Drawings as plotly.js reads them in the workbench: thinned on the server, coloured for the theme."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.report import interactive
from mckibben.report.drawing import Drawing, over_time
from mckibben.report.interactive import text

Json = dict[str, Any]

POINTS = 4000
"""Most points of a curve sent to the page."""

CONFIG: Json = interactive.CLOSED | {
    # not named as in pages: plotly.js puts objects into that list, and no plot is drawn in NiceGUI then
    "modeBarButtonsToRemove": ["lasso2d", "sendChartToCloud", "sendDataToCloud"]
}


@cache
def colours(dark: bool) -> dict[str, str]:
    """Return the report's colours, by name, for a light or a dark page."""
    style = resources.files("mckibben.report").joinpath("templates/report.css").read_text("utf-8")
    light, _, rest = style.partition("@media")
    found = dict(re.findall(r"--([\w-]+):\s*(#[0-9a-fA-F]{3,8})", light))
    if dark:
        found |= dict(re.findall(r"--([\w-]+):\s*(#[0-9a-fA-F]{3,8})", rest.partition("@media")[0]))
    return found


def figures(drawing: Drawing, *, height: int = 420) -> list[Json]:
    """Return a drawing as figures for `mckibben.app.drawn.picture`."""
    return [_figure(plot, height) for plot in interactive.plots(drawing)]


def coloured(figure: Json, dark: bool) -> Json:
    """Return a figure with the colours of a theme for their names."""
    found: Json = _resolved(figure, colours(dark))
    return found


def _figure(plot: Json, height: int) -> Json:
    layout = plot["layout"]
    axis = {
        "automargin": True,
        "gridcolor": "--grid",
        "linecolor": "--rule",
        "zerolinecolor": "--rule",
    }
    for key in [key for key in layout if key.startswith(("xaxis", "yaxis"))]:
        layout[key] = axis | layout[key]
    layout |= {
        "height": height,
        "margin": {"l": 64, "r": 16, "t": 40, "b": 48},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": "--ink", "family": "system-ui, sans-serif", "size": 13},
        "legend": {"orientation": "h", "yref": "container", "y": 0, "yanchor": "bottom"},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "--muted", "activecolor": "--accent"},
        "uirevision": "kept",
    }
    figure = {"data": plot["data"], "layout": layout, "config": CONFIG}
    plain: Json = _resolved(figure, {})
    return plain


def _resolved(value: Any, palette: Mapping[str, str]) -> Any:
    """Return plain numbers for packed ones, and colours for their names."""
    if isinstance(value, dict):
        if set(value) == {"base", "f4"}:
            return _listed(interactive.unpacked(value))
        return {key: _resolved(item, palette) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_resolved(item, palette) for item in value]
    if isinstance(value, str) and value.startswith("--"):
        return palette.get(value[2:], value)
    return value


def _listed(values: Array) -> list[float | None]:
    return [None if np.isnan(value) else float(f"{value:.7g}") for value in values]


def window(recording: Recording, channels: list[str], low: float, high: float) -> list[Json]:
    """Return channels over a part of time, thinned anew, as ``x`` and ``y`` for `Plotly.restyle`.

    Parameters
    ----------
    recording : Recording
    channels : list of str
    low, high : float
        Ends of the part [s].
    """
    step = recording.sample_time or 1.0
    first = max(int((low - recording.start_time) / step) - 1, 0)
    last = min(int((high - recording.start_time) / step) + 2, len(recording))
    if last - first < 2:
        first, last = max(min(first, len(recording) - 2), 0), len(recording)
    time = recording.start_time + step * np.arange(first, last, dtype=np.float64)
    found = []
    for channel in channels:
        t, y = over_time(time, recording[channel][first:last], POINTS)
        found.append({"x": _listed(t), "y": _listed(y)})
    return found


def shaded(figure: Json, time: Array, ends: tuple[Array, Array], colour: str, name: str) -> None:
    """Shade what lies between the lower and the upper end of a band, behind a figure's curves.

    Parameters
    ----------
    figure : dict
        From `figures`; it is changed.
    time : array, shape (n,)
    ends : (array, array), each of shape (n,)
    colour, name : str
    """
    (t, low), (back, high) = (over_time(time, end, POINTS) for end in ends)
    around = np.append(t, back[::-1]), np.append(low, high[::-1])
    x, y = (_listed(values) for values in around)
    trace = {"type": "scatter", "mode": "lines", "name": text(name), "x": x, "y": y}
    look = {"fill": "toself", "fillcolor": f"--{colour}", "line": {"width": 0}, "opacity": 0.25}
    figure["data"].insert(0, trace | look | {"hoverinfo": "skip"})


def lines(
    curves: list[tuple[str, Array, Array, str]],
    *,
    x: str,
    y: str,
    height: int = 320,
    logarithmic: bool = False,
    bands: tuple[tuple[float, float], ...] = (),
    dotted: Collection[str] = (),
) -> Json:
    """Return named curves in one plane, y perhaps logarithmic, with bands that shade a range of y."""
    data = []
    for name, at, values, colour in curves:
        t, v = over_time(np.asarray(at, float), np.asarray(values, float), POINTS)
        line = {"color": f"--{colour}", "width": 1.6, "dash": "dot" if name in dotted else "solid"}
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": text(name),
                "x": _listed(t),
                "y": _listed(v),
            }
            | {"line": line}
        )
    shapes = [
        {
            "type": "rect",
            "xref": "paper",
            "x0": 0,
            "x1": 1,
            "y0": low,
            "y1": high,
            "line": {"width": 0},
        }
        | {"fillcolor": "--accent", "opacity": 0.12, "layer": "below"}
        for low, high in bands
    ]
    plot = {
        "data": data,
        "layout": {
            "xaxis": {"title": {"text": text(x)}},
            # without a format, ticks between decades are a 2 or a 5, whatever the decade
            "yaxis": {"title": {"text": text(y)}}
            | ({"type": "log", "tickformat": "~g"} if logarithmic else {}),
            "shapes": shapes,
            "showlegend": len(curves) > 1,
        },
    }
    return _figure(plot, height)
