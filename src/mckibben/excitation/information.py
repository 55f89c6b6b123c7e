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
from mckibben.blocks.base import Block
from mckibben.blocks.jacobian import Complex, Tangents
from mckibben.estimators.core.uncertainty import LARGEST
from mckibben.excitation.unmodelled import Unmodelled

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
    """

    def __init__(self, block: Block, places: Sequence[int], step: float) -> None:
        self._tangents = Tangents(block, step, places)
        self._sizes = block.pack()[places]

    def start(self, first: Array) -> Complex:
        """Return the states before a first input, shape (parameters, n_states)."""
        return self._tangents.start(first)

    def over(self, inputs: Array, states: Complex) -> tuple[Array, Array, Complex]:
        """Return outputs (n, m) over a stretch, their slopes (n, m, parameters), and states after."""
        after = states.copy()
        outputs, slopes = self._tangents.over(inputs, after)
        with np.errstate(invalid="ignore", over="ignore"):
            slopes *= self._sizes
        slopes[~(np.abs(slopes) < LARGEST)] = 0.0
        return outputs, slopes, after


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
    """What is known: precisions of the parameters, of every member, and what pulls them aside.

    Parameters
    ----------
    members : sequence of arrays, shape (parameters, parameters)
    pulls : array, shape (m, parameters, features)
        How features of what is unmodelled, in ranges of each output, pull the likeliest parameters: over
        the precision they are what least squares makes of them.
    """

    members: tuple[Array, ...]
    pulls: Array

    def and_also(self, other: Known) -> Known:
        """Return what both tell."""
        pairs = zip(self.members, other.members, strict=True)
        return Known(tuple(a + b for a, b in pairs), self.pulls + other.pulls)

    def without(self, other: Known) -> Known:
        """Return what is told beside another, of which it is the sum."""
        pairs = zip(self.members, other.members, strict=True)
        return Known(tuple(a - b for a, b in pairs), self.pulls - other.pulls)

    def of_first(self) -> Known:
        """Return what is known if the first member is taken for true."""
        return Known(self.members[:1], self.pulls)


@dataclass(frozen=True)
class Place:
    """Where motion has come to: the last command, states of all members, memory of the unmodelled."""

    command: Array
    states: tuple[Complex, ...]
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
    shared : array, shape (m, parameters, features)
        How the unmodelled looks like parameters where it matters; None where it does not matter.
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
    shared: Array | None = None

    def start(self, command: Array) -> Place:
        """Return the place where all rests under a command."""
        first = np.ascontiguousarray(command[self.columns])
        states = tuple(member.start(first) for member in self.members)
        return Place(command, states, self.unmodelled.start(command))

    def over(self, commands: Array, place: Place) -> tuple[Known, Place]:
        """Return what a stretch of commands tells, and the place after."""
        inputs = np.ascontiguousarray(commands[:, self.columns])
        sure = np.sqrt(self.step / self.noise.density)
        told: list[Array] = []
        states: list[Complex] = []
        for member, before in zip(self.members, place.states, strict=False):
            _, slopes, after = member.over(inputs, before)
            if not told:
                first = slopes
            rows = (slopes * sure[:, np.newaxis]).reshape(-1, slopes.shape[2])
            told.append(rows.T @ rows)
            states.append(after)
        features, memory = self.unmodelled.features(commands, place.memory, self.step)
        pulls = crossed(first, features, self.step * self.spans / self.noise.density)
        return Known(tuple(told), pulls), Place(commands[-1], tuple(states), memory)

    def of_first(self) -> Criterion:
        """Return the criterion that takes the first member for true."""
        return replace(self, members=self.members[:1], weights=self.weights[:1])

    def weighed_by(self, stretches: Sequence[Array], place: Place) -> Criterion:
        """Return the criterion that weighs errors by what they do over some motion."""
        per_span = 1.0 / self.spans
        weights: list[Array] = [np.zeros((0, 0))] * len(self.members)
        states, memory, shared = list(place.states), place.memory, np.zeros(())
        n = sum(len(commands) for commands in stretches) * per_span.size
        for number, commands in enumerate(stretches):
            inputs = np.ascontiguousarray(commands[:, self.columns])
            features, memory = self.unmodelled.features(commands, memory, self.step)
            for i, member in enumerate(self.members):
                _, slopes, states[i] = member.over(inputs, states[i])
                rows = (slopes * per_span[:, np.newaxis]).reshape(-1, slopes.shape[2])
                part = rows.T @ rows / n
                weights[i] = part if number == 0 else weights[i] + part
                if i == 0:
                    shared = shared + crossed(slopes, features, per_span / n)
        return replace(self, weights=weights, shared=shared)

    def errors(self, known: Known) -> tuple[float, float]:
        """Return expected variances over the ranges: of parameters (geometric mean), and of shape.

        What is unmodelled pulls parameters to where the motion has been, so that they fit worse
        elsewhere: the bias of Box and Draper's designs, which is least where motion is like that over
        which the model is to predict.
        """
        left = [covariance(precision) for precision in known.members]
        logs = [
            np.log(max(float(np.sum(one * weight)), 1e-300))
            for one, weight in zip(left, self.weights, strict=True)
        ]
        bias = 0.0
        if self.shared is not None:
            pulled = left[0] @ known.pulls
            apart = pulled * (self.weights[0] @ pulled) - 2 * pulled * self.shared
            bias = self.noise.left**2 * max(1.0 + float(apart.sum()), 0.0)
        return float(np.exp(np.mean(logs))), bias

    def __call__(self, known: Known) -> float:
        """Return what is to be made small."""
        return sum(self.errors(known))


def crossed(slopes: Array, features: Array, weights: Array) -> Array:
    """Return sums over time of slopes (n, m, parameters), weighted by output, times features."""
    found: Array = np.moveaxis(slopes * weights[:, np.newaxis], 0, 2) @ features
    return found


def covariance(precision: Array) -> Array:
    """Return what a precision leaves, to rounding of parameters that act nearly alike."""
    size = np.sqrt(np.diag(precision))
    scaled = precision / np.outer(size, size) + ROUNDING * np.eye(size.size)
    whole: Array = cho_solve(cho_factor(scaled), np.eye(size.size))
    return whole / np.outer(size, size)


def standard_errors(precision: Array) -> Array:
    """Return the deviations that a precision leaves, shape (parameters,)."""
    return np.asarray(np.sqrt(np.diag(covariance(precision))))
