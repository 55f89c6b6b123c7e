"""Which inputs a block was identified for, and which are absurd.

A block answers in `Block.known_inputs` and `Block.known_outputs`; a compensator's inputs are outputs of
the model that it inverts. `Block.input_bounds` are wider: what is beyond is no motion but a fault, and
is kept from the memory of streams and of exported C.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.fields import Channel, Initial
from mckibben.recording import MEASURED, PLAUSIBLE, standard_unit

LARGEST = float(np.finfo(np.float64).max)

SAMPLES_PER_LEG = 20

REST_SAMPLE_TIME = 1.0
"""Sample time [s] of runs of one sample at rest, which it does not change."""


def unknown_ranges(count: int) -> Array:
    """Return the ranges of channels of which none is known, shape (count, 2)."""
    return np.tile([-np.inf, np.inf], (count, 1))


def first_known(
    channels: Sequence[Channel], sources: Iterable[tuple[Sequence[Channel], Array]]
) -> Array:
    """Return the first finite range of every channel among sources, shape (n, 2).

    A measured channel has that of what it measures.
    """
    ranges_found = unknown_ranges(len(channels))
    by_channel: dict[Channel, Array] = {}
    for channels_of, ranges in sources:
        for channel, ends in zip(channels_of, ranges, strict=True):
            if np.isfinite(ends).all():
                by_channel.setdefault(channel, ends)
    for k, channel in enumerate(channels):
        plain = Channel(channel.name.removesuffix(MEASURED), channel.unit)
        ranges_found[k] = by_channel.get(channel, by_channel.get(plain, ranges_found[k]))
    return ranges_found


def known_ranges(channels: Sequence[Channel], ranges: Array) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest identified value by channel, where known.

    Examples
    --------
    >>> from mckibben import PI
    >>> block = PI.example()
    >>> known_ranges(block.inputs, block.known_inputs)
    {'pressure': (0.0, 5.0)}
    """
    return {
        channel.name: (float(low), float(high))
        for channel, (low, high) in zip(channels, ranges, strict=True)
        if np.isfinite([low, high]).all()
    }


def range_over(
    run: Callable[[Array, Initial | None], Array], inputs: Array, *, moving: bool
) -> Array | None:
    """Return the range of a block's outputs over ranges of inputs, shape (n_outputs, 2).

    All inputs are at their lowest, highest or middle, then each alone is at an end: at rest there, and
    on a way from one to the next from the block's own start. `Block.reachable` is less: it is what every
    history leaves in reach. None where a range is not known.

    Parameters
    ----------
    run : callable
        Returns the outputs, (n, n_outputs), of a run over inputs, (n, n_inputs), from a start.
    inputs : array, shape (n_inputs, 2)
    moving : bool
        Whether the way counts; without, only the outputs at rest.
    """
    low, high = inputs.T
    if not np.isfinite([low, high]).all():
        return None
    middle = low + 0.5 * (high - low)
    alone = [np.where(np.eye(low.size, dtype=bool), end, middle) for end in (low, high)]
    corners = np.vstack([low, high, low, middle, *alone])
    legs = np.linspace(0, len(corners) - 1, SAMPLES_PER_LEG * (len(corners) - 1) + 1)
    way = np.stack([np.interp(legs, np.arange(len(corners)), line) for line in corners.T], axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        runs = [run(way, None)] if moving else []
        outputs = np.vstack([*runs, *(run(row[np.newaxis], "first_sample") for row in corners)])
    ends = np.stack([outputs.min(axis=0), outputs.max(axis=0)], axis=1)
    return np.where(np.isfinite(ends), ends, unknown_ranges(len(ends)))


def fault_bounds(channels: Sequence[Channel], known: Array) -> Array:
    """Return the lowest and highest value of every channel that is no fault, shape (n, 2).

    The identified range, or where none is known the plausible one of its unit, is widened at both ends
    by its width, or by its largest size if that is more: a model that was identified from 180 to 200 mm
    may go from rest. Of a channel without either, all finite values pass.
    """
    likely = np.reshape([plausible(channel) for channel in channels], known.shape)
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
    limits = PLAUSIBLE.get(channel.unit)
    if limits is None or not (channel.unit or standard_unit(channel.name) == ""):
        return -np.inf, np.inf
    return limits.low, limits.high
