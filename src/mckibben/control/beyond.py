"""Where a model was identified, and what of a recording lies beyond."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import Placed, balance_in
from mckibben.blocks.fields import Channel
from mckibben.blocks.running import run_many
from mckibben.control.identified import known_ranges
from mckibben.numerals import numeral
from mckibben.recording import Recording

BEYOND = 0.05
"""Share of a range beyond which it is left: noise does less."""

Asked = list[tuple[Channel, Array, tuple[float, float]]]


def beyond_known(model: Block, recording: Recording) -> list[str]:
    """Return what of a recording lies beyond where a model was identified, as far as it knows that.

    Of a balance, what schedules and loads it; and what drives it: displacements of a compensator,
    pressures otherwise. Other inverses tell of what they clip as they run.
    """
    placed = balance_in(model)
    if placed is not None:
        asked = _of_balance(placed, model, recording)
    elif model.undoing:
        asked = []
    else:
        known = known_ranges(model)
        asked = [
            (channel, recording[channel.name], known[channel.name])
            for channel in model.inputs
            if channel.name in known and channel.name in recording
        ]
    notes = []
    for channel, values, (low, high) in asked:
        reach = BEYOND * (high - low)
        if values.min() < low - reach or values.max() > high + reach:
            ends = " to ".join(numeral(float(end), 3) for end in (values.min(), values.max()))
            notes.append(
                f"in {recording.name}, {channel.name} goes from {ends} {channel.unit}, and the model "
                f"was identified from {numeral(low, 3)} to {numeral(high, 3)}: it extrapolates. "
                "Remedy: identify it on recordings that go there too"
            )
    return notes


def _of_balance(placed: Placed, model: Block, recording: Recording) -> Asked:
    balance = placed.balance
    driven = [channel for channel in model.inputs if channel.name not in model.scheduling]
    found = recording.matrix([channel.name for channel in driven])
    for part in placed.before:
        found = run_many([part], np.ascontiguousarray(found), sample_time=recording.sample_time)[0]
    asked: Asked = [
        (channel, recording[channel.name], (low, high))
        for channel, (low, high) in zip(balance.scheduled, balance.known, strict=False)
    ]
    for place, channel in enumerate(driven):
        known = balance.pressure_range if placed.solved else balance.known_coordinates[place]
        if known is not None:
            asked.append((channel, found[:, place], (known[0], known[1])))
    return asked
