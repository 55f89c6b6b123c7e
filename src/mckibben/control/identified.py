"""The input range of a model's identification, and recordings outside it."""

from __future__ import annotations

from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.ranges import known_ranges
from mckibben.numerals import numeral
from mckibben.recording import Recording

BEYOND = 0.05
"""Share of a range beyond which a value counts as outside; noise is smaller."""


def beyond_known(model: Block, recording: Recording) -> list[str]:
    """Return warnings about parts of a recording outside the identified range.

    Inverses without a balance count the samples that they clip instead.
    """
    if model.inverts and balance_in(model) is None:
        return []
    known, notes = known_ranges(model.inputs, model.known_inputs), []
    for channel in model.inputs:
        if channel.name not in known or channel.name not in recording:
            continue
        values, (low, high) = recording[channel.name], known[channel.name]
        reach = BEYOND * (high - low)
        if values.min() < low - reach or values.max() > high + reach:
            ends = " to ".join(numeral(float(end), 3) for end in (values.min(), values.max()))
            notes.append(
                f"in {recording.name}, {channel.name} goes from {ends} {channel.unit}, and the model "
                f"was identified from {numeral(low, 3)} to {numeral(high, 3)}: it extrapolates"
            )
    return notes
