"""Memory test: whether a model reproduces the gap between branches, also in a hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import MckibbenError
from mckibben.recording import Recording
from mckibben.signals import branches

LEVELS = 41
"""Input levels at which branches are compared, between 5 and 95 % of the range."""

HOLD_RAMPS = 10
"""Length of the synthetic hold, relative to the ramp before it."""


@dataclass(frozen=True)
class Memory:
    """Gaps between rising and falling branches, modelled and measured.

    Parameters
    ----------
    gap_ratio : float or None
        Slope of the model's branch gaps over the measured ones, at equal inputs reached from opposite
        directions: 1 is exact, 0 means that the model forgot. None where there are no such pairs.
    n_pairs : int
        Number of pairs of instants behind it.
    hold_ratio : float or None
        Share of the model's own branch gap that remains after a synthetic hold on each branch; 1 for a
        model that remembers.
    """

    gap_ratio: float | None
    n_pairs: int
    hold_ratio: float | None


def memory_test(
    block: Block,
    recordings: Sequence[Recording],
    outputs: Sequence[Array],
    pairs: Sequence[tuple[str, str]],
) -> Memory:
    """Compare the branch gaps of a model with the measured ones, and test a long hold.

    Parameters
    ----------
    outputs : sequence of array, shape (n, k)
        The model's free-running outputs on each recording.
    pairs : sequence of (str, str), length k
        Every output's own input, or where that rests the first of the block's that moves; the output.
    """
    names = [channel.name for channel in block.inputs]
    pairs = moving_pairs(recordings, pairs, names)
    gaps = paired_gaps(recordings, outputs, pairs)
    hold_shares = [hold_test(block, recordings[0], *pair) for pair in pairs]
    shares = [share for share in hold_shares if share is not None]
    return Memory(gap_ratio(gaps), len(gaps), float(np.mean(shares)) if shares else None)


def paired_gaps(
    recordings: Sequence[Recording], outputs: Sequence[Array], pairs: Sequence[tuple[str, str]]
) -> Array:
    """Return measured and modelled branch gaps, shape (n, 2), of all recordings and outputs.

    Parameters
    ----------
    outputs : sequence of array, shape (n, k)
        Modelled outputs on each recording; samples that are NaN do not count.
    pairs : sequence of (str, str), length k
        Of `moving_pairs`.
    """
    return np.concatenate(
        [
            branch_gaps(run[input_name], np.column_stack([run[output], modelled[:, place]]))
            for run, modelled in zip(recordings, outputs, strict=True)
            for place, (input_name, output) in enumerate(pairs)
        ]
    )


def gap_ratio(gaps: Array) -> float | None:
    """Return the slope of modelled branch gaps over the measured ones (n, 2); None without any."""
    measured, modelled = gaps.T
    power = float(measured @ measured)
    return float(modelled @ measured) / power if power > 0 else None


def moving_pairs(
    recordings: Sequence[Recording], pairs: Sequence[tuple[str, str]], names: Sequence[str]
) -> list[tuple[str, str]]:
    """Return inputs and outputs, where an input that rests is replaced by the first that moves."""

    def moves(name: str) -> bool:
        return any(name in run and np.ptp(run[name]) > 0 for run in recordings)

    return [
        (next(filter(moves, (input_name, *names)), input_name), output)
        for input_name, output in pairs
    ]


def branch_gaps(u: Array, y: Array) -> Array:
    """Return y (n, k) on the falling branch minus y on the rising one, at equal inputs u (n,).

    Shape (pairs, k): every level is taken on each pair of neighbouring branches that cross it.
    """
    low, high = np.quantile(u, [0.0, 1.0])
    levels = low + (high - low) * np.linspace(0.05, 0.95, LEVELS)
    crossings = []
    for start, stop, direction in branches(u):
        piece = slice(start, stop)
        order = np.argsort(u[piece], kind="stable")
        inputs, values = u[piece][order], y[piece][order]
        columns = [np.interp(levels, inputs, column, np.nan, np.nan) for column in values.T]
        crossings.append((direction, np.column_stack(columns)))
    gaps = [
        (after - before) if first > 0 else (before - after)
        for (first, before), (second, after) in pairwise(crossings)
        if first * second < 0
    ]
    joined = np.concatenate(gaps) if gaps else np.empty((0, y.shape[1]))
    return joined[np.isfinite(joined).all(axis=1)]


def hold_test(
    block: Block, recording: Recording, input_name: str, output_name: str
) -> float | None:
    """Return the share of the model's mid-range branch gap that survives a long hold.

    The input goes up to mid-range and stays, and in a second run up to the top, down to mid-range and
    stays; ramps last as long as the recording's median branch, the hold ten times that. Other inputs
    stay at the middle of theirs.
    """
    u = recording[input_name]
    low, high = float(u.min()), float(u.max())
    middle = 0.5 * (low + high)
    lengths = [stop - start for start, stop, _ in branches(u)]
    ramp = int(np.clip(np.median(lengths), 20, 5000))
    hold = np.full(HOLD_RAMPS * ramp, middle)
    up = np.linspace(low, middle, ramp)
    overshoot = np.concatenate([np.linspace(low, high, 2 * ramp), np.linspace(high, middle, ramp)])
    names = [channel.name for channel in block.inputs]
    rest = 0.5 * (recording.matrix(names).min(axis=0) + recording.matrix(names).max(axis=0))
    place = [channel.name for channel in block.outputs].index(output_name)
    ends = []
    for approach in (up, overshoot):
        inputs = np.tile(rest, (approach.size + hold.size, 1))
        inputs[:, names.index(input_name)] = np.concatenate([approach, hold])
        try:
            response = block.simulate(
                inputs, initial="first_sample", sample_time=recording.sample_time
            )
        except MckibbenError:
            return None
        ends.append(response[:, place])
    before = float(ends[1][overshoot.size] - ends[0][up.size])
    after = float(ends[1][-1] - ends[0][-1])
    return after / before if before != 0 else None
