"""Figures of frequency responses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from mckibben.report import interactive
from mckibben.report.drawing import Curve, Drawing, Panel, axis_label

if TYPE_CHECKING:
    from mckibben.blocks.fields import Channel
    from mckibben.diagnosis.description import ModelDescription
    from mckibben.diagnosis.responses import FrequencyResponse


def figures(description: ModelDescription) -> dict[str, list[list[interactive.Json]]]:
    """Return the figures of a description as pages hold them, by name."""
    drawn = {one.output.name: frequency_response(one) for one in description.frequency_responses}
    return {f"response {name}": [interactive.plots(drawing)] for name, drawing in drawn.items()}


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
