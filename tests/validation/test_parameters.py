"""Standard errors hold where residuals remember: intervals of 95 % hold the truth 95 % of the time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import binom

from mckibben import PI, PIEstimator, Recording
from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.validation.parameters import parameters, residuals, sureness

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


def noise(seed: int, memory: float, n: int = SAMPLES, deviation: float = 0.1) -> Array:
    """Return noise that decays by a factor a sample, in its stationary state."""
    shocks = np.random.default_rng(seed).normal(0, deviation * np.sqrt(1 - memory**2), n + 500)
    return np.asarray(lfilter([1.0], [1.0, -memory], shocks))[500:]


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
        y = clean + noise(1000 + seed, memory)
        model = fitted(block, u, y)
        recording = Recording({"pressure": u, "displacement": y}, STEP)
        sure = sureness(model, [recording], residuals(model, [recording]))
        for one, true in zip(parameters(model, sure), truth.tolist(), strict=True):
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


def test_errors_grow_with_the_memory_of_residuals() -> None:
    block, u = MODELS["pi"][0], wave()
    found = []
    for memory in (0.0, 0.9):
        y = np.asarray(block.simulate(u)) + noise(1, memory)
        recording = Recording({"pressure": u, "displacement": y}, STEP)
        sure = sureness(block, [recording], residuals(block, [recording]))
        found.append(np.sqrt(np.diag(sure.covariance)))
        assert abs(sure.n_effective / (SAMPLES * (1 - memory) / (1 + memory)) - 1) < 0.3
    assert np.all(found[1] > 2 * found[0])


def test_what_is_not_determined_is_said_and_has_no_number() -> None:
    u = np.minimum(wave(), 2.0) * 0.1  # too little to move the operator of threshold 1.5
    block = MODELS["pi"][0]
    y = np.asarray(block.simulate(u, initial="virgin")) + noise(1, 0.0)
    still = PI(THRESHOLDS, (3.0, 1.5, 0.9, 0.5), 2.0, initial="virgin")
    recording = Recording({"pressure": u, "displacement": y}, STEP)
    sure = sureness(still, [recording], residuals(still, [recording]))
    found = parameters(still, sure)
    assert found[0].standard_error is not None
    assert found[3].standard_error is None
    assert found[3].interval is None


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_fits_and_descriptions_say_the_same(memory: float) -> None:
    block, u = MODELS["pi"][0], wave()
    y = np.asarray(block.simulate(u)) + noise(1, memory)
    recording = Recording({"pressure": u, "displacement": y}, STEP)
    fit = PIEstimator(thresholds=THRESHOLDS).fit(recording)
    model = fit.fitted
    sure = sureness(model, [recording], residuals(model, [recording]))
    told = np.sqrt(np.diag(sure.covariance))
    np.testing.assert_allclose(fit.diagnostics_.standard_errors, told, rtol=0.02)


def test_a_parameter_at_its_bound_has_no_error() -> None:
    u = wave()
    block = PI(THRESHOLDS, (3.0, 0.0, 1e-14, 0.5), 2.0)
    y = np.asarray(block.simulate(u)) + noise(1, 0.0)
    recording = Recording({"pressure": u, "displacement": y}, STEP)
    found = parameters(block, sureness(block, [recording], residuals(block, [recording])))
    none = [one.standard_error is None for one in found]
    assert none == [False, True, True, False, False]


def test_outputs_each_have_residuals_of_their_own() -> None:
    u = np.column_stack([wave(), steps()])
    names = ("pressure_1", "pressure_2"), ("displacement_1", "displacement_2")
    driven = tuple(Channel(name, "bar") for name in names[0])
    given = tuple(Channel(name, "mm") for name in names[1])
    block = Coupling(((2.0, 0.5), (0.3, 1.5)), driven, given)
    hits = []
    for seed in range(60):
        y = block.simulate(u) + np.column_stack([noise(seed, 0.8), 2 * noise(100 + seed, 0.0)])
        gains = np.linalg.lstsq(u, y, rcond=None)[0]
        model = block.unpack(gains.ravel())
        channels = dict(zip((*names[0], *names[1]), np.hstack([u, y]).T, strict=True))
        units = dict.fromkeys(names[0], "bar") | dict.fromkeys(names[1], "mm")
        recording = Recording(channels, STEP, units=units)
        sure = sureness(model, [recording], residuals(model, [recording]))
        own = np.sqrt(np.diag(sure.covariance))
        hits.append(np.abs(model.pack() - block.pack()) < sure.half_width * own)
    assert 0.88 <= np.mean(hits) <= 0.99
