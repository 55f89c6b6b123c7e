"""NaN, infinity and absurd sizes in a stream: the last good value is held, and nothing else changes."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import Block, DataError, ModelWarning
from mckibben.blocks.base import Stream
from mckibben.blocks.laws import examples, trial_limits, wander
from mckibben.registry import load
from tests.refusals import refused

Array = NDArray[np.float64]

SAMPLE_TIME = 0.01
EXAMPLES = examples()
KINDS = list(EXAMPLES)
BAD = (np.nan, np.inf, -np.inf, 1e6, -1e6, 1e30, 1e308)


def path_for(block: Block, seed: int, n: int = 120) -> Array:
    """Return inputs over the block's range, shape (n, n_inputs)."""
    inputs = wander(*trial_limits(block), np.random.default_rng(seed), 10, 14)
    return np.resize(inputs, (n, inputs.shape[1]))


def poisoned(good: Array, seed: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return inputs with bad values in about a tenth of the samples, and which values are bad."""
    rng = np.random.default_rng(seed)
    bad = np.zeros(good.shape, dtype=bool)
    rows = np.flatnonzero(rng.random(len(good)) < 0.1)
    bad[rows, rng.integers(good.shape[1], size=rows.size)] = True
    bad[0] = False
    return np.where(bad, rng.choice(BAD, good.shape), good), bad


def streamed(stream: Stream, inputs: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return the outputs, the memory after every step, and the statuses."""
    outputs, states, statuses = [], [], []
    for row in inputs:
        outputs.append(stream.step(row).copy())
        states.append(stream.state.copy())
        statuses.append(stream.status)
    return np.array(outputs), np.array(states), np.array(statuses)


def held(block: Block, inputs: Array, bad: NDArray[np.bool_]) -> Array:
    """Return inputs with the last good value in place of bad ones; NaN where it may be missing."""
    last = np.maximum.accumulate(np.where(bad, -1, np.arange(len(inputs))[:, np.newaxis]))
    found = np.take_along_axis(inputs, last, axis=0)
    missable = np.arange(inputs.shape[1]) >= inputs.shape[1] - block.n_missable
    return np.where(bad & missable, np.nan, found)


@pytest.mark.parametrize("kind", KINDS)
def test_bad_values_are_held(kind: str) -> None:
    block = EXAMPLES[kind]
    inputs, bad = poisoned(path_for(block, 1), 2)
    outputs, states, statuses = streamed(block.stream(SAMPLE_TIME), inputs)
    expected, memory, good = streamed(block.stream(SAMPLE_TIME), held(block, inputs, bad))
    assert not (good & Stream.BAD_INPUT).any()
    missing = np.isnan(inputs)  # which is no fault where it is allowed
    missing[:, : inputs.shape[1] - block.n_missable] = False
    faults = (bad & ~missing).any(axis=1)
    np.testing.assert_array_equal(statuses, good + Stream.BAD_INPUT * faults)
    np.testing.assert_array_equal(outputs, expected)
    np.testing.assert_array_equal(states, memory)


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_happens_before_the_first_good_sample(kind: str) -> None:
    block, bad = EXAMPLES[kind], np.full((3, len(EXAMPLES[kind].inputs)), 1e30)
    inputs = path_for(block, 3, 20)
    stream, plain = block.stream(SAMPLE_TIME), block.stream(SAMPLE_TIME)
    outputs, _, statuses = streamed(stream, bad)
    assert not outputs.any()
    assert (statuses == Stream.BAD_INPUT).all()
    np.testing.assert_array_equal(streamed(stream, inputs)[0], streamed(plain, inputs)[0])


@pytest.mark.parametrize("kind", KINDS)
def test_sizes_just_within_bounds_give_finite_outputs(kind: str) -> None:
    block = EXAMPLES[kind]
    bounds = block.input_bounds
    rng, inputs = np.random.default_rng(6), path_for(block, 5, 60).copy()
    for row in range(0, len(inputs), 4):  # the first sample too
        column = rng.integers(inputs.shape[1])
        inputs[row, column] = rng.choice(bounds[column])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", (ModelWarning, RuntimeWarning))
        outputs, _, statuses = streamed(block.stream(SAMPLE_TIME), inputs)
    assert np.isfinite(outputs).all()
    assert not (statuses & Stream.BAD_INPUT).any()


@pytest.mark.parametrize("kind", KINDS)
def test_motions_within_the_range_and_a_fifth_beyond_pass(kind: str) -> None:
    block = EXAMPLES[kind]
    low, high = trial_limits(block)
    ends = np.array([low - 0.2 * (high - low), high + 0.2 * (high - low)])
    bounds = block.input_bounds
    assert (bounds[:, 0] <= ends[0]).all()
    assert (ends[1] <= bounds[:, 1]).all()


@pytest.mark.parametrize("kind", [kind for kind in KINDS if EXAMPLES[kind].clip_counts])
def test_every_clipped_sample_has_the_status(kind: str) -> None:
    """The statuses of a stream are as many as `Block.n_clipped` of a run counts."""
    block = EXAMPLES[kind]
    low, high = trial_limits(block)
    inputs = low + (path_for(block, 9) - low) * 1.4 - 0.2 * (high - low)
    stream = block.stream(SAMPLE_TIME)
    _, _, statuses = streamed(stream, inputs)
    assert not (statuses & Stream.BAD_INPUT).any()
    assert ((statuses & Stream.CLIPPED) > 0).sum() == block.n_clipped(stream.state)


@pytest.mark.parametrize("kind", KINDS)
def test_a_whole_recording_with_nan_is_refused(kind: str) -> None:
    block = EXAMPLES[kind]
    inputs = path_for(block, 7, 20)
    inputs[5, 0] = np.nan
    with pytest.raises(DataError):
        block.simulate(inputs, sample_time=SAMPLE_TIME)


def test_what_is_no_sample_is_refused_and_changes_nothing() -> None:
    block = load("blocks", "pi").example()
    stream, plain = block.stream(), block.stream()
    wrongs: list[Any] = [[1.0, 2.0], "two", 10**400, [[1.0], [2.0]], {}, []]
    for value in (1.0, 3.0, 2.0):
        for wrong in wrongs:
            with refused(DataError, names="pressure"):
                stream.step(wrong)
        assert stream.step(value)[0] == plain.step(value)[0]
