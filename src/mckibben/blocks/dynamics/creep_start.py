"""Starts of creep: how far its elements had crept before the first sample, as known outputs tell.

A muscle that had been at work, or at rest, before a recording goes on creeping for as long as its slow
elements take, be that tens of minutes: the output drifts whatever the input does. What the elements'
start adds to the output is linear in it where nothing but a gain is behind, so it is solved for.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.dynamics.linear_start import Mask, told_by


def begun_places(block: Block) -> list[int]:
    """Return the places of a model's states that are elements of creep whose start is fitted."""
    if isinstance(block, Creep):
        return [*range(block.n_states)] if block.initial == "fitted" else []
    places, first = [], 0
    for part in getattr(block, "parts", ()):
        places += [first + place for place in begun_places(part)]
        first += part.n_states
    return places


def begun_state(
    block: Block, state: Array, inputs: Array, outputs: Array, step: float | None, counts: Mask
) -> Array:
    """Return a state with the elements of creep where they explain outputs best, shape (n_states,).

    Parameters
    ----------
    block : Block
        With creep whose start is fitted, behind which there is nothing but a gain.
    state : array, shape (n_states,)
        Before the first sample.
    inputs : array, shape (n, n_inputs)
    outputs : array, shape (n,)
    step : float or None
        Sample time [s].
    counts : array of bool, shape (n,)
        Where outputs are known.
    """

    def run(start: Array) -> Array:
        found = np.empty((len(inputs), 1))
        block.bind(step, start.copy(), inputs, found)()
        return found[:, 0]

    places, at_rest = begun_places(block), run(state)
    unit = max(float(np.ptp(at_rest)), 1e-12)
    free = [run(state + unit * (np.arange(state.size) == place)) - at_rest for place in places]
    begun = state.copy()
    begun[places] += unit * told_by(np.column_stack(free), outputs - at_rest, counts)
    return begun
