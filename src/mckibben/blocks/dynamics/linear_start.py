"""Starts of linear dynamic models: the state that explains measured outputs best.

What a state before the first sample adds to the output of a linear model is linear in it, so the best
state is solved for. A block whose `initial` is "fitted" is started so wherever outputs are known: on the
recordings it is identified from, as `simulate` is given them, and, up to where the known outputs end, in
comparisons. Where no outputs are known, as in streams and in generated code, it starts at rest at the
first input.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import FittedInitial, Initial
from mckibben.recording import Recording

Mask = NDArray[np.bool_]

KNOWN = 0.5
"""Least norm, where outputs are known, of a start's response whose norm is 1, to solve for it."""


class LinearStart(Block):
    """A block, linear about an operating point, whose first states can be solved for."""

    initial: FittedInitial
    input_offset: float
    output_offset: float

    @property
    @abstractmethod
    def n_free(self) -> int:
        """How many states, the first ones, are its own; the others hold past inputs."""

    def start_on(self, recording: Recording, initial: Initial | None = None) -> Initial | None:
        """Return the state that explains the recording's outputs best, where that is the rule."""
        rule = self.initial if initial is None else initial
        name = self.outputs[0].name
        if rule != "fitted" or name not in recording:
            return initial
        if recording.units[name] != self.outputs[0].unit:
            return initial
        inputs = self._inputs_from(recording)
        state = self.fitted_state(inputs, recording[name], recording.sample_time)
        return state.tolist()

    def fitted_state(
        self, inputs: Array, outputs: Array, sample_time: float | None, counts: Mask | None = None
    ) -> Array:
        """Return the state before the first sample with the least squared error, shape (n_states,).

        Rest, in what the known outputs do not tell of it: where the first ones are not known, a start
        that has died away before the others would be made up of their noise.

        Parameters
        ----------
        inputs : array, shape (n, 1)
        outputs : array, shape (n,)
        sample_time : float or None
        counts : array of bool, shape (n,), optional
            Where outputs are known; default everywhere.
        """
        counts = np.ones(len(inputs), dtype=bool) if counts is None else counts
        state = self.initial_state(inputs[0], "first_sample")
        at_rest = np.empty((len(inputs), 1))
        self.bind(sample_time, state.copy(), inputs, at_rest)()
        free = self.free_responses(len(inputs), sample_time)
        state[: self.n_free] += told_by(free, outputs - at_rest[:, 0], counts)
        return state

    def free_responses(self, n: int, sample_time: float | None) -> Array:
        """Return what a unit of every free state adds to the output, shape (n, n_free)."""
        inputs, outputs = np.full((n, 1), self.input_offset), np.empty((n, 1))
        columns = np.empty((n, self.n_free))
        for place in range(self.n_free):
            state = np.zeros(self.n_states)
            state[place] = 1.0
            self.bind(sample_time, state, inputs, outputs)()
            columns[:, place] = outputs[:, 0] - self.output_offset
        return columns


def told_by(free: Array, left: Array, counts: Mask) -> Array:
    """Return how much of every free response explains best what is left, as far as that tells, (k,).

    Parameters
    ----------
    free : array, shape (n, k)
        What a unit of every state adds to the output.
    left : array, shape (n,)
        What is to be explained.
    counts : array of bool, shape (n,)
        Where that is known.
    """
    if not free.shape[1] or not np.isfinite(left[counts]).all():
        return np.zeros(free.shape[1])
    states, seen = known_starts(free, counts)
    return np.asarray(states @ (seen.T @ left[counts]))


def known_starts(free: Array, counts: Mask, least: float = KNOWN) -> tuple[Array, Array]:
    """Return the starts that known outputs tell of, each with what it adds where they are known.

    Parameters
    ----------
    free : array, shape (n, k)
        What a unit of every state adds to the output.
    counts : array of bool, shape (n,)
        Where outputs are known.
    least : float
        Norm there of a start's response whose norm is 1, from which it is told of.

    Returns
    -------
    states : array, shape (k, r)
    seen : array, shape (number of samples known, r)
        Of length 1, and at right angles to one another.
    """
    size = np.maximum(np.linalg.norm(free, axis=0), 1e-300)
    responses, spread, turned = np.linalg.svd(free / size, full_matrices=False)
    moved = spread > 1e-12 * spread[0]
    seen, known, v = np.linalg.svd(responses[np.ix_(counts, moved)], full_matrices=False)
    told = known > least
    states = turned[moved].T @ (v[told] / spread[moved]).T / known[told] / size[:, None]
    return np.asarray(states), np.asarray(seen[:, told])
