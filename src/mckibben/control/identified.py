"""The input range of a model's identification, and recordings outside it."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.bands import Banded, inside
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled.balance import Placed, balance_in
from mckibben.blocks.fields import Channel
from mckibben.blocks.running import run_many
from mckibben.errors import ModelError
from mckibben.numerals import numeral
from mckibben.recording import Recording

BEYOND = 0.05
"""Share of a range beyond which a value counts as outside; noise is smaller."""

Asked = list[tuple[Channel, Array, tuple[float, float]]]


def known_ranges(model: Block) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest identified value of a model's inputs, by name.

    Of its own input range, or its inverse's; of what a balance was scheduled and loaded by; or else of
    what its band saw. Inputs of which nothing is known are absent.

    Examples
    --------
    >>> from mckibben import PI
    >>> known_ranges(PI.example())
    {'pressure': (0.0, 5.0)}
    """
    known: dict[str, tuple[float, float]] = {}
    if isinstance(model, Banded):
        ends = zip(model.band.driving, *model.band.ends, strict=False)
        known = {channel.name: (low, high) for channel, low, high in ends}
    model = inside(model)
    placed = balance_in(model)
    if placed is not None:
        balance = placed.balance
        if balance.pressure_range is not None:
            known |= {channel.name: balance.pressure_range for channel in balance.given}
        for channel, (low, high) in zip(balance.scheduled, balance.known, strict=False):
            known[channel.name] = (low, high)
    first = model
    while isinstance(first, Series):
        first = first.parts[0]
    own = getattr(first, "input_range", None)
    if own is not None:
        known[model.inputs[0].name] = (float(own[0]), float(own[1]))
        return known
    with suppress(ModelError):
        inverse = model.inverse()
        for channel, low, high in zip(inverse.outputs, *inverse.reachable(), strict=True):
            if np.isfinite([low, high]).all():
                known[channel.name] = (float(low), float(high))
    return known


def beyond_known(model: Block, recording: Recording) -> list[str]:
    """Return warnings about parts of a recording outside the identified range.

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
                f"was identified from {numeral(low, 3)} to {numeral(high, 3)}: it extrapolates"
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
