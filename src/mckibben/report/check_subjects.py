"""Figures of a check: a residual over lags, inputs and branches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mckibben.report.drawing import Curve, Drawing, Panel, axis_label

if TYPE_CHECKING:
    from mckibben.diagnosis.check import OutputCheck
    from mckibben.diagnosis.patterns import Bin, Pattern

BRANCHES = (("rising", "series-1"), ("falling", "series-6"))


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
