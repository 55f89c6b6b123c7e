"""The input range of a model's identification, and recordings outside it."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import Placed, balance_in
from mckibben.blocks.fields import Channel
from mckibben.blocks.running import run_many
from mckibben.numerals import numeral
from mckibben.recording import Recording

BEYOND = 0.05
"""Share of a range beyond which a value counts as outside; noise is smaller."""

Checked = list[tuple[Channel, Array, tuple[float, float]]]


def known_ranges(model: Block) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest identified value of a model's inputs, by name, where known.

    Examples
    --------
    >>> from mckibben import PI
    >>> known_ranges(PI.example())
    {'pressure': (0.0, 5.0)}
    """
    return {
        channel.name: (float(low), float(high))
        for channel, (low, high) in zip(model.inputs, model.known_inputs, strict=True)
        if np.isfinite([low, high]).all()
    }


def beyond_known(model: Block, recording: Recording) -> list[str]:
    """Return warnings about parts of a recording outside the identified range.

    For a balance: scheduling inputs, loads, and displacements of a compensator or pressures of a model.
    Other inverses count the samples that they clip.
    """
    placed = balance_in(model)
    if placed is not None:
        checked = _of_balance(placed, model, recording)
    elif model.inverts:
        checked = []
    else:
        known = known_ranges(model)
        checked = [
            (channel, recording[channel.name], known[channel.name])
            for channel in model.inputs
            if channel.name in known and channel.name in recording
        ]
    notes = []
    for channel, values, (low, high) in checked:
        reach = BEYOND * (high - low)
        if values.min() < low - reach or values.max() > high + reach:
            ends = " to ".join(numeral(float(end), 3) for end in (values.min(), values.max()))
            notes.append(
                f"in {recording.name}, {channel.name} goes from {ends} {channel.unit}, and the model "
                f"was identified from {numeral(low, 3)} to {numeral(high, 3)}: it extrapolates"
            )
    return notes


def _of_balance(placed: Placed, model: Block, recording: Recording) -> Checked:
    balance = placed.balance
    driven = [channel for channel in model.inputs if channel.name not in model.scheduling]
    found = recording.matrix([channel.name for channel in driven])
    for part in placed.before:
        found = run_many([part], np.ascontiguousarray(found), sample_time=recording.sample_time)[0]
    checked: Checked = [
        (channel, recording[channel.name], (low, high))
        for channel, (low, high) in zip(balance.scheduled, balance.known, strict=False)
    ]
    for place, channel in enumerate(driven):
        known = balance.pressure_range if placed.solved else balance.known_coordinates[place]
        if known is not None:
            checked.append((channel, found[:, place], (known[0], known[1])))
    return checked
