"""What a model is, on a page: equations, parameters and how sure they are, answers to sines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from mckibben.numerals import number
from mckibben.report import interactive
from mckibben.report.builder import Equations, Figure, Item, Table, Text
from mckibben.report.drawing import Curve, Drawing, Panel, axis_label

if TYPE_CHECKING:
    from mckibben.blocks.fields import Channel
    from mckibben.diagnosis.description import ModelDescription
    from mckibben.diagnosis.responses import FrequencyResponse

UNFOLDED = 30
"""Parameters that are shown without being asked for."""


def model_items(found: ModelDescription) -> list[Item]:
    """Return the parts of a page that describe a model."""
    rows = [
        [
            one.name,
            {"latex": one.symbol},
            one.value,
            one.status if one.standard_error is None else f"± {number(one.standard_error, 2)}",
            one.unit or "–",
        ]
        for one in found.parameters
    ]
    items: list[Item] = [
        Text([found.written.title], "muted"),
        Equations(found.written),
        Table(
            ["Parameter", "Symbol", "Value", "Standard error", "Unit"],
            rows,
            titles=[one.meaning for one in found.parameters],
            summary=f"{len(rows)} parameters" if len(rows) > UNFOLDED else "",
        ),
    ]
    for one in found.frequency_responses:
        name = one.output.name
        label = f"Gain and angle of {name} over the frequency of {one.input.name}"
        plots = [interactive.plots(frequency_response(one))]
        items.append(Figure(f"response {name}", plots, label, f"{label}; dots: measured.", "tall"))
    return items


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
