"""What a model was identified on, as far as it says so."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from mckibben.blocks.bands import Banded, inside
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled.balance import balance_in
from mckibben.errors import ModelError


def known_ranges(model: Block) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest of a model's inputs where it was identified, by name.

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
