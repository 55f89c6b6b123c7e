"""One absurd sample leaves no trace: a law over all exported models, in both precisions."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import Block
from mckibben.blocks.base import Stream
from tests.export.building import SAMPLE_TIME, Compiled, Precision, build
from tests.export.models import MODELS, path_for
from tests.tools import needs

pytestmark = [pytest.mark.long, needs("cc")]

Array = NDArray[np.float64]
Builds = dict[Precision, dict[str, Compiled]]

GLITCHES = (1e6, -1e6, 1e30, np.nan, np.inf, -np.inf)
SAMPLES, SECOND = 600, round(1.0 / SAMPLE_TIME)
TIMES = (37, 211, 398)
"""Of glitches; at least a second before the end."""

WITHIN, FADED = 1.0, 0.1
"""Largest difference from the clean run at any time, and after a second, relative to the range: where
friction reverses, even a sensor that repeats one sample makes that.
"""

GONE: dict[Precision, float] = {"double": 1e-9, "float32": 1e-4}
"""After a second, of what does not depend on the rate: rounding."""


@pytest.fixture(scope="module")
def builds(tmp_path_factory: pytest.TempPathFactory) -> Builds:
    precisions: tuple[Precision, ...] = ("double", "float32")
    return {each: build(MODELS, each, tmp_path_factory.mktemp(each)) for each in precisions}


def glitched(inputs: Array, column: int, time: int, value: float) -> Array:
    found = inputs.copy()
    found[time, column] = value
    return found


def replaced(block: Block, inputs: Array, column: int, time: int) -> Array:
    """Return inputs whose one value is the last one, or is missing where it may be."""
    missable = column >= len(block.inputs) - block.n_missable
    return glitched(inputs, column, time, np.nan if missable else inputs[time - 1, column])


@pytest.mark.parametrize("precision", ["double", "float32"])
@pytest.mark.parametrize("name", MODELS)
def test_a_glitch_is_held_and_leaves_no_trace(
    name: str, precision: Precision, builds: Builds
) -> None:
    """To the bit as if its sensor had repeated itself, which no other sample could tell."""
    block, model = MODELS[name], builds[precision][name]
    inputs = path_for(block, 3, SAMPLES)

    def run(given: Array) -> tuple[Array, NDArray[np.int64]]:
        model.reset()
        return model.run(given)

    for column in range(inputs.shape[1]):
        for time in TIMES:
            expected, good = run(replaced(block, inputs, column, time))
            for value in GLITCHES:
                outputs, statuses = run(glitched(inputs, column, time, value))
                missing = np.isnan(value) and column >= len(block.inputs) - block.n_missable
                fault = np.arange(SAMPLES) == time
                np.testing.assert_array_equal(
                    statuses, good + Stream.BAD_INPUT * (fault & (not missing))
                )
                np.testing.assert_array_equal(outputs, expected)
                assert np.isfinite(outputs).all()


def slow(block: Block) -> Array:
    """Return a motion in which one sample more or less is a small change."""
    if block.rate_dependent:
        return path_for(block, 3, SAMPLES)
    few = path_for(block, 3, SAMPLES // 10)
    places = np.arange(SAMPLES) / 10
    return np.column_stack([np.interp(places, np.arange(len(few)), column) for column in few.T])


@pytest.mark.parametrize("precision", ["double", "float32"])
@pytest.mark.parametrize("name", MODELS)
def test_a_second_later_outputs_are_those_of_the_clean_run(
    name: str, precision: Precision, builds: Builds
) -> None:
    """Of hysteresis alone at once; of what depends on the rate as it fades."""
    block, model = MODELS[name], builds[precision][name]
    inputs = slow(block)
    model.reset()
    clean, _ = model.run(inputs)
    span = np.ptp(clean, axis=0) + 1e-6 * np.abs(clean).max(axis=0) + 1e-300
    for column in range(inputs.shape[1]):
        for time in TIMES:
            model.reset()
            outputs, _ = model.run(glitched(inputs, column, time, 1e30))
            off = np.abs(outputs - clean) / span
            assert off.max() <= WITHIN
            assert off[time + SECOND :].max() <= (
                FADED if block.rate_dependent else GONE[precision]
            )


@pytest.mark.parametrize("name", MODELS)
def test_python_gives_the_same_statuses(name: str, builds: Builds) -> None:
    """And numbers as near as on good inputs."""
    block, model = MODELS[name], builds["double"][name]
    inputs = path_for(block, 4, SAMPLES)
    rng = np.random.default_rng(len(name))
    for row in range(5, SAMPLES, 40):
        inputs[row, rng.integers(inputs.shape[1])] = rng.choice(GLITCHES)
    model.reset()
    outputs, statuses = model.run(inputs)
    stream = block.stream(SAMPLE_TIME)
    expected, found = np.empty_like(outputs), np.empty_like(statuses)
    for row, sample in enumerate(inputs):
        expected[row], found[row] = stream.step(sample), stream.status
    np.testing.assert_array_equal(statuses, found)
    span = np.ptp(expected, axis=0) + 1e-6 * np.abs(expected).max(axis=0) + 1e-300
    assert (np.abs(outputs - expected) / span).max() <= 1e-9
