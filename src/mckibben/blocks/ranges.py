"""Which inputs a block was identified for, and which are absurd.

A block answers in `Block.known_inputs` and `Block.known_outputs`; a compensator's inputs are outputs of
the model that it inverts. `input_bounds` widens them: what is beyond is no motion but a fault, and is
kept from the memory of streams and of exported C.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.fields import MEASURED, Channel
from mckibben.recording import PLAUSIBLE, standard_unit

if TYPE_CHECKING:
    from mckibben.blocks.base import Block

LARGEST = float(np.finfo(np.float64).max)

SAMPLES_PER_LEG = 20

SLOW_STEP = 1.0
"""Sample time [s] of a slow way of blocks without one of their own."""


def unknown(count: int) -> Array:
    """Return the ranges of channels of which none is known, shape (count, 2)."""
    return np.tile([-np.inf, np.inf], (count, 1))


def by_name(
    channels: Sequence[Channel], sources: Iterable[tuple[Sequence[Channel], Array]]
) -> Array:
    """Return the first finite range of every channel among sources, shape (n, 2).

    A measured channel has that of what it measures.
    """
    found = unknown(len(channels))
    named: dict[Channel, Array] = {}
    for given, ranges in sources:
        for channel, ends in zip(given, ranges, strict=True):
            if np.isfinite(ends).all():
                named.setdefault(channel, ends)
    for place, channel in enumerate(channels):
        plain = Channel(channel.name.removesuffix(MEASURED), channel.unit)
        found[place] = named.get(channel, named.get(plain, found[place]))
    return found


def both_sides(block: Block) -> list[tuple[tuple[Channel, ...], Array]]:
    """Return the outputs and the inputs of a block with their identified ranges."""
    return [(block.outputs, block.known_outputs), (block.inputs, block.known_inputs)]


def over_inputs(block: Block, sample_time: float) -> Array:
    """Return the range of outputs over the identified inputs, shape (n_outputs, 2).

    All inputs are at their lowest, highest or middle, then each alone is at an end: at rest there, and
    on a slow way from one to the next from the block's own start. `Block.reachable` is less: it is what
    every history leaves in reach.
    """
    low, high = block.known_inputs.T
    if not np.isfinite([low, high]).all():
        return unknown(len(block.outputs))
    middle = low + 0.5 * (high - low)
    alone = [np.where(np.eye(low.size, dtype=bool), end, middle) for end in (low, high)]
    corners = np.vstack([low, high, low, middle, *alone])
    legs = np.linspace(0, len(corners) - 1, SAMPLES_PER_LEG * (len(corners) - 1) + 1)
    way = np.stack([np.interp(legs, np.arange(len(corners)), line) for line in corners.T], axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = [block.simulate(way, sample_time=sample_time)]
        for row in corners:
            given = block.simulate(row[np.newaxis], initial="first_sample", sample_time=sample_time)
            found.append(given)
    outputs = np.vstack(found)
    ends = np.stack([outputs.min(axis=0), outputs.max(axis=0)], axis=1)
    return np.where(np.isfinite(ends), ends, unknown(len(ends)))


def input_bounds(block: Block) -> Array:
    """Return the lowest and highest value of every input that is no fault, shape (n_inputs, 2).

    The identified range, or where none is known the plausible one of its unit, is widened at both ends
    by its width, or by its largest size if that is more: a model that was identified from 180 to 200 mm
    may go from rest. Of a channel without either, all finite values pass.

    Examples
    --------
    >>> from mckibben import PI
    >>> input_bounds(PI.example()).tolist()
    [[-5.0, 10.0]]
    """
    known = block.known_inputs
    likely = np.reshape([plausible(channel) for channel in block.inputs], known.shape)
    # from 0 to 0 is no range
    moves = np.isfinite(known).all(axis=1, keepdims=True) & known.any(axis=1, keepdims=True)
    low, high = np.where(moves, known, likely).T
    with np.errstate(over="ignore"):
        margin = np.maximum(high - low, np.maximum(np.abs(low), np.abs(high)))
        bounds = np.stack([low - margin, high + margin], axis=1)
    return np.clip(bounds, -LARGEST, LARGEST)


def plausible(channel: Channel) -> tuple[float, float]:
    """Return the plausible range of a channel by its unit; infinite if there is none.

    A number without a unit may be anything, unless its name is a standard one.
    """
    found = PLAUSIBLE.get(channel.unit)
    if found is None or not (channel.unit or standard_unit(channel.name) == ""):
        return -np.inf, np.inf
    return found.low, found.high
