"""Axes to draw a reference on, as SVG: seconds and units, a grid, and what can be reached."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from mckibben.app.motions import Points, grid_of

WIDTH, HEIGHT = 480, 270
"""Of the picture [px of its own]."""

LEFT, RIGHT, TOP, BOTTOM = 56, 12, 12, 40
"""Room beside the axes."""

MARGIN = 0.1
"""Share of what can be reached that is shown beyond it."""


FEW = 30
"""Points that are drawn large."""


@dataclass(frozen=True)
class Axes:
    """Where times and values lie in the picture.

    Parameters
    ----------
    seconds : float
        Time at the right end [s].
    low, high : float
        What can be reached.
    unit, name : str
        Of what is drawn.
    """

    seconds: float
    low: float
    high: float
    unit: str
    name: str

    @property
    def ends(self) -> tuple[float, float]:
        """Values at the lower and upper end."""
        more = MARGIN * (self.high - self.low)
        return self.low - more, self.high + more

    def place(self, time: float, value: float) -> tuple[float, float]:
        """Return where a time and a value lie."""
        bottom, top = self.ends
        x = LEFT + (WIDTH - LEFT - RIGHT) * time / self.seconds
        y = TOP + (HEIGHT - TOP - BOTTOM) * (top - value) / (top - bottom)
        return x, y

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the time and the value of a place, within the axes."""
        bottom, top = self.ends
        share = min(max((x - LEFT) / (WIDTH - LEFT - RIGHT), 0.0), 1.0)
        up = min(max((y - TOP) / (HEIGHT - TOP - BOTTOM), 0.0), 1.0)
        return self.seconds * share, top - (top - bottom) * up

    def drawn(
        self,
        points: Points,
        others: Sequence[Points],
        palette: Mapping[str, str],
        *,
        dots: bool = True,
    ) -> str:
        """Return axes, what can be reached, other coordinates faintly, and points, as SVG."""
        ink, ruled, series = palette["ink"], palette["grid"], palette["series-1"]
        right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
        _, upper = self.place(0.0, self.high)
        _, lower = self.place(0.0, self.low)
        parts = [
            f'<rect x="{LEFT}" y="{upper:.1f}" width="{right - LEFT}" height="{lower - upper:.1f}" '
            f'fill="{palette["accent"]}" opacity="0.18" />',
            _line(LEFT, upper, right, upper, palette["accent"]),
            _line(LEFT, lower, right, lower, palette["accent"]),
        ]
        style = f'fill="{ink}" font-size="12" font-family="system-ui, sans-serif"'
        for time in _ticks(0.0, self.seconds):
            x, _ = self.place(time, self.low)
            parts.append(_line(x, TOP, x, bottom, ruled))
            parts.append(
                f'<text x="{x:.1f}" y="{bottom + 15}" text-anchor="middle" {style}>{time:g}</text>'
            )
        for value in _ticks(*self.ends):
            _, y = self.place(0.0, value)
            parts.append(_line(LEFT, y, right, y, ruled))
            parts.append(
                f'<text x="{LEFT - 5}" y="{y + 4:.1f}" text-anchor="end" {style}>{value:g}</text>'
            )
        parts.append(
            f'<text x="{(LEFT + right) / 2}" y="{HEIGHT - 7}" text-anchor="middle" {style}>'
            "time [s]</text>"
        )
        middle = (TOP + bottom) / 2
        parts.append(
            f'<text x="12" y="{middle}" text-anchor="middle" transform="rotate(-90 12 {middle})" '
            f"{style}>{escape(f'{self.name} [{self.unit}]')}</text>"
        )
        parts.append(
            f'<text x="{right - 4}" y="{upper + 14:.1f}" text-anchor="end" opacity="0.75" {style}>'
            "reachable</text>"
        )
        for other in others:
            parts.append(self._curve(other, ruled, 1.5))
        parts.append(self._curve(points, series, 2.0))
        size = 4.0 if len(points) <= FEW else 2.0
        for point in points[:200] if dots else ():
            x, y = self.place(*point)
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{size}" fill="{series}" />')
        return "".join(parts)

    def _curve(self, points: Points, colour: str, width: float) -> str:
        places = " ".join(f"{x:.1f},{y:.1f}" for x, y in (self.place(*point) for point in points))
        return (
            f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="{width}" />'
        )


def _ticks(low: float, high: float) -> list[float]:
    every = grid_of(low, high)
    first, last = int(np.ceil(low / every - 1e-9)), int(np.floor(high / every + 1e-9))
    return [float(f"{number * every:.9g}") for number in range(first, last + 1)]


def _line(x0: float, y0: float, x1: float, y1: float, colour: str) -> str:
    return (
        f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" stroke="{colour}" '
        'stroke-width="1" />'
    )
