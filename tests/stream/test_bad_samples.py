"""NaN, infinity and absurd sizes in a stream: it goes on as if they had not come."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import Block, DataError, ModelWarning
from mckibben.blocks.laws.examples import examples
from mckibben.blocks.laws.trial import input_limits, wander
from mckibben.blocks.running import Stream
from mckibben.registry import load

Array = NDArray[np.float64]

SAMPLE_TIME = 0.01
EXAMPLES = examples()
KINDS = list(EXAMPLES)
BAD = (np.nan, np.inf, -np.inf)


def path_for(block: Block, seed: int, n: int = 120) -> Array:
    """Return inputs over the block's range, shape (n, n_inputs)."""
    inputs = wander(*input_limits(block), np.random.default_rng(seed), 10, 14)
    return np.resize(inputs, (n, inputs.shape[1]))


def poisoned(good: Array, seed: int, missable: int = 0) -> tuple[Array, NDArray[np.bool_]]:
    """Return inputs with bad samples between the good ones, and which are good.

    The last ``missable`` inputs stay as they are: one that is missing makes no bad sample.
    """
    rng = np.random.default_rng(seed)
    kept = rng.random(2 * len(good)) < 0.5
    kept[0] = False  # before anything has come
    n = len(good) + int((~kept).sum())
    kept = np.concatenate([kept, np.ones(n, dtype=bool)])[:n]
    kept[np.flatnonzero(kept)[len(good) :]] = False
    inputs = np.empty((n, good.shape[1]))
    inputs[kept] = good[: kept.sum()]
    inputs[~kept] = good[rng.integers(0, len(good), (~kept).sum())]
    for row in np.flatnonzero(~kept):
        inputs[row, rng.integers(good.shape[1] - missable)] = rng.choice(BAD)
    return inputs, kept


def streamed(stream: Stream, inputs: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return the outputs, the memory after every step, and the statuses."""
    outputs, states, statuses = [], [], []
    for row in inputs:
        outputs.append(stream.step(row).copy())
        states.append(stream.state.copy())
        statuses.append(stream.status)
    return np.array(outputs), np.array(states), np.array(statuses)


@pytest.mark.parametrize("kind", KINDS)
def test_bad_samples_change_nothing(kind: str) -> None:
    block = EXAMPLES[kind]
    inputs, kept = poisoned(path_for(block, 1), 2, block.n_missable)
    outputs, states, statuses = streamed(block.stream(SAMPLE_TIME), inputs)
    expected, memory, good = streamed(block.stream(SAMPLE_TIME), inputs[kept])
    assert not good.any()
    np.testing.assert_array_equal(statuses, np.where(kept, Stream.GOOD, Stream.BAD_INPUT))
    np.testing.assert_array_equal(outputs[kept], expected)
    np.testing.assert_array_equal(states[kept], memory)
    last = np.maximum.accumulate(np.where(kept, np.arange(len(kept)), -1))
    held = np.where(last[:, np.newaxis] < 0, 0.0, outputs[last])
    np.testing.assert_array_equal(outputs, held)
    np.testing.assert_array_equal(states[1:][~kept[1:]], states[:-1][~kept[1:]])


@pytest.mark.parametrize("kind", KINDS)
def test_absurd_sizes_give_finite_outputs(kind: str) -> None:
    block = EXAMPLES[kind]
    for size in (1e308, -1e308, 1e154, 5e-324):
        rng, inputs = np.random.default_rng(6), path_for(block, 5, 60).copy()
        for row in range(0, len(inputs), 4):  # the first sample too
            inputs[row, rng.integers(inputs.shape[1])] = size
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", (ModelWarning, RuntimeWarning))
            outputs, _, statuses = streamed(block.stream(SAMPLE_TIME), inputs)
        assert np.isfinite(outputs).all()
        assert not (statuses == Stream.BAD_INPUT).any()


@pytest.mark.parametrize("kind", KINDS)
def test_a_whole_recording_with_nan_is_refused(kind: str) -> None:
    block = EXAMPLES[kind]
    inputs, _ = poisoned(path_for(block, 7, 20), 8)
    with pytest.raises(DataError):
        block.simulate(inputs, sample_time=SAMPLE_TIME)


def test_what_is_no_sample_is_refused_and_changes_nothing() -> None:
    block = load("blocks", "pi").example()
    stream, plain = block.stream(), block.stream()
    wrongs: list[Any] = [[1.0, 2.0], "two", 10**400, [[1.0], [2.0]], {}, []]
    for value in (1.0, 3.0, 2.0):
        for wrong in wrongs:
            with pytest.raises(DataError, match="pressure"):
                stream.step(wrong)
        assert stream.step(value)[0] == plain.step(value)[0]
