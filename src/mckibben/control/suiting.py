"""Checks whether results on a plant apply to the muscle of a compensator."""

from __future__ import annotations

import warnings

import numpy as np

from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.control.identified import known_ranges
from mckibben.control.roles import Plant
from mckibben.control.twin import Twin, plain
from mckibben.errors import MckibbenError, ModelWarning
from mckibben.numerals import numeral
from mckibben.recording import Recording

LARGEST_DIFFERENCE = 0.25
"""Share of a model's stroke by which the ends of the plant's slow rise may differ before it counts
as another muscle: specimens, temperatures and loads differ by less, muscle sizes by more.
"""

BEYOND = 0.25
"""Share of a model's pressure range beyond the plant's limits above which it counts as another
muscle: recordings of one muscle differ by a few tenths of a bar.
"""

REMEDY = "test it on a model of your own muscle (`plant=model.json`), where that was identified"


def of_itself(model: Block | None, plant: Plant) -> bool:
    """Return whether a plant is the model that a compensator inverts."""
    return (
        model is not None
        and isinstance(plant, Twin)
        and inside(model).to_dict() == plant.forward.to_dict()
    )


def doubts(compensator: Block, plant: Plant, rise: Recording) -> list[str]:
    """Return warnings against transferring results of a compensator from a plant to a muscle.

    ``rise`` is what the plant does while its commands rise slowly, from `mckibben.control.slow_rise`.
    """
    model = compensator.forward_model
    if model is None:
        return []
    if of_itself(model, plant):
        same = "the plant is the model that the compensator inverts"
        if isinstance(plant, Twin) and plant.scatters:
            return [f"{same}, with its band: errors without feedback are draws from the band"]
        return [
            f"{same}, so errors come from limits and rates alone: test it "
            "on another model of the muscle, or calibrate this one on held-out recordings "
            "(`calibrate()`; `plant=banded.json`)"
        ]
    return [*_pressures(model, plant, rise), *_strokes(model, plant, rise)]


def doubts_of_feedback(law: str, plant: Plant) -> list[str]:
    """Return warnings about feedback on a plant: a static model has no lag."""
    if law == "feedforward" or not isinstance(plant, Twin) or plant.forward.rate_dependent:
        return []
    return [
        "the plant is a static model, which responds within one sample: feedback performs better on it "
        "than on the muscle; test feedback on a model with dynamics, such as balance fitted to "
        "recordings that have time"
    ]


def _pressures(model: Block, plant: Plant, rise: Recording) -> list[str]:
    """Return a warning about identified pressures that the plant does not allow."""
    notes = []
    for channel in model.inputs:
        name, known = plain(channel.name), known_ranges(model).get(channel.name)
        if known is None or name not in rise or not np.ptp(rise[name]):
            continue
        (low, high), limits = known, plant.limits(name)
        reach = BEYOND * (high - low)
        if high > limits.high + reach or low < limits.low - reach:
            notes.append(
                f"the compensator is of {name} from {_span(low, high)} {channel.unit}, and {plant.name} "
                f"takes {_span(limits.low, limits.high)}. {REMEDY}"
            )
    return notes


def _strokes(model: Block, plant: Plant, rise: Recording) -> list[str]:
    """Return a warning if a plant's slow rise starts or ends elsewhere than the model's."""
    if any(plain(channel.name) not in rise for channel in model.inputs):
        return []
    known, within = known_ranges(model), np.ones(len(rise), dtype=bool)
    given = {channel.name: rise[plain(channel.name)] for channel in model.inputs}
    driven = [name for name, values in given.items() if np.ptp(values) > 0]
    if len(driven) != len(
        model.outputs
    ):  # of an arm, some pull against each other and move nothing
        return []
    for name in driven:
        low, high = known.get(name, (-np.inf, np.inf))
        within &= (given[name] >= low) & (given[name] <= high)
    if not within.any():
        return []
    units = {channel.name: channel.unit for channel in model.inputs}
    shared = {name: values[within] for name, values in given.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        try:
            expected = model.simulate(Recording(shared, rise.sample_time, units))
        except MckibbenError:  # what fails here fails in the loop, which says why
            return []
    notes = []
    ends = ", ".join(
        f"{plain(name)} {_span(*shared[name][[0, -1]])} {units[name]}" for name in driven
    )
    for channel in model.outputs:
        if channel.name not in rise:
            continue
        ours, theirs = rise[channel.name][within][[0, -1]], expected[channel.name][[0, -1]]
        if np.abs(ours - theirs).max() > LARGEST_DIFFERENCE * abs(theirs[1] - theirs[0]):
            notes.append(
                f"in a slow rise ({ends}), {channel.name} of {plant.name} goes from {_span(*ours)} "
                f"{channel.unit}, and of the compensator's model from {_span(*theirs)}. {REMEDY}"
            )
    return notes


def _span(low: float, high: float) -> str:
    return f"{numeral(float(low), 3)} to {numeral(float(high), 3)}"
