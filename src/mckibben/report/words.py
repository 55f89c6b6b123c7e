"""Every sentence about results: each is made from the numbers of a result, which stand beside it.

Library functions return numbers. Whatever says something about them to a person is here, in one section
a room, so that all of it can be read, counted and tested on plants where it is false.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

from mckibben.numerals import numeral
from mckibben.report.wording import percent

if TYPE_CHECKING:
    from mckibben.arrays import Array
    from mckibben.blocks.fields import Channel
    from mckibben.diagnosis.bands import Calibration
    from mckibben.diagnosis.review import Review


# --- Comparison -------------------------------------------------------------------------------------

# --- What the muscle does ---------------------------------------------------------------------------

# --- Residual check ---------------------------------------------------------------------------------

# --- Data gaps and plans ----------------------------------------------------------------------------

# --- Bands and log reviews --------------------------------------------------------------------------


def band_on_test(
    level: float, coverage: Mapping[str, float], width: Mapping[str, float], unit: str
) -> list[str]:
    """Return, an output a sentence, the share of the test's samples inside of a band, and its width."""
    return [
        f"The band for {percent(level, 3)} holds {percent(coverage[name], 3)} of the test's samples of "
        f"{name}; its half width is {numeral(wide / 2, 2)} {unit} on average."
        for name, wide in width.items()
    ]


def calibrated(found: Calibration) -> list[str]:
    """Return what a band rests on, and how wide it is."""
    band, n = found.band, found.band.units
    said = [f"Calibrated on {n} {band.unit}s, which allow levels up to {percent(n / (n + 1), 3)}."]
    for channel, width, ratio in zip(band.given, found.widths, found.over_constant, strict=True):
        said.append(
            f"{channel.name}: the band for {percent(band.level, 3)} is {numeral(width, 3)} "
            f"{channel.unit} wide on average in cross-validation, {numeral(ratio, 2)} of a band of "
            "constant width."
        )
    return said


def calibrated_on_blocks(found: Calibration) -> str:
    """Return what a band does not include whose units are blocks of runs."""
    return (
        f"{found.band.units} blocks of {found.runs} run(s) count as exchangeable, so differences "
        "between runs are not in the band. Remedy: calibrate on 9 runs or more."
    )


def outside_calibration(
    run: str, channel: Channel, share: float, values: Array, ends: tuple[float, float]
) -> str:
    """Return how much of a run is beyond the range of a calibration."""
    least, most = numeral(float(values.min()), 3), numeral(float(values.max()), 3)
    low, high = (numeral(end, 3) for end in ends)
    return (
        f"In {run}, {channel.name} goes from {least} to {most} {channel.unit}, the calibration from "
        f"{low} to {high}: beyond it, in {percent(share, 3)} of the samples, the level of the band is "
        "not guaranteed."
    )


def reviewed(found: Review) -> list[str]:
    """Return what a log's review found: every output, then delays, limits and the refit."""
    given = " of the compensator" if found.judged_by == "compensator" else ""
    said = []
    for one in found.outputs:
        size = partial(_size, one.unit)
        said.append(
            f"{one.output}: achieved error {size(one.achieved)} RMS; the model misses "
            f"{size(one.residual)} of the measured motion."
        )
        if one.predicted is not None and one.pressure is not None:
            said.append(
                f"{one.output}: the model predicts an error of {size(one.predicted)} for the "
                f"commands{given}, and {size(one.pressure)} for pressures that differ from them."
            )
        low, high = (numeral(60 * end, 2) for end in one.drift_interval)
        said.append(
            f"{one.output}: the residual drifts by {size(60 * one.drift)} per minute (95 %: {low} to "
            f"{high})."
        )
    for delay in found.delays:
        late, low, high = (numeral(1000 * x, 2) for x in (delay.seconds, *delay.interval))
        said.append(f"Delay and lag of {delay.where}: {late} ms (95 %: {low} to {high}).")
    if found.clipped:
        said.append(f"{found.clipped} of {found.n_samples} samples are at a limit of the command.")
    if isinstance(found.refit, str):
        said.append(found.refit)
    elif found.refit is not None:
        low, high = (percent(end, 2) for end in found.refit.ratio)
        said.append(
            f"The model fitted again to the log has {percent(found.refit.new / found.refit.old, 2)} of "
            f"the old one's error on {found.refit.n_folds} parts held out (95 %: {low} to {high})."
        )
    return said


def _size(unit: str, value: float) -> str:
    return f"{numeral(value, 2)} {unit}".rstrip()


# --- The three answers ------------------------------------------------------------------------------
