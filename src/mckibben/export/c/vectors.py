"""Samples on which the exported code and the Python model are compared."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.laws.trial import input_limits, wander
from mckibben.errors import ModelError, ModelWarning

PACE, TURNS = 9, 24
"""Samples from one turning point to the next, and how many of those."""


@dataclass(frozen=True)
class Vectors:
    """Inputs, and outputs of the Python model.

    Parameters
    ----------
    inputs : array, shape (n, n_inputs)
        With minor loops and holds, in the range of the model.
    outputs : array, shape (n, n_outputs)
        Of the model, running free from its own start.
    """

    inputs: Array
    outputs: Array

    @property
    def ranges(self) -> Array:
        """Range of every output, or its size where it hardly moves; positive."""
        least = 1e-4 * np.abs(self.outputs).max(axis=0) + 1e-9
        return np.asarray(np.maximum(np.ptp(self.outputs, axis=0), least))


def vectors(
    block: Block, sample_time: float | None, *, single: bool = False, seed: int = 0
) -> Vectors:
    """Return test vectors of a model; in single precision, of inputs that it can hold.

    Raises
    ------
    ModelError
        If the model's outputs are not finite on them.
    """
    rng = np.random.default_rng(seed)
    inputs = wander(*input_limits(block), rng, PACE, TURNS)
    if single:
        inputs = inputs.astype(np.float32).astype(np.float64)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        outputs = block.simulate(inputs, sample_time=sample_time)
    if not np.isfinite(outputs).all():
        raise ModelError(
            f"{block.kind!r} gives outputs that are not finite on inputs within its range. "
            "Remedy: identify it again, or give it an input range."
        )
    return Vectors(inputs, outputs)
