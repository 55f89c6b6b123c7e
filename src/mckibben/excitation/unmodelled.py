"""What no parameter says: what a model's own shape leaves, and how it pulls parameters aside.

A model leaves something, which is taken for a smooth random function of where inputs are, where they
have been of late, and how they came there (a Gaussian process by random features). Least squares takes
it for parameters where it looks like them. So a plan does not stay at the few places that would tell the
parameters of a model that is true, because none is: what is fitted there predicts badly elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from mckibben.arrays import Array

FEATURES, MOST = 30, 150
"""For every dimension of the memory, and in all."""

REACH = 0.35
"""Length over which the function changes, of the range, in three dimensions."""

LATE, SHORT = 2.0, 0.3
"""Times over which it remembers where inputs have been, and over which it knows how fast they go [s]."""

WIDTH = 0.15
"""Of the play that tells how they came, of the range."""


@dataclass(frozen=True)
class Unmodelled:
    """Random features of inputs and their memory.

    Parameters
    ----------
    low, span : array, shape (channels,)
        Of inputs.
    quickest : array, shape (channels,)
        How far the input is before its short mean at its highest rate, over its span.
    directions : array, shape (4 channels, features)
    phases : array, shape (features,)
    """

    low: Array
    span: Array
    quickest: Array
    directions: Array
    phases: Array

    @classmethod
    def of(cls, low: Array, high: Array, rate: Array, rng: np.random.Generator) -> Unmodelled:
        """Return features for inputs between ends, at some rates; those that are held tell nothing."""
        moving = np.tile(high > low, 4)
        n = int(moving.sum())
        reach = REACH * np.sqrt(max(n, 1) / 3)
        size = min(FEATURES * max(n, 1), MOST)
        directions = rng.standard_normal((moving.size, size)) / reach
        directions[~moving] = 0.0
        phases = rng.uniform(0, 2 * np.pi, directions.shape[1])
        span = np.where(high > low, high - low, 1.0)
        return cls(low, span, rate * SHORT / span, directions, phases)

    def start(self, first: Array) -> Array:
        """Return the memory of inputs that have long been somewhere, shape (3, channels)."""
        share = (first - self.low) / self.span
        return np.array([share, share, share])

    def features(self, inputs: Array, memory: Array, step: float) -> tuple[Array, Array]:
        """Return features over inputs, shape (n, features), and the memory after them."""
        share = (inputs - self.low) / self.span
        late, short = (
            _mean(share, before, step / t)
            for before, t in zip(memory[:2], (LATE, SHORT), strict=True)
        )
        play = np.empty_like(share)
        for column in range(share.shape[1]):
            here, path = float(memory[2, column]), []
            for value in share[:, column].tolist():
                here = min(max(here, value - WIDTH), value + WIDTH)
                path.append(here)
            play[:, column] = path
        # a reversal takes the play from one side to the other: as far as the whole range
        known = np.hstack(
            [share, late, (play - share) / (2 * WIDTH), 0.5 * (share - short) / self.quickest]
        )
        found = np.sqrt(2 / self.phases.size) * np.cos(known @ self.directions + self.phases)
        return found, np.array([late[-1], short[-1], play[-1]])


def _mean(share: Array, before: Array, step: float) -> Array:
    """Return the mean that fades, from where it was before."""
    keep = np.exp(-step)
    found: Array = lfilter([1 - keep], [1, -keep], share, axis=0, zi=keep * before[np.newaxis])[0]
    return found
