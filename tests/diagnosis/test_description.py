"""Models described: every block, with the standard errors of a fit."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

import mckibben
from mckibben import Recording
from mckibben.blocks.base import Block
from mckibben.blocks.laws import examples
from mckibben.diagnosis.description import describe
from mckibben.estimators.hysteresis.loops import BoucWenEstimator
from mckibben.estimators.hysteresis.pi import PIEstimator

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
        assert (one.standard_error is None) == (one.interval is None) == (one.status != "estimated")
        if one.standard_error is not None:
            assert one.standard_error > 0
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert told["parameters"][0]["name"] == found.parameters[0].name


def test_standard_errors_are_those_of_the_fit() -> None:
    train = mckibben.read(mckibben.example.TRAIN)
    for estimator in (PIEstimator(), BoucWenEstimator()):
        estimator.fit(train)
        told = np.array(
            [
                np.nan if one.standard_error is None else one.standard_error
                for one in describe(estimator.model_, train).parameters
            ]
        )
        errors = np.array(estimator.diagnostics_.standard_errors)
        both = np.isfinite(told) & np.isfinite(errors)
        assert both.sum() >= 3
        assert told[both] == pytest.approx(errors[both], rel=1e-6), estimator
