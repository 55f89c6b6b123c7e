"""Models described: every block, and criteria where residuals are white."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

from mckibben import Recording
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.laws.examples import examples
from mckibben.validation.describing import describe

STEP = 0.05
EXAMPLES = examples()
SPANS = {"bar": (0.2, 4.8), "mm": (1.0, 20.0), "N": (1.0, 30.0), "V": (0.0, 9.0)}

SAME_CHANNELS = [
    title
    for title, block in EXAMPLES.items()
    if {c.name for c in block.inputs} & {c.name for c in block.outputs}
]


def recorded(block: Block, n: int = 300, seed: int = 0) -> Recording:
    """Return a recording of a block's own answer to waves, with noise."""
    step = block.sample_time or STEP
    t, columns, units = np.arange(n) / n, {}, {}
    for place, channel in enumerate(block.inputs):
        low, high = SPANS.get(channel.unit, (0.05, 0.2))
        wave = 0.5 - 0.5 * np.cos(2 * np.pi * (6 + 2.3 * place) * t)
        columns[channel.name] = low + (high - low) * wave
        units[channel.name] = channel.unit
    inputs = np.column_stack(list(columns.values()))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outputs = np.asarray(block.simulate(inputs, sample_time=step)).reshape(n, -1)
    rng = np.random.default_rng(seed)
    for channel, y in zip(block.outputs, outputs.T, strict=True):
        columns[channel.name] = y + 0.01 * np.ptp(y) * rng.normal(size=n)
        units[channel.name] = channel.unit
    return Recording(columns, step, units=units)


@pytest.mark.parametrize("title", sorted(EXAMPLES.keys() - SAME_CHANNELS))
def test_every_block_is_described(title: str) -> None:
    block = EXAMPLES[title]
    found = describe(block, [recorded(block)])
    assert len(found.parameters) == block.n_parameters
    for one in found.parameters:
        assert (one.standard_error is None) == (one.interval is None) == bool(one.said)
        if one.standard_error is not None:
            assert one.standard_error > 0
    assert found.frequency_responses or found.describing_functions
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert told["parameters"][0]["name"] == found.parameters[0].name


def test_criteria_are_those_of_the_residuals_one_step_ahead() -> None:
    n, memory, rng = 3000, 0.9, np.random.default_rng(3)
    u = np.repeat(np.random.default_rng(5).uniform(0.2, 4.8, n // 10), 10)
    block = TransferFunction((0.4, 0.2), (-0.7,), STEP, noise_denominator=(-memory,))
    y = np.asarray(block.simulate(u, sample_time=STEP))
    y += lfilter([1.0], [1.0, -memory], rng.normal(0, 0.1, n))
    recording = Recording({"pressure": u, "displacement": y}, STEP)
    found = describe(block, [recording]).criteria
    assert found.fpe is not None
    assert found.aic is not None
    assert found.bic is not None
    assert abs(found.fpe / 0.01 - 1) < 0.1  # the variance of the shocks
    p = 4  # b_0, b_1, f_1 and d_1
    assert (found.n_samples, found.n_parameters) == (n, p)
    assert abs((found.bic - found.aic) - p * (np.log(n) - 2)) < 1e-9
    assert abs(found.aic / n - np.log(found.fpe)) < 1e-5
