"""Figures of what a model answers to sines: frequency responses and describing functions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from mckibben.numerals import numeral
from mckibben.report import interactive
from mckibben.report.drawing import N_AGES, Curve, Drawing, Panel, axis_label

if TYPE_CHECKING:
    from mckibben.blocks.fields import Channel
    from mckibben.diagnosis.description import ModelDescription
    from mckibben.diagnosis.responses import DescribingFunction, FrequencyResponse


def figures(description: ModelDescription) -> dict[str, list[list[interactive.Json]]]:
    """Return the figures of a description as pages hold them, by name."""
    drawn = {one.output.name: frequency_response(one) for one in description.frequency_responses}
    drawn |= {one.output.name: describing_function(one) for one in description.describing_functions}
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


def describing_function(found: DescribingFunction) -> Drawing:
    """Draw gain and angle of the first harmonic over amplitude, for some rates, and of every cycle."""
    panels: list[Panel] = []
    shades = np.linspace(1, N_AGES, found.rate.size).round().astype(int).tolist()
    for label, values, measured, modelled in (
        (
            _gain_label(found.input, found.output),
            *(found.gain, found.measured_gain, found.modelled_gain),
        ),
        ("angle [deg]", found.angle, found.measured_angle, found.modelled_angle),
    ):
        first = not panels
        curves = []
        for rate, row, shade in zip(found.rate, values, shades, strict=True):
            unit = f"{found.input.unit}/s".removeprefix("/")
            name = "model" if np.isnan(rate) else f"model, {numeral(float(rate))} {unit}"
            colour = "series-1" if len(shades) == 1 else f"age-{shade}"
            curves.append(Curve(found.amplitude, row, name * first, colour))
        if measured.size:
            x = found.measured_amplitude
            curves.append(Curve(x, measured, "recorded cycles" * first, "measured", "specks"))
            curves.append(Curve(x, modelled, "model, same cycles" * first, "series-2", "rings"))
        x_label = axis_label(f"amplitude of {found.input.name}", found.input.unit)
        panels.append(Panel(x_label, label, tuple(curves)))
    return Drawing(tuple(panels), stacked=True)


def _gain_label(given: Channel, wanted: Channel) -> str:
    """Return what a gain is of, and its unit."""
    unit = "" if given.unit == wanted.unit else f"{wanted.unit or '1'}/{given.unit or '1'}"
    return axis_label(f"gain to {wanted.name}", unit)
