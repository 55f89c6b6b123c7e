"""Blocks and compositions to export, and paths of inputs over their ranges."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben import Block, ModelError, ModelWarning
from mckibben.blocks.adaptive import Adaptive
from mckibben.blocks.laws import examples, trial_limits, wander
from mckibben.registry import load
from tests.export.building import SAMPLE_TIME
from tests.golden.models import all_models, registered
from tests.golden.running import inverse_of

Array = NDArray[np.float64]


def example(kind: str) -> Any:
    return load("blocks", kind).example()


def models() -> dict[str, Block]:
    """Return examples of all kinds by title, and compositions and other starts; with inverses."""
    found, others = examples(), all_models()
    for name in others.keys() - registered().keys():
        found[name] = others[name]
        if inverse := inverse_of(found[name]):
            found[f"{name} inverse"] = inverse
    return {name: found[name] for name in sorted(found)}


MODELS = models()


def path_for(block: Block, seed: int, n: int) -> Array:
    """Return inputs with minor loops and holds over the block's range, shape (n, n_inputs)."""
    rng = np.random.default_rng(seed)
    pace = 200 if block.rate_dependent else 12
    inputs = wander(*trial_limits(block), rng, pace, max(n // pace, 3) + 2)
    inputs = np.resize(inputs, (n, inputs.shape[1]))
    if isinstance(block, Adaptive):
        # measured as on a plant that is 5 % off: of nonsense, rounding decides what is believed
        m = len(block.measured)
        inputs[1:, -m:] = 1.05 * inputs[:-1, :m] + 0.02 * rng.normal(size=(n - 1, m))
        inputs[0, -m:] = 1.05 * inputs[0, :m]
    return inputs


def nearby(block: Block, rng: np.random.Generator) -> Block:
    """Return a block of other parameters, as far as they make one."""
    parameters = block.pack()
    for size in (0.1, 0.03, 0.01, 0.0):
        try:
            return block.unpack(parameters * (1 + size * rng.uniform(-1, 1, parameters.size)))
        except ModelError:
            continue
    return block


def simulated(block: Block, inputs: Array) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return block.simulate(inputs, sample_time=SAMPLE_TIME)


def difference(outputs: Array, expected: Array) -> float:
    """Return the largest difference, relative to the range of each output."""
    span = np.ptp(expected, axis=0) + 1e-6 * np.abs(expected).max(axis=0) + 1e-300
    return float((np.abs(outputs - expected) / span).max())
