"""Figures of a check: what a model leaves, by lag, by input and branch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mckibben.report.drawing import Curve, Drawing, Panel, axis_label

if TYPE_CHECKING:
    from mckibben.validation.patterns import Bin, Pattern
    from mckibben.validation.results import OutputCheck

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


def crossings(one: OutputCheck) -> Drawing:
    """Draw the residual's correlation with every input and its changes, and their bands."""
    panels = []
    for each in one.crossings:
        lags = np.array(each.lags, dtype=float)
        for what, values, band in (
            (each.channel, each.with_input, each.band),
            (f"changes of {each.channel}", each.with_changes, each.band_of_changes),
        ):
            edge = np.full(2, band)
            ends = lags[[0, -1]]
            curves = [Curve(lags, np.array(values), f"with {what}", "series-1")]
            # no correlation is beyond 1, so such a band would only squeeze the figure
            if band < 1:
                curves += [
                    Curve(ends, edge, "99 % of noise", "input", "fine"),
                    Curve(ends, -edge, "", "input", "fine"),
                ]
            label = "residual later by [samples]"
            panels.append(Panel(label, "cross-correlation", tuple(curves), zero=True))
    return Drawing(tuple(panels), columns=2)


def pattern(one: OutputCheck, against: Pattern) -> Drawing:
    """Draw the residual's means over something, with their 95 % intervals."""
    groups = BRANCHES if against.against == "branch" else (("", "series-1"),)
    curves: list[Curve] = []
    for label, colour in groups:
        bins = [each for each in against.bins if each.label == label]
        curves += _means(bins, label, colour)
    what = "rate of " if against.against == "rate" else ""
    what = "modelled " if against.against == "output" else what
    x_label = axis_label(f"{what}{against.channel}", against.unit)
    y_label = axis_label("recorded − model", one.unit)
    return Drawing((Panel(x_label, y_label, tuple(curves), zero=True),))


def _means(bins: list[Bin], label: str, colour: str) -> list[Curve]:
    x = np.array([(each.low + each.high) / 2 for each in bins])
    ends = np.array([each.interval for each in bins]).reshape(-1, 2)
    return [
        Curve(x, ends[:, 0], "", colour, "fine"),
        Curve(x, ends[:, 1], "", colour, "fine"),
        Curve(x, np.array([each.mean for each in bins]), label, colour, "beads"),
    ]
