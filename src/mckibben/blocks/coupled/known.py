"""Where a balance of forces was identified, and what of a recording lies beyond."""

from __future__ import annotations

import numpy as np

from mckibben.blocks.core.block import Block
from mckibben.blocks.core.running import run_many
from mckibben.blocks.coupled.balance_in import balance_in
from mckibben.numerals import numeral
from mckibben.recording import Recording

BEYOND = 0.05
"""Share of a range beyond which it is left: noise does less."""


def beyond_known(model: Block, recording: Recording) -> list[str]:
    """Return what of a recording lies beyond where a model's balance, if it has one, was identified.

    What schedules and loads it; and what drives the model: displacements of a compensator, pressures
    otherwise.
    """
    placed = balance_in(model)
    if placed is None:
        return []
    balance = placed.balance
    driven = [channel for channel in model.inputs if channel.name not in model.scheduling]
    found = recording.matrix([channel.name for channel in driven])
    for part in placed.before:
        found = run_many([part], np.ascontiguousarray(found), sample_time=recording.sample_time)[0]
    asked = [
        (channel, recording[channel.name], known)
        for channel, known in zip(balance.scheduled, balance.known, strict=False)
    ]
    for place, channel in enumerate(driven):
        known = balance.pressure_range if placed.solved else balance.hull[place]
        if known is not None:
            asked.append((channel, found[:, place], known))
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
