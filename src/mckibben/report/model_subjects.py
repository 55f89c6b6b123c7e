"""Figures of models themselves: ranking, weights, inverse, residuals over what they follow, reviews."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.equations import channel_units, unit_of
from mckibben.blocks.hysteresis.eupi import EUPI
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI, RateDependentPI
from mckibben.errors import ModelError
from mckibben.report.drawing import (
    N_COLOURS,
    POINTS,
    Curve,
    Drawing,
    Panel,
    axis_label,
    over_time,
    series_colour,
    time_label,
)

if TYPE_CHECKING:
    from mckibben.blocks.fields import Channel
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.control import Tracked
    from mckibben.diagnosis.check import OutputCheck
    from mckibben.diagnosis.patterns import Bin, Pattern
    from mckibben.diagnosis.responses import FrequencyResponse
    from mckibben.diagnosis.review import Followed
    from mckibben.studying.inverting import InverseCheck

OFF_THE_CHART = 3.0
"""Cross-validated errors beyond so many times the largest test error would squeeze all others."""

BRANCHES = (("rising", "series-1"), ("falling", "series-6"))

OperatorSum = PI | GPI | EUPI | RateDependentPI


def leaderboard(board: Leaderboard) -> Drawing:
    """Draw the errors of all models that worked, with the interval of the test error.

    Raises
    ------
    ModelError
        If none worked.
    """
    ranked = [row for row in board.rows if row.train is not None and row.test is not None]
    if not ranked:
        raise ModelError("no model worked, so there is nothing to rank", remedy="read the reasons")
    place = np.arange(len(ranked), dtype=float)
    tested = np.array([row.test.rmse for row in ranked if row.test is not None])
    fitted = np.array([row.train.rmse for row in ranked if row.train is not None])
    chosen = [row.validation_rmse for row in ranked]
    ends = np.array([row.rmse_interval or (np.nan, np.nan) for row in ranked], dtype=float)
    ends = np.where(np.isfinite(ends), ends, tested[:, np.newaxis])
    curves = [Curve(fitted, place, "fit", "input", "ticks")]
    far = np.zeros(len(ranked), dtype=bool)
    if any(value is not None for value in chosen):
        validated = np.array([np.nan if value is None else value for value in chosen])
        far = validated > OFF_THE_CHART * tested.max()
        validated[far] = np.nan
        curves.append(Curve(validated, place, "cross-validation", "input", "rings"))
    interval = (ends[:, 0], ends[:, 1])
    curves.append(Curve(tested, place, "test, 95 % interval", "series-1", "dots", None, interval))
    label = axis_label("RMSE", board.unit)
    names = tuple(row.model for row in ranked)
    off = [name for name, out in zip(names, far, strict=True) if out]
    note = f"Cross-validation far to the right, not drawn: {', '.join(off)}." if off else ""
    return Drawing((Panel(label, "", tuple(curves), categories=names),), note=note)


def weights(blocks: Mapping[str, Block]) -> Drawing:
    """Draw the weights over the thresholds of every sum of play operators in the models.

    Raises
    ------
    ModelError
        If no model has any.
    """
    panels = []
    for place, (model, block) in enumerate(blocks.items()):
        for part in operator_sums(block):
            unit = unit_of(part, "thresholds", (0,), channel_units(part)) or ""
            x_label = axis_label("threshold", unit)
            r = np.array(part.thresholds)
            w = np.array(part.weights)
            title = model if part is block else f"{model}: {part.kind}"
            drawn = {title: w}
            if isinstance(part, RateDependentPI):
                drawn[f"{title}, per rate"] = np.array(part.rate_weights)
            for heading, values in drawn.items():
                stems = Curve(r, values, colour=series_colour(place), style="stems")
                panels.append(Panel(x_label, "weight", (stems,), heading, zero=True))
    if not panels:
        raise ModelError(
            "no model here is a weighted sum of play operators, so it has no weights to draw",
            remedy="draw the fit or the loops",
        )
    note = "" if len(panels) <= N_COLOURS else f"{len(panels) - N_COLOURS} more are not shown."
    return Drawing(tuple(panels[:N_COLOURS]), note=note)


def operator_sums(block: Block) -> Iterator[OperatorSum]:
    """Yield the parts of a model, however nested, that are weighted sums of play operators."""
    if isinstance(block, OperatorSum):
        yield block
    elif hasattr(block, "forward"):
        yield from operator_sums(block.forward)
    else:
        for part in getattr(block, "parts", ()):
            yield from operator_sums(part)


def tracking(loops: Mapping[str, Tracked], output: str, points: int = POINTS) -> Drawing:
    """Draw a desired motion of one output, and what every controller made of it."""
    first = next(iter(loops.values())).recording
    wanted = over_time(first.time, first[f"reference_{output}"], points)
    curves = [Curve(*wanted, "reference", style="broad")]
    for place, (name, found) in enumerate(loops.items()):
        if place < N_COLOURS:
            followed = over_time(found.recording.time, found.recording[output], points)
            curves.append(Curve(*followed, name, series_colour(place)))
    label = axis_label(output, first.units[output])
    return Drawing((Panel(time_label(first), label, tuple(curves)),))


def inverse_check(check: InverseCheck, timed: bool = True) -> Drawing:
    """Draw reference and output, their difference, and the input that the inverse gives.

    Parameters
    ----------
    timed : bool
        Whether ``check.time`` is in seconds, and not in samples.
    """
    (wanted,), (given,) = check.inverse.inputs[:1], check.inverse.outputs[:1]
    label = "time [s]" if timed else "sample"
    t = check.time
    reference, output = check.reference[:, 0], check.output[:, 0]
    error = over_time(t, output - reference)
    plain = check.uncompensated
    without = [] if plain is None else [over_time(t, plain[:, 0])]
    return Drawing(
        (
            Panel(
                label,
                axis_label(wanted.name, wanted.unit),
                (
                    Curve(*over_time(t, reference), "reference", style="broad"),
                    *(Curve(*each, "no compensation", "series-2") for each in without),
                    Curve(*over_time(t, output), "model behind its inverse", "series-1"),
                ),
            ),
            Panel(
                label,
                axis_label("error", wanted.unit),
                (Curve(*error, "", "series-6", "fine"),),
                least=1e-6 * float(np.ptp(reference)),
            ),
            Panel(
                label,
                axis_label(given.name, given.unit),
                (Curve(*over_time(t, check.pressure[:, 0]), "", "input"),),
            ),
        ),
        stacked=True,
    )


def autocorrelation(one: OutputCheck) -> Drawing:
    """Draw the residual's autocorrelation, and the band of white noise."""
    found = one.whiteness
    lags = np.array(found.lags, dtype=float)
    band = np.array(found.band)
    curves = (
        Curve(lags, band, "99 % of white noise", "input", "fine"),
        Curve(lags, -band, "", "input", "fine"),
        Curve(lags, np.array(found.autocorrelation), "", "series-1", "stems"),
    )
    return Drawing((Panel("lag [samples]", "autocorrelation", curves, zero=True),), columns=1)


def pattern(one: OutputCheck, against: Pattern) -> Drawing:
    """Draw the residual's means over something, with their 95 % intervals."""
    groups = BRANCHES if against.against == "branch" else (("", "series-1"),)
    curves: list[Curve] = []
    for label, colour in groups:
        bins = [each for each in against.bins if each.label == label]
        curves += _means(bins, label, colour)
    what = "modelled " if against.against == "output" else ""
    x_label = axis_label(f"{what}{against.channel}", against.unit)
    y_label = axis_label("measured − model", one.unit)
    return Drawing((Panel(x_label, y_label, tuple(curves), zero=True),))


def _means(bins: list[Bin], label: str, colour: str) -> list[Curve]:
    x = np.array([(each.low + each.high) / 2 for each in bins])
    ends = np.array([each.interval for each in bins]).reshape(-1, 2)
    return [
        Curve(x, ends[:, 0], "", colour, "fine"),
        Curve(x, ends[:, 1], "", colour, "fine"),
        Curve(x, np.array([each.mean for each in bins]), label, colour, "beads"),
    ]


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


def frequency_response(found: FrequencyResponse) -> Drawing:
    """Draw gain and angle over frequency, with bounds, beside what was measured."""
    f = found.frequency
    panels: list[Panel] = []
    gain, angle = _gain_label(found.input, found.output), "angle [deg]"
    rows = (
        (gain, found.gain, found.gain_interval, found.measured_gain),
        (angle, found.angle, found.angle_interval, found.measured_angle),
    )
    for label, values, interval, measured in rows:
        first = not panels
        curves = [
            Curve(found.measured_frequency, measured, "recorded" * first, "measured", "specks"),
            Curve(f, values, "model" * first, "series-1"),
        ]
        if interval is not None:
            low, high = interval
            curves.append(Curve(f, low, "95 %" * first, "series-1", "fine"))
            curves.append(Curve(f, high, "", "series-1", "fine"))
        axes: Literal["xy", "x"] = "xy" if first else "x"
        panels.append(Panel("frequency [Hz]", label, tuple(curves), logarithmic=axes))
    note = "" if found.measured_frequency.size else "No frequency was recorded with high coherence."
    return Drawing(tuple(panels), stacked=True, note=note)


def _gain_label(given: Channel, wanted: Channel) -> str:
    """Return what a gain is of, and its unit."""
    unit = "" if given.unit == wanted.unit else f"{wanted.unit or '1'}/{given.unit or '1'}"
    return axis_label(f"gain to {wanted.name}", unit)
