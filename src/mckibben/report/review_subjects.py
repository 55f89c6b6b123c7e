"""Figures of a log looked back on: what was wished for, what came, and what the error is made of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben.report.drawing import (
    POINTS,
    Curve,
    Drawing,
    Panel,
    axis_label,
    over_time,
    series_colour,
)

if TYPE_CHECKING:
    from mckibben.diagnosis.review import Followed


def parts(one: Followed, points: int = POINTS) -> Drawing:
    """Draw reference and measured motion, and below the error with its parts."""
    wanted = over_time(one.time, one.reference, points)
    got = over_time(one.time, one.measured, points)
    error = over_time(one.time, one.measured - one.reference, points)
    curves = [
        Curve(*over_time(one.time, part, points), kind, series_colour(place))
        for place, (kind, part) in enumerate(one.parts.items())
    ]
    above = (Curve(*wanted, "reference", style="broad"), Curve(*got, "recorded", "series-1"))
    below = (Curve(*error, "error", style="broad"), *curves)
    return Drawing(
        (
            Panel("time [s]", axis_label(one.output, one.unit), above),
            Panel("time [s]", axis_label("error", one.unit), below, zero=True),
        ),
        stacked=True,
    )
