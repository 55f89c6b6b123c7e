"""What golden cases do with a model: run it, stream it, invert it; and how a run is stored."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben import Block, ModelError, ModelWarning
from tests.golden.case import Tree

Array = NDArray[np.float64]

SAMPLE_TIME = 0.01

EXACT_INVERSE = 1e-9
"""How far a model behind its inverse may be from its reference, relative to the reference's span."""


def simulated(model: Block, inputs: Array, initial: Any = None) -> Array:
    """Return outputs, shape (n, n_outputs); warnings of what was clipped are not looked at."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return model.simulate(inputs, initial=initial, sample_time=model.sample_time or SAMPLE_TIME)


def streamed(model: Block, inputs: Array) -> Array:
    """Return outputs, found sample by sample."""
    stream = model.stream(SAMPLE_TIME)
    return np.array([stream.step(row).copy() for row in inputs])


def same(first: Array, second: Array) -> bool:
    """Tell whether two arrays are equal to the bit."""
    return first.shape == second.shape and first.tobytes() == second.tobytes()


def stored(run: Array, every: int) -> dict[str, Tree]:
    """Return every so many samples of a run, and the sum of the magnitudes of all, of each channel."""
    return {"samples": run[::every], "sums": [math.fsum(np.abs(column)) for column in run.T]}


def refused(error: Exception) -> dict[str, Tree]:
    """Return the class of an error: its words are not stored."""
    return {"refused": type(error).__name__}


def inverse_of(model: Block) -> Block | None:
    """Return the inverse of a model, None where it has none."""
    try:
        return model.inverse()
    except ModelError:
        return None


def scheduling_of(model: Block, inputs: Array) -> Array:
    """Return those of a model's inputs that its inverse takes, too."""
    return inputs[:, len(model.inputs) - len(model.scheduling) :]


def inverted(model: Block, given: Array, every: int) -> Tree:
    """Return commands of a model's inverse, and whether the model then follows the references.

    ``given`` has the references, then what schedules. Outputs that come late are compared with what
    was asked for before; nothing is compared where the inverse warns that it had to clip.
    """
    try:
        inverse = model.inverse()
    except ModelError as error:
        return refused(error)
    n, late = len(model.outputs), round(model.dead_time / SAMPLE_TIME)
    with warnings.catch_warnings(record=True) as clipped:
        warnings.simplefilter("always", ModelWarning)
        commands = inverse.simulate(given, sample_time=SAMPLE_TIME)
    followed = simulated(model, np.column_stack([commands, given[:, n:]]))
    wanted = given[: len(given) - late, :n]
    apart = np.abs(followed[late:] - wanted).max() / np.ptp(wanted, axis=0).min()
    return {
        "commands": stored(commands, every),
        "stream is batch": same(streamed(inverse, given), commands),
        "exact": "clipped" if clipped else bool(apart <= EXACT_INVERSE),
        "reachable": np.array(inverse.reachable()),
    }
