"""The laws of inverses: exact through minor loops, from carried-over states, and after clipping.

What a dead time makes late is compared with what was due then.
"""

from __future__ import annotations

import warnings

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.laws.trial import MARGIN, Trial, narrowed, through, wander
from mckibben.errors import ModelError, ModelWarning

EXACT = 1e-9
"""Largest error of an inverse, relative to the range of the output."""


def inverts(trial: Trial) -> None:
    """Demand an inverse that is exact, or an error that says what to do."""
    block = trial.block
    try:
        inverse = block.inverse()
    except ModelError as error:
        trial.demand("Remedy:" in str(error), "an error of inverse() ends with a remedy")
        return
    swapped = (*block.outputs, *block.inputs[trial.n_driven :])
    driven = block.inputs[: trial.n_driven]
    trial.demand(inverse.inputs == swapped, "an inverse takes the outputs, then what schedules")
    trial.demand(inverse.outputs == driven, "an inverse gives the driven inputs")
    again = inverse.inverse().simulate(trial.inputs, sample_time=trial.sample_time)
    trial.agree(again, trial.outputs, 1e-12, "the inverse of the inverse is the block")
    _tracks(trial, inverse, trial.outputs)
    low, high = block.reachable()
    if np.isfinite([*low, *high]).all() and not block.undoing:
        references = wander(*narrowed(low, high), trial.rng, trial.pace)
        _tracks(trial, inverse, references)
        _recovers(trial, inverse, low, high)


def _tracks(trial: Trial, inverse: Block, references: Array) -> None:
    """Demand exact tracking from the first sample, and from states carried over at half-time."""
    step = trial.sample_time
    n = min(len(references), len(trial.inputs))
    references, scheduling = references[:n], trial.inputs[:n, trial.n_driven :]
    wanted = np.column_stack([references, scheduling])
    given = np.column_stack([inverse.simulate(wanted, sample_time=step), scheduling])
    late = round((trial.block.dead_time + inverse.dead_time) / step)
    due = references[: n - late]
    law = (
        "forward of inverse gives the reference, after the dead time, to 1e-9 of the output's range"
    )
    trial.agree(trial.run(given)[late:], due, EXACT, law)
    half = n // 2
    forward_state = _state_after(trial.block, given[:half], step)
    inverse_state = _state_after(inverse, wanted[:half], step)
    starts = (
        [inverse_state, forward_state] if hasattr(trial.block, "input_range") else [inverse_state]
    )
    for start in starts:
        resumed = inverse.simulate(wanted[half:], initial=start, sample_time=step)
        outputs = trial.run(np.column_stack([resumed, scheduling[half:]]), forward_state)
        trial.agree(outputs[late:], due[half:], EXACT, f"from a carried-over state, {law}")


def _recovers(trial: Trial, inverse: Block, low: Array, high: Array) -> None:
    """Demand that references out of reach are clipped with a warning, and harm nothing after."""
    middle, span = (low + high) / 2, high - low
    turns = trial.rng.uniform(low, high, (19, low.size))
    turns[6], turns[12] = high + span / 2, low - span / 2
    references = through(turns, np.full(len(turns) - 1, trial.pace))
    scheduling = np.tile(trial.inputs[0, trial.n_driven :], (len(references), 1))
    wanted = np.column_stack([references, scheduling])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        given = inverse.simulate(wanted, sample_time=trial.sample_time)
    warned = any(issubclass(warning.category, ModelWarning) for warning in caught)
    trial.demand(warned, "an inverse warns of references out of reach with a ModelWarning")
    late = round((trial.block.dead_time + inverse.dead_time) / trial.sample_time)
    outputs = trial.run(np.column_stack([given, scheduling]))[late:]
    references = references[: len(outputs)]
    inside = (np.abs(references - middle) <= (0.5 - MARGIN) * span).all(axis=1)
    law = "after a reference out of reach, the inverse is exact again"
    trial.agree(outputs[inside], references[inside], EXACT, law)


def _state_after(block: Block, inputs: Array, sample_time: float) -> list[float]:
    state = block.initial_state(inputs[0])
    block.bind(sample_time, state, inputs, np.empty((len(inputs), len(block.outputs))))()
    values: list[float] = state.tolist()
    return values
