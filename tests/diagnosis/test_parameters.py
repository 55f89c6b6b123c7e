"""Standard errors hold where residuals remember: intervals of 95 % hold the truth 95 % of the time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import binom

from mckibben import PI, Recording
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.diagnosis.description import describe
from tests.diagnosis.runs import noise

STEP, SAMPLES = 0.05, 3000

THRESHOLDS = (0.0, 0.3, 0.8, 1.5)

Input = Callable[[], Array]


def wave() -> Array:
    rng, t, u = np.random.default_rng(5), STEP * np.arange(SAMPLES), np.zeros(SAMPLES)
    for _ in range(6):
        size, rate, phase = rng.uniform((0.3, 0.02, 0.0), (1.0, 0.4, 6.3))
        u += size * np.sin(2 * np.pi * rate * t + phase)
    return 2.5 + 2.3 * u / np.abs(u).max()


def steps() -> Array:
    return np.repeat(np.random.default_rng(5).uniform(0.2, 4.8, SAMPLES // 10), 10)


def fitted(block: Block, u: Array, y: Array) -> Block:
    """Return the least squares fit of the free run, found by a search that is none of the package's."""
    start = block.pack()
    free = start != 0

    def at(x: Array) -> Array:
        moved = start.copy()
        moved[free] = x
        return moved

    def left(x: Array) -> Array:
        return np.asarray(block.unpack(at(x)).simulate(u, sample_time=STEP)) - y

    found = least_squares(
        left,
        start[free],
        x_scale=np.maximum(np.abs(start[free]), 0.05),
        bounds=(np.where(start[free] > 0, 1e-6, -np.inf), np.inf),
    )
    return block.unpack(at(found.x))


def covered(block: Block, u: Array, memory: float, seeds: int) -> tuple[int, int]:
    """Return how many intervals hold the true number, and how many there are."""
    truth = block.pack()
    clean = np.asarray(block.simulate(u, sample_time=STEP))
    hits = trials = 0
    for seed in range(seeds):
        y = clean + 0.1 * noise(SAMPLES, memory, 1000 + seed)
        model = fitted(block, u, y)
        recording = Recording({"pressure": u, "displacement": y}, STEP)
        found = describe(model, [recording]).parameters
        for one, true in zip(found, truth.tolist(), strict=True):
            if one.interval is not None:
                hits += one.interval[0] <= true <= one.interval[1]
                trials += 1
    return hits, trials


MODELS: dict[str, tuple[Block, Input, int]] = {
    "pi": (PI(THRESHOLDS, (3.0, 1.5, 0.9, 0.5), 2.0), wave, 25),
    "oe": (TransferFunction((0.9, -0.55), (-1.2, 0.25), STEP, 0.0, 2.0), steps, 25),
}


@pytest.mark.parametrize("memory", [0.0, 0.9])
@pytest.mark.parametrize("name", MODELS)
def test_intervals_hold_the_truth_as_often_as_they_say(name: str, memory: float) -> None:
    block, drive, seeds = MODELS[name]
    hits, trials = covered(block, drive(), memory, seeds)
    # parameters of one fit are not independent: as if only a fit counted, at 1 in 1000
    low = float(binom.ppf(5e-4, seeds, 0.95)) / seeds
    assert trials >= 3 * seeds
    assert low <= hits / trials < 1


def test_what_is_not_determined_is_said_and_has_no_number() -> None:
    u = np.minimum(wave(), 2.0) * 0.1  # too little to move the operator of threshold 1.5
    block = MODELS["pi"][0]
    y = np.asarray(block.simulate(u, initial="virgin")) + 0.1 * noise(SAMPLES, 0.0, 1)
    still = PI(THRESHOLDS, (3.0, 1.5, 0.9, 0.5), 2.0, initial="virgin")
    recording = Recording({"pressure": u, "displacement": y}, STEP)
    found = describe(still, [recording]).parameters
    assert found[0].standard_error is not None
    assert found[3].standard_error is None
    assert found[3].interval is None
