"""Where a balance of forces was identified, and what of a recording lies beyond."""

from __future__ import annotations

import numpy as np

from mckibben.blocks.compose import Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.inverse import Inverse
from mckibben.blocks.core.running import run_many
from mckibben.blocks.coupled.balance import Balance
from mckibben.numerals import numeral
from mckibben.recording import Recording

BEYOND = 0.05
"""Share of a range beyond which it is left: noise does less."""


def beyond_known(model: Block, recording: Recording) -> list[str]:
    """Return what of a recording lies beyond where a model's balance, if it has one, was identified.

    What schedules and loads it; and what drives the model: displacements of a compensator, pressures
    otherwise.
    """
    parts = model.parts if isinstance(model, Series) else (model,)
    solved = [part.forward if isinstance(part, Inverse) else part for part in parts]
    place = next((i for i, part in enumerate(solved) if isinstance(part, Balance)), None)
    if place is None:
        return []
    part, balance = parts[place], solved[place]
    assert isinstance(balance, Balance)
    driven = [channel for channel in model.inputs if channel.name not in model.scheduling]
    found = recording.matrix([channel.name for channel in driven])
    for before in parts[:place]:
        found = run_many([before], np.ascontiguousarray(found), sample_time=recording.sample_time)[
            0
        ]
    asked = [
        (channel, recording[channel.name], known)
        for channel, known in zip(balance.scheduled, balance.known, strict=False)
    ]
    for place, channel in enumerate(driven):
        known = balance.hull[place] if part is balance else balance.pressure_range
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
