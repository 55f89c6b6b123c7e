"""Figures of models: ranking, weights, inverse, residuals, reviews."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.equations import channel_symbols
from mckibben.channels import channel_symbol
from mckibben.errors import ModelError
from mckibben.recording import REFERENCE
from mckibben.report.drawing import (
    N_COLOURS,
    POINTS,
    TIME,
    Curve,
    Drawing,
    Label,
    Panel,
    Style,
    axis_label,
    channel_label,
    over_time,
    series_colour,
    time_label,
)

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.control import Tracked
    from mckibben.diagnosis.check import OutputCheck, Pattern
    from mckibben.diagnosis.review import Followed
    from mckibben.studying.inverting import InverseCheck

OFF_THE_CHART = 3.0
"""Cross-validated errors beyond so many times the largest test error would squeeze all others."""

BRANCHES = (("rising", "series-1"), ("falling", "series-2"))


def leaderboard(board: Leaderboard) -> Drawing:
    """Draw the errors of all fitted models, with the interval of the test error.

    Raises
    ------
    ModelError
        If none worked.
    """
    ranked = [row for row in board.rows if row.train is not None and row.test is not None]
    if not ranked:
        raise ModelError(
            "no model could be fitted, so there is no ranking", remedy="read the reasons"
        )
    rank = np.arange(len(ranked), dtype=float)
    tested = np.array([row.test.rmse for row in ranked if row.test is not None])
    fitted = np.array([row.train.rmse for row in ranked if row.train is not None])
    criteria = [row.validation_rmse for row in ranked]
    ends = np.array([row.rmse_interval or (np.nan, np.nan) for row in ranked], dtype=float)
    ends = np.where(np.isfinite(ends), ends, tested[:, np.newaxis])
    curves = [Curve(fitted, rank, "fit", "measured", "ticks")]
    is_off = np.zeros(len(ranked), dtype=bool)
    if any(value is not None for value in criteria):
        validated = np.array([np.nan if value is None else value for value in criteria])
        is_off = validated > OFF_THE_CHART * tested.max()
        validated[is_off] = np.nan
        curves.append(Curve(validated, rank, "cross-validation", "series-2", "rings"))
    interval = (ends[:, 0], ends[:, 1])
    curves.append(Curve(tested, rank, "test, 95 % interval", "series-1", "dots", None, interval))
    label = axis_label("RMSE", board.unit)
    names = tuple(row.model for row in ranked)
    undrawn = [name for name, out in zip(names, is_off, strict=True) if out]
    note = f"Cross-validation far to the right, not drawn: {', '.join(undrawn)}." if undrawn else ""
    return Drawing((Panel(label, "", tuple(curves), categories=names),), note=note)


Course = tuple[Array, str, str, Style]
"""What is drawn over time: values, name, colour and style."""


def _courses(time: Array, points: int, *courses: Course) -> tuple[Curve, ...]:
    return tuple(
        Curve(*over_time(time, y, points), name, colour, style)
        for y, name, colour, style in courses
    )


def tracking(loops: Mapping[str, Tracked], output: str, points: int = POINTS) -> Drawing:
    """Draw the desired motion of one output, and the motion with every controller."""
    first = next(iter(loops.values())).recording
    courses: list[Course] = [
        (run.recording[output], name, series_colour(place), "line")
        for place, (name, run) in enumerate([*loops.items()][:N_COLOURS])
    ]
    reference: Course = (first[REFERENCE + output], "reference", "measured", "broad")
    curves = _courses(first.time, points, reference, *courses)
    return Drawing((Panel(time_label(first), channel_label(first, output), curves),))


def inverse_check(check: InverseCheck) -> Drawing:
    """Draw reference and output, their difference, and the input computed by the inverse."""
    output_channel, input_channel = check.inverse.inputs[0], check.inverse.outputs[0]
    reference, output = check.reference[:, 0], check.output[:, 0]
    symbols = channel_symbols(check.inverse)
    labels = [
        Label(channel.name, channel.unit, symbols.get(channel.name, ""))
        for channel in (output_channel, input_channel)
    ]
    rows: list[tuple[Label, list[Course]]] = [
        (
            labels[0],
            [
                (reference, "reference", "measured", "broad"),
                (output, "model behind its inverse", "series-1", "line"),
            ],
        ),
        (Label("error", output_channel.unit), [(output - reference, "", "series-6", "fine")]),
        (labels[1], [(check.pressure[:, 0], "", "input", "line")]),
    ]
    x, least = TIME if check.timed else Label("sample"), 1e-6 * float(np.ptp(reference))
    panels = [
        Panel(x, label, _courses(check.time, POINTS, *input_channel), least=least)
        for label, input_channel in rows
    ]
    return Drawing(tuple(panels), stacked=True)


def autocorrelation(check: OutputCheck) -> Drawing:
    """Draw the residual's autocorrelation, and the band of white noise."""
    whiteness = check.whiteness
    lags = np.array(whiteness.lags, dtype=float)
    band = np.array(whiteness.band)
    curves = (
        Curve(lags, band, "99 % of white noise", "input", "fine"),
        Curve(lags, -band, "", "input", "fine"),
        Curve(lags, np.array(whiteness.autocorrelation), "", "series-1", "stems"),
    )
    return Drawing((Panel("lag [samples]", "autocorrelation", curves, zero=True),), abreast=1)


def pattern(check: OutputCheck, against: Pattern) -> Drawing:
    """Draw the residual's means over a variable, with their 95 % intervals."""
    groups = BRANCHES if against.against == "branch" else (("", "series-1"),)
    curves: list[Curve] = []
    for label, colour in groups:
        bins = [bin_ for bin_ in against.bins if bin_.label == label]
        x = np.array([(bin_.low + bin_.high) / 2 for bin_ in bins])
        ends = np.array([bin_.interval for bin_ in bins]).reshape(-1, 2)
        curves += [Curve(x, end, "", colour, "fine") for end in ends.T]
        curves.append(Curve(x, np.array([bin_.mean for bin_ in bins]), label, colour, "beads"))
    what = "modelled " if against.against == "output" else ""
    symbol = channel_symbol(against.channel)
    x_label = Label(f"{what}{against.channel}", against.unit, symbol)
    y_label = axis_label("residual", check.unit)
    return Drawing((Panel(x_label, y_label, tuple(curves), zero=True, least=1e-6 * check.span),))


def parts(followed: Followed, points: int = POINTS) -> Drawing:
    """Draw reference and measured motion, and below the error with its parts."""
    above: list[Course] = [
        (followed.reference, "reference", "measured", "broad"),
        (followed.measured, "recorded", "series-1", "line"),
    ]
    below: list[Course] = [
        (followed.measured - followed.reference, "error", "measured", "broad"),
        *(
            (y, kind, series_colour(k), "line")
            for k, (kind, y) in enumerate(followed.parts.items())
        ),
    ]
    labels = (
        Label(followed.output, followed.unit, channel_symbol(followed.output)),
        Label("error", followed.unit),
    )
    panels = [
        Panel(TIME, label, _courses(followed.time, points, *courses), zero=zero)
        for label, courses, zero in zip(labels, (above, below), (False, True), strict=True)
    ]
    return Drawing(tuple(panels), stacked=True)
