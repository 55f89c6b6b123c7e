"""What motion tells of a model: slopes of its free run, gathered stretch by stretch.

A free run remembers all before, so that each of the slightly moved models keeps its own state from the
end of one stretch to the beginning of the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.estimators.core.uncertainty import DIFFERENCE, LARGEST
from mckibben.excitation.unmodelled import LONG, Unmodelled

ROUNDING = 1e-10
"""Of precisions, over their own size."""


class Slopes:
    """How a block's free-running outputs move with its parameters, in units of their sizes.

    Parameters
    ----------
    block : Block
    places : sequence of int
        Of the parameters that are not fixed.
    step : float
        Sample time [s].
    length : int
        Samples of a stretch.
    """

    def __init__(self, block: Block, places: Sequence[int], step: float, length: int) -> None:
        values = block.pack()
        blocks = [block]
        for place in places:
            moved = values.copy()
            moved[place] += DIFFERENCE * values[place]
            blocks.append(block.unpack(moved))
        self._blocks = blocks
        self._inputs = np.empty((length, len(block.inputs)))
        self._outputs = np.empty((len(blocks), length, len(block.outputs)))
        self._states = np.empty((len(blocks), block.n_states))
        self._runs = [
            one.bind(step, self._states[i], self._inputs, self._outputs[i])
            for i, one in enumerate(blocks)
        ]

    def start(self, first: Array) -> Array:
        """Return the states before a first input, shape (parameters + 1, n_states)."""
        return np.array([block.initial_state(first) for block in self._blocks])

    def over(self, inputs: Array, states: Array) -> tuple[Array, Array, Array]:
        """Return outputs (n, m) over a stretch, their slopes (n, m, parameters), and states after."""
        self._inputs[:], self._states[:] = inputs, states
        for run in self._runs:  # too short for threads to be worth their while
            run()
        base = self._outputs[0].copy()
        with np.errstate(invalid="ignore", over="ignore"):
            slopes = (self._outputs[1:] - base) / DIFFERENCE
        slopes[~(np.abs(slopes) < LARGEST)] = 0.0
        return base, np.moveaxis(slopes, 0, 2), self._states.copy()


@dataclass(frozen=True)
class Noise:
    """What a model leaves of recordings.

    Parameters
    ----------
    density : array, shape (m,)
        Of every output, the variance that independent samples a second apart would have to have to tell
        as much.
    left : float
        What is no noise, but the model's own shape, over the outputs' ranges.
    """

    density: Array
    left: float


@dataclass(frozen=True)
class Known:
    """What is known: precisions of the parameters, of every member, and of the unmodelled.

    Parameters
    ----------
    members : sequence of arrays, shape (parameters, parameters)
    unmodelled : array, shape (features, features)
    """

    members: tuple[Array, ...]
    unmodelled: Array

    def and_also(self, other: Known) -> Known:
        """Return what both tell."""
        pairs = zip(self.members, other.members, strict=True)
        return Known(tuple(a + b for a, b in pairs), self.unmodelled + other.unmodelled)


@dataclass(frozen=True)
class Place:
    """Where motion has come to: the last command, states of all members, memory of the unmodelled."""

    command: Array
    states: tuple[Array, ...]
    memory: Array


@dataclass
class Criterion:
    """What a plan is to make small: the error of free runs over some motion, or of some parameters.

    Parameters
    ----------
    members : sequence of Slopes
        Of a few likely sets of parameters, the first the likeliest.
    unmodelled : Unmodelled
    noise : Noise
    step : float
        Sample time [s].
    spans : array, shape (m,)
        Ranges of the outputs.
    weights : sequence of arrays, shape (parameters, parameters)
        Of every member, how parameters' errors matter.
    shape : array, shape (features, features)
        How errors of the unmodelled matter.
    columns : array of int
        Which of the driven channels each of the block's inputs is.
    """

    members: Sequence[Slopes]
    unmodelled: Unmodelled
    noise: Noise
    step: float
    spans: Array
    columns: Array
    weights: Sequence[Array] = ()
    shape: Array | None = None

    def start(self, command: Array) -> Place:
        """Return the place where all rests under a command."""
        first = np.ascontiguousarray(command[self.columns])
        states = tuple(member.start(first) for member in self.members)
        return Place(command, states, self.unmodelled.start(command))

    def over(self, commands: Array, place: Place) -> tuple[Known, Place]:
        """Return what a stretch of commands tells, and the place after."""
        inputs = np.ascontiguousarray(commands[:, self.columns])
        sure = np.sqrt(self.step / self.noise.density)
        told, states = [], []
        for member, before in zip(self.members, place.states, strict=True):
            _, slopes, after = member.over(inputs, before)
            rows = (slopes * sure[:, np.newaxis]).reshape(-1, slopes.shape[2])
            told.append(rows.T @ rows)
            states.append(after)
        features, memory = self.unmodelled.features(commands, place.memory, self.step)
        of_shape = self.step / LONG * features.T @ features
        return Known(tuple(told), of_shape), Place(commands[-1], tuple(states), memory)

    def weighed_by(self, stretches: Sequence[Array], place: Place) -> Criterion:
        """Return the criterion that weighs errors by what they do over some motion."""
        per_span = 1.0 / self.spans
        weights: list[Array] = [np.zeros((0, 0))] * len(self.members)
        shape, states, memory = np.zeros((0, 0)), list(place.states), place.memory
        n = sum(len(commands) for commands in stretches)
        for number, commands in enumerate(stretches):
            inputs = np.ascontiguousarray(commands[:, self.columns])
            for i, member in enumerate(self.members):
                _, slopes, states[i] = member.over(inputs, states[i])
                rows = (slopes * per_span[:, np.newaxis]).reshape(-1, slopes.shape[2])
                part = rows.T @ rows / (n * per_span.size)
                weights[i] = part if number == 0 else weights[i] + part
            features, memory = self.unmodelled.features(commands, memory, self.step)
            part = features.T @ features / n
            shape = part if number == 0 else shape + part
        return replace(self, weights=weights, shape=shape)

    def errors(self, known: Known) -> tuple[float, float]:
        """Return expected variances over the ranges: of parameters (geometric mean), and of shape."""
        logs = [
            np.log(max(variance(precision, weight), 1e-300))
            for precision, weight in zip(known.members, self.weights, strict=True)
        ]
        shape = 0.0
        if self.shape is not None and self.noise.left > 0:
            whole = known.unmodelled + np.eye(len(known.unmodelled))
            shape = self.noise.left**2 * variance(whole, self.shape)
        return float(np.exp(np.mean(logs))), shape

    def __call__(self, known: Known) -> float:
        """Return what is to be made small."""
        return sum(self.errors(known))


def covariance(precision: Array) -> Array:
    """Return what a precision leaves, to rounding of parameters that act nearly alike."""
    size = np.sqrt(np.diag(precision))
    scaled = precision / np.outer(size, size) + ROUNDING * np.eye(size.size)
    whole: Array = cho_solve(cho_factor(scaled), np.eye(size.size))
    return whole / np.outer(size, size)


def variance(precision: Array, weight: Array) -> float:
    """Return the weighted sum of the variances that a precision leaves."""
    return float(np.sum(covariance(precision) * weight))


def standard_errors(precision: Array) -> Array:
    """Return the deviations that a precision leaves, shape (parameters,)."""
    return np.asarray(np.sqrt(np.diag(covariance(precision))))
