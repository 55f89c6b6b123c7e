"""Figures independent of any drawing library: panels of curves, thinned for display."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.channels import channel_symbol
from mckibben.recording import Recording

Style = Literal[
    "line", "fine", "broad", "beads", "specks", "dots", "rings", "ticks", "stems", "above", "below"
]
"""How points are drawn: a line, a thin one, a pale wide one to lie under others, a line with a bead
at every point, small dots without a line, or separate marks; of a curve that leaves its panel, arrow
heads that point to where it is."""

POINTS = 4000
"""Most points of a curve: two for each of 2000 bins, more than a screen or a column has pixels."""

FEW = 300
"""Up to so many samples, each measured one is shown as a bead on its line."""

JUMP = 0.05
"""Median step of the input over its range from which a path is drawn as dots: a line would cross the
loop at every step."""

MARGIN = 0.05
"""Space above and below the curves of a panel that some leave, relative to its height."""

N_COLOURS = 10
"""Number of distinguishable colours, the most models or recordings in a panel."""

N_AGES = 5
"""Steps of the colour scale from early to late."""


@dataclass(frozen=True)
class Curve:
    """One line or set of points.

    Parameters
    ----------
    x, y : array, shape (n,)
        Points in order.
    name : str
        In the legend; empty for none.
    colour : str
        ``"measured"``, ``"input"``, ``"series-1"`` to ``"series-10"``, or ``"age-1"`` (early) to
        ``"age-5"`` (late).
    style : Style
        How the points are drawn.
    model : str or None
        The model it belongs to, by which it is shown or hidden.
    interval : (array, array) or None
        Lower and upper end of every x, each of shape (n,).
    """

    x: Array
    y: Array
    name: str = ""
    colour: str = "measured"
    style: Style = "line"
    model: str | None = None
    interval: tuple[Array, Array] | None = None


@dataclass(frozen=True)
class Arrow:
    """The direction of time on a curve: from tail to head, each (x, y)."""

    tail: tuple[float, float]
    head: tuple[float, float]


@dataclass(frozen=True)
class Label:
    """Label of an axis.

    Parameters
    ----------
    name : str
        What is drawn, in words.
    unit : str
        Empty for none.
    symbol : str
        In LaTeX, as in the equations; empty for none.
    """

    name: str
    unit: str = ""
    symbol: str = ""

    def __str__(self) -> str:
        """Return name and unit."""
        return axis_label(self.name, self.unit)


@dataclass(frozen=True)
class Mark:
    """A vertical line with a name; with an end, a shaded interval."""

    x: float
    text: str
    until: float | None = None


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Parameters
    ----------
    x_label, y_label : Label or str
        With units.
    curves : tuple of Curve
        Later ones lie on top.
    title : str
        Above the panel; empty for none.
    arrows, marks : tuple
        Directions of time, and vertical lines.
    zero : bool
        Whether to draw the line y = 0.
    categories : tuple of str
        Words for y = 0, 1, ... from the top down, instead of numbers.
    least : float
        Least height of the y axis, so that rounding does not fill it.
    limits : (float, float) or None
        Of the y axis, where not all curves are to be inside.
    """

    x_label: Label | str
    y_label: Label | str
    curves: tuple[Curve, ...]
    title: str = ""
    arrows: tuple[Arrow, ...] = ()
    marks: tuple[Mark, ...] = ()
    zero: bool = False
    categories: tuple[str, ...] = ()
    least: float = 0.0
    limits: tuple[float, float] | None = None

    @property
    def y_range(self) -> tuple[float, float] | None:
        """Limits of the y axis, if not from the curves."""
        if self.limits is not None:
            return self.limits
        parts = [curve.y[np.isfinite(curve.y)] for curve in self.curves]
        values = np.concatenate([*parts, np.zeros(int(self.zero))])
        if not values.size or np.ptp(values) >= self.least:
            return None
        middle = (values.min() + values.max()) / 2
        return float(middle - self.least / 2), float(middle + self.least / 2)


@dataclass(frozen=True)
class Drawing:
    """A figure.

    Parameters
    ----------
    panels : tuple of Panel
        At least one.
    stacked : bool
        Whether the panels stand one below the other on the same x axis; else side by side.
    abreast : int
        How many panels stand side by side at most.
    note : str
        What the figure leaves out; empty for nothing.
    """

    panels: tuple[Panel, ...]
    stacked: bool = False
    abreast: int = 3
    note: str = ""


def over_time(time: Array, y: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Return uniform time and y thinned to at most ``points``, with all visible extrema."""
    from mckibben.signals import decimate_minmax

    time, y = decimate_minmax(time, y, max_points=points)
    return time, y


def along(x: Array, y: Array, points: int = POINTS) -> tuple[Array, Array, Array]:
    """Return sample numbers, x and y of a path thinned to at most ``points``, 4 or more.

    Extrema of both x and y stay, so that a loop keeps its tips and its width.
    """
    from mckibben.signals import decimate_minmax

    places, x, y = decimate_minmax(np.arange(x.size, dtype=float), x, y, max_points=points)
    return places, x, y


def jumps(x: Array) -> bool:
    """Return whether a line along values would cross its figure at every step.

    >>> jumps(np.array([0.0, 1.0, 0.1, 0.9])), jumps(np.array([0.0, 0.3, 0.6, 1.0]))
    (True, False)
    """
    steps = np.diff(x)
    turns = not (np.all(steps >= 0) or np.all(steps <= 0))
    return turns and bool(np.median(np.abs(steps)) > JUMP * np.ptp(x))


def within(panel: Panel, least: float = 0.0) -> Panel:
    """Return a panel that shows its first curve, and all that stay near it.

    A curve that goes farther from the first than this is high is cut off, with an arrow head that
    points to where it is, so that no outlier hides the rest.

    Parameters
    ----------
    panel : Panel
    least : float
        What counts as near at least, if the first curve is low.
    """
    values = [curve.y[~np.isnan(curve.y)] for curve in panel.curves]
    low, high = float(values[0].min()), float(values[0].max())
    reach = max(high - low, least)
    ends = [(float(y.min()), float(y.max())) if y.size else (low, high) for y in values]
    is_near = [low - reach <= lowest and highest <= high + reach for lowest, highest in ends]
    if all(is_near):
        return panel
    inside = [pair for pair, is_inside in zip(ends, is_near, strict=True) if is_inside]
    low, high = min(pair[0] for pair in inside), max(pair[1] for pair in inside)
    height = max(high - low, reach)
    limits = low - MARGIN * height, high + MARGIN * height
    # a curve cut off a height away still leaves the panel, and is a number for every library
    far = low - height, high + height
    curves = [
        curve if is_inside else replace(curve, y=np.clip(curve.y, *far))
        for curve, is_inside in zip(panel.curves, is_near, strict=True)
    ]
    leaving = [curve for curve, is_inside in zip(curves, is_near, strict=True) if not is_inside]
    heads = [
        head
        for place, curve in enumerate(leaving)
        for head in _heads(curve, limits, MARGIN * height / 2, (place + 0.5) / len(leaving))
    ]
    return replace(panel, curves=(*curves, *heads), limits=limits)


def _heads(curve: Curve, limits: tuple[float, float], inside: float, share: float) -> list[Curve]:
    """Return arrow heads at the limits that a curve passes, at a share of the way along x beyond."""
    heads: list[Curve] = []
    styles: tuple[Style, Style] = "above", "below"
    out_of = curve.y > limits[1], curve.y < limits[0]
    for style, out, y in zip(styles, out_of, (limits[1] - inside, limits[0] + inside), strict=True):
        if out.any():
            x = np.quantile(curve.x[out], share, method="nearest")
            heads.append(Curve(np.array([x]), np.array([y]), "", curve.colour, style, curve.model))
    return heads


def axis_label(channel: str, unit: str) -> str:
    """Return the label of an axis.

    >>> axis_label("pressure", "bar"), axis_label("contraction", "")
    ('pressure [bar]', 'contraction')
    """
    return f"{channel} [{unit}]" if unit else channel


def channel_label(
    recording: Recording, channel: str, symbols: Mapping[str, str] | None = None
) -> Label:
    """Return the label of the axis of a channel.

    Parameters
    ----------
    recording : Recording
        With the unit.
    channel : str
    symbols : mapping of str to str, optional
        Of channels in the equations of the model that is drawn; others have their usual ones.
    """
    symbol = (symbols or {}).get(channel) or channel_symbol(channel)
    return Label(channel, recording.units[channel], symbol)


TIME = Label("time", "s", "t")


def time_label(recording: Recording) -> Label:
    """Return the label of the time axis of a recording."""
    return Label("sample") if recording.sample_time is None else TIME


def left_out(names: Sequence[str]) -> str:
    """Return the note on curves that are not shown.

    >>> left_out(["run 11", "run 12"])
    'Not shown: run 11, run 12.'
    """
    if not names:
        return ""
    more = len(names) - N_COLOURS
    more_names = f" and {more} more" if more > 0 else ""
    return f"Not shown: {', '.join(names[:N_COLOURS])}{more_names}."


def series_colour(place: int) -> str:
    """Return the colour of the model or recording at an index."""
    return f"series-{place % N_COLOURS + 1}"
