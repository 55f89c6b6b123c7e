"""The state in which a free run begins: one rule for fits, scores, simulations, checks and bands.

A run begins from the first measured output for whatever that determines, and at rest for everything
else. What it determines is one past input: a linear model has been at rest at another input, a model
with hysteresis has come down from a peak, a model that takes past outputs has had that output. The past
is a short history of inputs before the first sample, after which every block is in a state it can reach.
Where no output was measured (a stream, generated code, arrays of inputs), where several inputs drive the
block, or where a start was stated, the block begins as it states: by default at rest at the first input.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.fields import drives
from mckibben.blocks.runs import Run, run_of
from mckibben.recording import Recording

if TYPE_CHECKING:
    from mckibben.blocks.base import Block

SETTLING = 256
"""Most samples at the first input before a recording, in which rates decay in a rate-dependent block."""

PRECISE = 1e-12
"""Precision of a peak, relative to the way down from the highest."""

EXPLAINED = 1e-9
"""Error of the first output, relative to its size, that is rounding: a run from rest explains it."""


def run_on(block: Block, recording: Recording, rows: Mask | None = None, index: int = 0) -> Run:
    """Return a recording as a run of a block, without outputs if the recording lacks one of them.

    ``rows`` are the samples that count, shape (n,); those bridged in reading never do.
    """
    inputs, outputs = ([c.name for c in some] for some in (block.inputs, block.outputs))
    whole = recording.with_derived([*inputs, *outputs])
    measured = all(whole.units.get(channel.name) == channel.unit for channel in block.outputs)
    return run_of(
        whole,
        inputs[: block.n_driven],
        outputs if measured else (),
        inputs[block.n_driven :],
        ~whole.bridged if rows is None else rows & ~whole.bridged,
        index=index,
    )


def start_state(block: Block, run: Run) -> Array:
    """Return the state before the first sample of a run, shape (n_states,)."""
    return state_after(block, history(block, run), run)


def history(block: Block, run: Run) -> Array:
    """Return the inputs before the first sample that explain the first output, shape (k, n_inputs).

    Empty (k = 0) where the block begins at rest at the first input, or as it states.
    """
    outputs, first, step = first_outputs(block, run), run.first, run.sample_time
    if outputs is None or block.n_driven != 1 or block.state_at(first, outputs) is not None:
        return np.empty((0, first.size))
    missed = outputs - _outputs(block, first[np.newaxis], step)[-1]
    if np.abs(missed).max() <= EXPLAINED * np.abs(outputs).max():
        return np.empty((0, first.size))
    if block.is_linear:
        return _rest_elsewhere(block, first, missed, step)
    return _excursion(block, run.inputs, outputs, step)


def state_after(block: Block, before: Array, run: Run) -> Array:
    """Return the state after a history of inputs, (k, n_inputs), before the first sample of a run.

    That of a block of past outputs is given by the first outputs instead.
    """
    first, step = run.first, run.sample_time
    known = known_state(block, run)
    if known is not None:
        return known
    if not len(before):
        return block.initial_state(first, sample_time=step)
    state = block.initial_state(before[0], "first_sample", step)
    before = np.ascontiguousarray(before)
    block.bind(step, state, before, np.empty((len(before), len(block.outputs))))()
    return state


def known_state(block: Block, run: Run) -> Array | None:
    """Return the state of a block of past outputs, shape (n_states,), which the first outputs give."""
    outputs = first_outputs(block, run)
    return None if outputs is None else block.state_at(run.first, outputs)


def first_outputs(block: Block, run: Run) -> Array | None:
    """Return the first outputs, from which a block begins, shape (m,); None where they have no say.

    That is where they are not known, or also an input, where the block has no state or states its
    start, and where it is a compensator, whose outputs are commands.
    """
    commands = drives(block.outputs[0]) and not drives(block.inputs[0])
    given = {channel.name for channel in block.inputs}
    again = any(channel.name in given for channel in block.outputs)
    return None if commands or again or not block.n_states or not unstated(block) else run.start


def unstated(block: Block) -> bool:
    """Return whether no part of a block states another start than rest at the first input."""
    return block.start == "first_sample" and all(map(unstated, getattr(block, "parts", ())))


def _outputs(block: Block, inputs: Array, sample_time: float | None) -> Array:
    """Return the outputs over inputs, (k, n_inputs), of a run from rest; infinite where it clipped."""
    state = block.initial_state(inputs[0], "first_sample", sample_time)
    outputs = np.empty((len(inputs), len(block.outputs)))
    block.bind(sample_time, state, np.ascontiguousarray(inputs), outputs)()
    if block.n_clipped(state):  # a past that the model itself warns of is none
        outputs[:] = np.inf
    return outputs


def _rest_elsewhere(block: Block, first: Array, missed: Array, sample_time: float | None) -> Array:
    """Return the input at which a linear block was at rest, shape (1, n_inputs), or (0, n_inputs).

    ``missed`` is what the first output is above that of a run from rest at the first input.
    """
    before = np.tile(first, (2, 1))
    before[0, 0] += 1.0
    at_rest = _outputs(block, before[1:], sample_time)[-1]
    slope = _outputs(block, before, sample_time)[-1] - at_rest
    power = float(slope @ slope)
    if not power > 0:
        return before[:0]
    before[0, 0] = first[0] + float(slope @ missed) / power
    return before[: int(np.isfinite(before[0, 0]))]


def _excursion(block: Block, inputs: Array, outputs: Array, sample_time: float | None) -> Array:
    """Return the past of a block with memory that explains the first outputs, shape (k, n_inputs).

    Pasts are tried in the order of what they leave in the output: the input has just come from lower;
    has been held for a while (both make a difference where the block depends on the rate); or has come
    down from a peak and been held since. Inputs are those of the block's range and the recording. Where
    none explains the outputs, it is the end that explains them better.
    """
    first, given = inputs[0], inputs[:, 0]
    driven = block
    while parts := getattr(driven, "parts", ()):
        driven = parts[0]
    low, high = getattr(driven, "input_range", None) or (first[0], first[0])
    low, high = min(low, float(given.min())), max(high, float(given.max()))
    held = np.tile(first, (SETTLING if block.rate_dependent else 0, 1))

    def come_from(level: float) -> Array:
        return np.append(level, first[1:])[np.newaxis]

    def down_from(peak: float) -> Array:
        return np.vstack([come_from(peak), held])

    def last(before: Array) -> Array:
        return _outputs(block, np.vstack([before, first]), sample_time)[-1]

    ends = last(come_from(low)), last(down_from(high))
    direction = ends[1] - ends[0]

    def above(found: Array) -> Array:
        """Return how far outputs are above the measured ones, along the way between the ends."""
        return np.asarray((found - outputs) @ direction)

    if not np.isfinite(direction).all():
        return held[:0]
    while_held = above(_outputs(block, np.vstack([held, first]), sample_time))
    if while_held[0] >= 0:
        return _where(above, last, come_from, low, float(first[0])) if len(held) else held[:0]
    if while_held[-1] >= 0:
        return held[: int(np.argmax(while_held >= 0))]
    return _where(above, last, down_from, float(first[0]), high)


def _where(
    above: Callable[[Array], Array],
    last: Callable[[Array], Array],
    way: Callable[[float], Array],
    low: float,
    high: float,
) -> Array:
    """Return the past of a family at which the first outputs are explained, or the nearer end."""
    from scipy.optimize import brentq

    def missed(level: float) -> float:
        return float(above(last(way(level))))

    if not missed(low) < 0:
        return way(low)
    if not missed(high) > 0:
        return way(high)
    tolerance = PRECISE * (high - low)
    return way(float(brentq(missed, low, high, xtol=tolerance, disp=False)))
