"""Fitted start states: the state before the first sample that best explains measured outputs.

What the state of a linear model, or of creep with nothing but a gain behind it, adds to the output is
linear in it, so the best one is solved for. A block whose `initial` is "fitted" is started so wherever
outputs are known: on the recordings it is identified from and, up to where the known outputs end, in
comparisons; a linear one also by `simulate`, on recordings with its output. Where none are known, as in
streams and in generated code, it starts at rest at the first input.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Initial
from mckibben.recording import Recording

Mask = NDArray[np.bool_]

KNOWN = 0.5
"""Smallest norm, over known outputs, of the unit-norm start response for which a start state is
estimated.
"""


def fitted_places(block: Block, rule: Initial | None = None) -> list[int]:
    """Return the indices of the estimated states under a start rule, by default the block's own."""
    if (getattr(block, "initial", None) if rule is None else rule) == "fitted":
        return [*range(block.n_fitted)]
    places, first = [], 0
    for part in getattr(block, "parts", ()):
        places += [first + place for place in fitted_places(part)]
        first += part.n_states
    return places


def start_on(block: Block, recording: Recording, initial: Initial | None = None) -> Initial | None:
    """Return the start for a recording: the estimated state, if that is the rule."""
    output = block.outputs[0]
    known = output.name in recording and recording.units[output.name] == output.unit
    if not known or (block.start if initial is None else initial) != "fitted":
        return initial
    inputs, y = recording.matrix(c.name for c in block.inputs), recording[output.name]
    return fitted_state(block, inputs, y, recording.sample_time, rule="fitted").tolist()


def fitted_state(
    block: Block,
    inputs: Array,
    outputs: Array,
    sample_time: float | None,
    counts: Mask | None = None,
    rule: Initial | None = None,
) -> Array:
    """Return the least-squares initial state, shape (n_states,).

    It is at rest in what the known outputs do not determine: where the first ones are not known, a start
    that has died away before the others would be made up of their noise.

    Parameters
    ----------
    block : Block
    inputs : array, shape (n, n_inputs)
    outputs : array, shape (n,)
    sample_time : float or None
        [s].
    counts : array of bool, shape (n,), optional
        Where outputs are known; default everywhere.
    rule : optional
        As of `fitted_places`.
    """
    counts = np.ones(len(inputs), dtype=bool) if counts is None else counts
    state, places = block.initial_state(inputs[0], rule), fitted_places(block, rule)
    left = outputs - _run(block, state, inputs, sample_time)
    if places and np.isfinite(left[counts]).all():
        free = free_responses(block, inputs, sample_time, places)
        states, responses = known_starts(free, counts)
        state[places] += states @ (responses.T @ left[counts])
    return state


def fitted_run(
    block: Block, inputs: Array, outputs: Array, sample_time: float | None, counts: Mask
) -> Array:
    """Return the first output of a run from a fitted start, shape (n,)."""
    state = fitted_state(block, inputs, outputs, sample_time, counts)
    return _run(block, state, inputs, sample_time)


def free_responses(
    block: Block, inputs: Array, sample_time: float | None, places: Sequence[int]
) -> Array:
    """Return the output due to a unit of each state, shape (n, k).

    Of a linear model at its operating point, where nothing else moves its output.
    """
    rest: float | Array
    if hasattr(block, "input_offset") and hasattr(block, "output_offset"):
        inputs, state = np.full_like(inputs, block.input_offset), np.zeros(block.n_states)
        rest, unit = block.output_offset, 1.0
    else:
        state = block.initial_state(inputs[0])
        rest = _run(block, state, inputs, sample_time)
        unit = float(np.ptp(rest)) or 1.0
    found = np.empty((len(inputs), len(places)))
    for column, place in enumerate(places):
        moved = state.copy()
        moved[place] += unit
        found[:, column] = (_run(block, moved, inputs, sample_time) - rest) / unit
    return found


def _run(block: Block, state: Array, inputs: Array, sample_time: float | None) -> Array:
    """Return the first output of a run from a state, shape (n,)."""
    outputs = np.empty((len(inputs), len(block.outputs)))
    block.bind(sample_time, state.copy(), np.ascontiguousarray(inputs), outputs)()
    return outputs[:, 0]


def known_starts(free: Array, counts: Mask, least: float = KNOWN) -> tuple[Array, Array]:
    """Return the start responses that known outputs determine, each with its values at these.

    Parameters
    ----------
    free : array, shape (n, k)
        What a unit of every state adds to the output.
    counts : array of bool, shape (n,)
        Where outputs are known.
    least : float
        Norm there of a start's response whose norm is 1, from which it is determined.

    Returns
    -------
    states : array, shape (k, r)
    responses : array, shape (number of samples known, r)
        Orthonormal.
    """
    size = np.maximum(np.linalg.norm(free, axis=0), 1e-300)
    responses, spread, turned = np.linalg.svd(free / size, full_matrices=False)
    moved = spread > 1e-12 * spread[0]
    left, norms, right = np.linalg.svd(responses[np.ix_(counts, moved)], full_matrices=False)
    determined = norms > least
    states = (
        turned[moved].T @ (right[determined] / spread[moved]).T / norms[determined] / size[:, None]
    )
    return np.asarray(states), np.asarray(left[:, determined])
