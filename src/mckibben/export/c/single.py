"""What single precision cannot hold of a model, and what it does to filters with slow poles."""

from __future__ import annotations

import warnings

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.laws.trial import input_limits, wander
from mckibben.errors import ModelError, ModelWarning

NOTICED = 5e-5
"""Relative to the range of the output."""

SAMPLES, MOST_PRODUCTS = 100_000, 30_000_000
"""Fewer samples of filters with very many states."""


def check_single(block: Block, sample_time: float | None) -> None:
    """Refuse what single precision cannot hold, and warn of a filter that it would lead astray.

    Raises
    ------
    ModelError
        If two knots, levels or thresholds that follow one another become one, or the block says that
        it needs more.
    """
    if block.needs_double:
        raise ModelError(
            f"{block.title!r} {block.needs_double}. Remedy: export in double precision."
        )
    for name, places in block.kept_apart():
        if np.any(np.diff(np.array(places, dtype=np.float32)) <= 0) and np.all(np.diff(places) > 0):
            raise ModelError(
                f"{name} of {block.title!r} are too close for single precision. "
                "Remedy: export in double precision, or identify with fewer of them."
            )
    if block.filters and hasattr(block, "kernel"):
        _warn_of_rounding(block, sample_time)


def _warn_of_rounding(block: Block, sample_time: float | None) -> None:
    """Run the same kernel on single and on double precision numbers."""
    rng = np.random.default_rng(0)
    samples = min(SAMPLES, MOST_PRODUCTS // max(block.n_states, 1))
    inputs = wander(*input_limits(block), rng, 400, samples // 400).astype(np.float32)
    single, double = (_run(block, inputs.astype(kind), sample_time) for kind in (np.float32, float))
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
