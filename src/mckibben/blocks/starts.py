"""The state in which a free run begins: one rule for fits, scores, simulations, checks and bands.

A run begins from the first measured output for whatever that determines, and at rest for everything
else. What it determines is one past input: a linear model has been at rest at another input, a model
with hysteresis has come down from a peak, a model that takes past outputs has had that output. The past
is a short history of inputs before the first sample, after which every block is in a state it can reach.
Where no output was measured (a stream, generated code, arrays of inputs), where several inputs drive the
block, or where a start was stated, the block begins as it states: by default at rest at the first input.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.fields import drives
from mckibben.errors import ModelWarning

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.recording import Recording

SETTLING = 256
"""Samples at the first input after a peak, in which rates decay in a rate-dependent block."""

PRECISE = 1e-12
"""Precision of a peak, relative to the way down from the highest."""

EXPLAINED = 1e-9
"""Error of the first output, relative to its size, that is rounding: a run from rest explains it."""


def start_state(block: Block, recording: Recording) -> Array:
    """Return the state before the first sample of a recording, shape (n_states,)."""
    inputs = np.ascontiguousarray(recording.matrix(channel.name for channel in block.inputs))
    outputs = first_outputs(block, recording)
    if outputs is not None and unstated(block):
        known = block.state_at(inputs[0], outputs)
        if known is not None:
            return known
    return state_after(block, history(block, recording), inputs[0], recording.sample_time)


def history(block: Block, recording: Recording) -> Array:
    """Return the inputs before the first sample that explain the first output, shape (k, n_inputs).

    Empty (k = 0) where the block begins at rest at the first input, or as it states.
    """
    inputs = recording.matrix(channel.name for channel in block.inputs)
    outputs, first = first_outputs(block, recording), inputs[0]
    if outputs is None or block.n_states == 0 or block.n_driven != 1 or not unstated(block):
        return np.empty((0, inputs.shape[1]))
    step = recording.sample_time
    missed = outputs - _first_output(block, first[np.newaxis], step)
    if np.abs(missed).max() <= EXPLAINED * np.abs(outputs).max():
        return np.empty((0, inputs.shape[1]))
    if block.is_linear:
        return _rest_elsewhere(block, first, missed, step)
    return _excursion(block, inputs, outputs, step)


def state_after(block: Block, before: Array, first: Array, sample_time: float | None) -> Array:
    """Return the state after a history of inputs, (k, n_inputs), before a first input."""
    if not len(before):
        return block.initial_state(first)
    state = block.initial_state(before[0], "first_sample")
    before = np.ascontiguousarray(before)
    block.bind(sample_time, state, before, np.empty((len(before), len(block.outputs))))()
    return state


def first_outputs(block: Block, recording: Recording) -> Array | None:
    """Return the first measured value of every output of a block, or None where one is missing."""
    recording = recording.with_derived(channel.name for channel in block.outputs)
    commands = drives(block.outputs[0]) and not drives(block.inputs[0])
    given = {channel.name for channel in block.inputs}
    if commands or any(
        channel.name in given or recording.units.get(channel.name) != channel.unit
        for channel in block.outputs
    ):
        return None
    return np.array([recording[channel.name][0] for channel in block.outputs])


def unstated(block: Block) -> bool:
    """Return whether no part of a block states another start than rest at the first input."""
    return block.start == "first_sample" and all(map(unstated, getattr(block, "parts", ())))


def _first_output(block: Block, before: Array, sample_time: float | None) -> Array:
    """Return the output at the last of some inputs, (k, n_inputs), of a run from rest."""
    state = block.initial_state(before[0], "first_sample")
    outputs = np.empty((len(before), len(block.outputs)))
    block.bind(sample_time, state, before, outputs)()
    with warnings.catch_warnings():
        warnings.simplefilter("error", ModelWarning)
        try:
            block.report(state)
        except ModelWarning:  # a past that the model itself warns of is none
            return np.full(len(block.outputs), np.inf)
    return outputs[-1]


def _rest_elsewhere(block: Block, first: Array, missed: Array, sample_time: float | None) -> Array:
    """Return the input at which a linear block was at rest, shape (1, n_inputs), or (0, n_inputs).

    ``missed`` is what the first output is above that of a run from rest at the first input.
    """
    before = np.tile(first, (2, 1))
    before[0, 0] += 1.0
    slope = _first_output(block, before, sample_time) - _first_output(
        block, before[1:], sample_time
    )
    power = float(slope @ slope)
    if not power > 0:
        return before[:0]
    before[0, 0] = first[0] + float(slope @ missed) / power
    return before[: int(np.isfinite(before[0, 0]))]


def _excursion(block: Block, inputs: Array, outputs: Array, sample_time: float | None) -> Array:
    """Return the inputs from a past peak to the first input that explain the first outputs.

    The peak is between the first input and the highest of the block's range or the recording. Where none
    explains the outputs, it is the end that explains them better.
    """
    from scipy.optimize import brentq

    first, highest = inputs[0], float(inputs[:, 0].max())
    limits = getattr(_first_part(block), "input_range", None)
    if limits is not None:
        highest = max(highest, limits[1])
    settling = SETTLING if block.rate_dependent else 0

    def way(peak: float) -> Array:
        before = np.tile(first, (settling + 1, 1))
        before[0, 0] = peak
        return before

    def after(peak: float) -> Array:
        return _first_output(block, np.vstack([way(peak), first]), sample_time)

    lowest = float(first[0])
    ends = after(lowest), after(highest)
    direction = ends[1] - ends[0]

    def above(peak: float) -> float:
        """Return how far the output is above the measured one, along the way to that of the highest."""
        return float(direction @ (after(peak) - outputs))

    low, high = (float(direction @ (end - outputs)) for end in ends)
    if not np.isfinite([low, high]).all() or low >= 0:
        return np.empty((0, first.size))
    if high <= 0:
        return way(highest)
    tolerance = PRECISE * (highest - lowest)
    return way(float(brentq(above, lowest, highest, xtol=tolerance, disp=False)))


def _first_part(block: Block) -> Block:
    return _first_part(block.parts[0]) if hasattr(block, "parts") else block
