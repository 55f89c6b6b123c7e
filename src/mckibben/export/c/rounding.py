"""What rounding to single precision does to linear filters with slow poles."""

from __future__ import annotations

import warnings

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.laws.trial import input_limits, wander
from mckibben.errors import ModelWarning

NOTICED = 5e-5
"""Relative to the range of the output."""

SAMPLES, MOST_PRODUCTS = 100_000, 30_000_000
"""Fewer samples of filters with very many states."""


def warn_of_rounding(block: Block, sample_time: float | None) -> None:
    """Warn of a filter that single precision would lead astray, with a figure.

    The same kernel is run on single and on double precision numbers.
    """
    if not (block.filters and hasattr(block, "kernel")):
        return
    rng = np.random.default_rng(0)
    samples = min(SAMPLES, MOST_PRODUCTS // max(block.n_states, 1))
    inputs = wander(*input_limits(block), rng, 400, samples // 400)
    single = _run(block, inputs.astype(np.float32), sample_time)
    double = _run(block, inputs.astype(np.float32).astype(np.float64), sample_time)
    off = float(np.abs(single - double).max() / max(np.ptp(double), 1e-300))
    if not off <= NOTICED:
        warnings.warn(
            f"in single precision {block.kind!r} is off by about {off:.1g} of its range: its poles are "
            "slow for this sample time. Export it in double precision, or with a longer sample time",
            ModelWarning,
            stacklevel=2,
        )


def _run(block: Block, inputs: np.ndarray, sample_time: float | None) -> np.ndarray:
    kind = inputs.dtype
    state = block.initial_state(inputs[0].astype(np.float64)).astype(kind)
    outputs = np.empty((len(inputs), 1), dtype=kind)
    block.kernel.batch(block.coefficients(sample_time).astype(kind), state, inputs, outputs)
    return outputs.astype(np.float64)
