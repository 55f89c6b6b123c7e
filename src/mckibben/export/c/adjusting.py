"""Which numbers of an exported model may be set from outside, and how far.

Not every number of a model is a measure of something: some count or point into tables, and the C trusts
them. What follows the model's parameters may move; counts and pointers, which are whole at the exported
values and near by, may not.
"""

from __future__ import annotations

import warnings

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.laws.trial import wander
from mckibben.errors import ModelError, ModelWarning
from mckibben.export.c.wiring import Call, Wiring

NUDGE, NUDGES = 1e-3, 4
"""Relative size of a trial change of all parameters, and how many of them."""

TURNS = 24


def coefficient_limits(wiring: Wiring, share: float) -> tuple[Array, Array]:
    """Return the lowest and highest of every coefficient, each of shape (n_coefficients,).

    Parameters
    ----------
    wiring : Wiring
        Of the model.
    share : float
        By which a coefficient may differ from the exported one.
    """
    lowest, highest = [], []
    for call in wiring.calls:
        numbers = call.part.coefficients if call.part.coefficients.size else np.zeros(1)
        reach = np.zeros(numbers.size)
        moved = _moved(call.part.block, numbers, wiring.sample_time)
        reach[moved] = share * np.abs(numbers[moved])
        lowest.append(numbers - reach)
        highest.append(numbers + reach)
    return np.concatenate(lowest), np.concatenate(highest)


def _moved(block: Block, numbers: Array, sample_time: float | None) -> Array:
    """Return which coefficients change with the parameters, and are no counts."""
    rng = np.random.default_rng(0)
    parameters, found = block.pack(), np.zeros(numbers.size, dtype=bool)
    whole = numbers == np.round(numbers)
    for _ in range(NUDGES if parameters.size else 0):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            try:
                near = block.unpack(parameters * (1 + NUDGE * rng.uniform(-1, 1, parameters.size)))
                moved = near.coefficients(sample_time)
            except ModelError:
                continue
        if moved.size == numbers.size:  # else its structure follows its parameters: all stay
            found |= moved != numbers
            whole &= moved == np.round(moved)
        else:
            return np.zeros(numbers.size, dtype=bool)
    return found & ~whole & np.isfinite(numbers)


def memory_limits(wiring: Wiring, lowest: Array, highest: Array) -> tuple[Array, Array] | None:
    """Return the lowest and highest of every number of the memory, each of shape (n_numbers,).

    It is where the memory goes while the inputs wander over their ranges, and half as far again. Of
    scratch, which is not taken, the lowest is above the highest. None where the memory counts or points.

    Parameters
    ----------
    wiring : Wiring
        Of the model.
    lowest, highest : array, shape (n_inputs,)
        Ranges of the inputs.
    """
    pace = 200 if wiring.block.rate_dependent else 12
    inputs = wander(lowest, highest, np.random.default_rng(0), pace, TURNS)
    low, high = np.ones(wiring.n_numbers), np.zeros(wiring.n_numbers)
    signals: dict[str, Array] = {f"in[{k}]": column for k, column in enumerate(inputs.T)}
    for step in wiring.steps:
        if not isinstance(step, Call):
            signals[f"signals[{step.output}]"] = np.sum(
                [signals[term] for term in step.terms], axis=0
            )
            continue
        given = np.column_stack([signals[name] for name in step.inputs])
        visited, outputs = _run(step.part.block, given, wiring.sample_time)
        for k, column in enumerate(outputs.T):
            signals[f"signals[{step.first_output + k}]"] = column
        whole = (visited == np.round(visited)).all(axis=0)
        if (whole & (np.ptp(visited, axis=0) > 0)).any():
            return None
        least, most = visited.min(axis=0), visited.max(axis=0)
        place = slice(step.first_state, step.first_state + visited.shape[1])
        low[place], high[place] = least - 0.5 * (most - least), most + 0.5 * (most - least)
    return low, high


def _run(block: Block, inputs: Array, sample_time: float | None) -> tuple[Array, Array]:
    """Return memory and outputs after every sample."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        stream = block.stream(sample_time)
        rows = [(stream.step(row).copy(), stream.state.copy()) for row in inputs]
    outputs, visited = zip(*rows, strict=True)
    return np.array(visited), np.array(outputs)
