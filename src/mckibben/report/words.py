"""Every sentence about results: each is made from the numbers of a result, which stand beside it.

Library functions return numbers. Whatever says something about them to a person is here, in one section
a room, so that all of it can be read, counted and tested on plants where it is false.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mckibben.numerals import numeral
from mckibben.recording import standard_unit

if TYPE_CHECKING:
    from mckibben.diagnosis.data_gaps import Gap
    from mckibben.planning.planner import Plan

# --- Comparison -------------------------------------------------------------------------------------

# --- What the muscle does ---------------------------------------------------------------------------

# --- Residual check ---------------------------------------------------------------------------------

# --- Data gaps and plans ----------------------------------------------------------------------------

GAPS = {
    "still": "Nothing can be identified: {channels} moves by no more than its noise.",
    "hysteresis": "Hysteresis cannot be identified: {channels} has {value} turning points.",
    "minor loops": "Minor loops cannot be identified: {value} turning points of {channels} lie "
    "inside its range on one side, where {needed} are needed.",
    "coupling": "Effects of {channels} cannot be separated: one follows from the others (R² = {value}).",
    "spring load": "Load and stiffness cannot be separated: {channels} are proportional (R² = {value}).",
    "resting": "The effect of {channels} cannot be identified: constant at {levels}.",
    "together": "Joint effects cannot be identified: {channels} are off their rest together in "
    "{percent} of the samples.",
    "range": "Behaviour beyond the recorded range of {channels} cannot be identified: tests go further "
    "by {percent} of it.",
    "rate": "Rate dependence cannot be identified: similar branches of {channels} differ in speed by a "
    "factor of {value}, where {needed} is needed.",
    "creep": "Creep cannot be identified: the longest hold lasts {value} s, where {needed} s "
    "are needed.",
    "time": "Rate dependence and creep cannot be identified: {percent} of the recordings have time.",
    "sampling": "Shapes of branches cannot be identified: {channels} has {value} samples a "
    "branch, where {needed} are needed.",
    "resolution": "Loops below {percent} of the range of {channels} cannot be identified: noise or the "
    "steps of the sensor are that large.",
    "clipped": "Behaviour beyond {levels} cannot be identified: {channels} stays at a limit for {value} "
    "samples.",
    "repeats": "Repeatability cannot be identified: {value} cycles of {channels} are recorded twice.",
}
GAPS["load"] = GAPS["resting"]
PLAN = "{seconds} s: {parts}."
LEFT_OPEN = "Not closed by this plan: {gap} {run}"
EXTRAPOLATED = "{channel} goes beyond the recordings: errors there are extrapolated."
RUN = "Record {what}."
RUNS = {
    "random": "all inputs and loads moving at random over {levels}",
    "speeds": "the same motion at a third of the speed, and three times as fast",
    "holds": "holds of 30 s at several levels",
    "repeats": "one run twice",
    "time": "time, or give the rate",
    "sampling": "at a higher rate",
    "sensor": "with a finer or wider sensor",
}


def gap_sentence(gap: Gap) -> str:
    """Return what recordings cannot identify, with the number that shows it."""
    return GAPS[gap.what].format(
        channels=listing(gap.channels),
        value=numeral(gap.value, 2),
        needed=numeral(gap.needed, 2),
        percent=f"{numeral(100 * gap.value, 2)} %",
        levels=_levels(gap),
    )


def gap_run(gap: Gap) -> str:
    """Return the run that would identify it."""
    return RUN.format(what=RUNS[gap.run].format(levels=_levels(gap)))


def plan_sentences(plan: Plan) -> list[str]:
    """Return what a plan does, what it leaves open, and what of it is extrapolated."""
    parts = {step.what for step in plan.steps}
    open_gaps = [gap for gap in plan.gaps if not any(gap.what in one.gaps for one in plan.steps)]
    return [
        PLAN.format(seconds=f"{plan.recording.duration:.0f}", parts=listing(sorted(parts))),
        *(LEFT_OPEN.format(gap=gap_sentence(gap), run=gap_run(gap)) for gap in open_gaps),
        *(EXTRAPOLATED.format(channel=name) for name in plan.extrapolated),
    ]


def _levels(gap: Gap) -> str:
    """Return the recorded ranges of the channels of a gap."""
    return listing(
        [
            " to ".join(dict.fromkeys(f"{end:.3g}" for end in ends))
            + f" {standard_unit(name) or ''}"
            for name, ends in gap.ranges.items()
        ]
    ).strip()


def listing(names: Sequence[str]) -> str:
    """Return names as a sentence has them.

    >>> listing(["a", "b", "c"])
    'a, b and c'
    """
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


# --- Bands and log reviews --------------------------------------------------------------------------

# --- The three answers ------------------------------------------------------------------------------
