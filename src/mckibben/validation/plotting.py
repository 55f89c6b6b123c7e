"""A check drawn into matplotlib's axes: autocorrelation, cross-correlation, branches, errors ahead."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mckibben.errors import DataError
from mckibben.system.extras import demand

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mckibben.validation.results import OutputCheck, Validation

N_AXES = 4


def plot(found: Validation, axes: Sequence[Axes] | None, output: str | None) -> Sequence[Axes]:
    """Draw an output's check into four axes; see `Validation.plot`."""
    names = [one.output for one in found.outputs]
    if output is not None and output not in names:
        raise DataError(
            f"the model has no such output, but {', '.join(names)}",
            channel=output,
            remedy="name one of them",
        )
    one = found.outputs[0 if output is None else names.index(output)]
    if axes is None:
        demand("matplotlib", "figures", "figures for print")
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        axes = list(figure.subplots(2, 2).ravel())
    axes = list(np.ravel(np.asarray(axes, dtype=object)))
    if len(axes) != N_AXES:
        raise DataError(f"a check is drawn into four axes, not {len(axes)}", remedy="give four")
    _autocorrelation(axes[0], one)
    _crossing(axes[1], one)
    _branches(axes[2], one)
    _ahead(axes[3], one)
    return axes


def _autocorrelation(axis: Axes, one: OutputCheck) -> None:
    found = one.whiteness
    band = np.array(found.band)
    axis.fill_between(found.lags, -band, band, color="#cccccc", label="99 % of white noise")
    axis.vlines(found.lags, 0, found.autocorrelation, color="#0072B2")
    axis.set(xlabel="lag [samples]", ylabel="autocorrelation")


def _crossing(axis: Axes, one: OutputCheck) -> None:
    for found in one.crossings:
        (line,) = axis.plot(found.lags, found.with_input, label=found.channel)
        if found.band < 1:
            axis.axhspan(-found.band, found.band, color=line.get_color(), alpha=0.15)
        else:
            line.set_label(f"{found.channel} (99 % band beyond ±1)")
    axis.set(xlabel="residual later by [samples]", ylabel="correlation with inputs")
    if one.crossings:
        axis.legend(frameon=False)


def _branches(axis: Axes, one: OutputCheck) -> None:
    found = next((each for each in one.patterns if each.against == "branch"), None)
    for label, colour in (("rising", "#0072B2"), ("falling", "#D55E00")):
        bins = [each for each in found.bins if each.label == label] if found else []
        if not bins:
            continue
        x = [(each.low + each.high) / 2 for each in bins]
        low, high = np.array([each.interval for each in bins]).T
        axis.plot(x, [each.mean for each in bins], "o-", color=colour, label=label)
        axis.fill_between(x, low, high, color=colour, alpha=0.2)
    axis.axhline(0, color="#aaaaaa", linewidth=0.6)
    x_label = "" if found is None else f"{found.channel} [{found.unit}]"
    axis.set(xlabel=x_label, ylabel=f"measured − model [{one.unit}]")
    if axis.has_data() and found is not None and found.bins:
        axis.legend(frameon=False)


def _ahead(axis: Axes, one: OutputCheck) -> None:
    names = ["free" if each.samples is None else str(each.samples) for each in one.ahead]
    axis.bar(names, [each.rmse for each in one.ahead], color="#0072B2")
    axis.set(xlabel="samples ahead", ylabel=f"RMSE [{one.unit}]")
