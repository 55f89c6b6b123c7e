"""Derivatives by complex step, over all blocks, against differences where outputs are smooth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import ModelError
from mckibben.blocks import derivatives as module
from mckibben.blocks.base import Block
from mckibben.blocks.complex_step import twin
from mckibben.blocks.derivatives import Tangents, derivatives
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.laws import trial_limits, wander
from mckibben.registry import load, names
from mckibben.system.compiling import deferred
from tests.refusals import refused

Array = NDArray[np.float64]

TIME, CHANGE = 0.01, 1e-3
"""Between samples [s]; of a parameter, relative."""

SMOOTH, TOLERANCE, FELT = 1e-7, 1e-5, 1e-6
"""Relative to the largest derivative: how near extrapolated differences are to one another where outputs
are smooth, and to derivatives there, beside kinks that they step over; and share of the outputs' range
below which a relative change of a parameter moves nothing but rounding."""


def both_ways(kind: str) -> Iterator[Block]:
    block = load("blocks", kind).example()
    yield block
    if isinstance(block, Invertible):
        try:
            yield block.inverse()
        except ModelError:
            return


def path(block: Block) -> Array:
    return wander(*trial_limits(block), np.random.default_rng(1), 12, 8)


def extrapolated(block: Block, inputs: Array, place: int) -> tuple[Array, Array]:
    """Return central differences extrapolated to none, and how far they are from the last ones."""
    values = block.pack()
    size = abs(values[place]) or 1.0

    def sloped(change: float) -> Array:
        ends = []
        for way in (-change, change):
            moved = values.copy()
            moved[place] += way * size
            ends.append(block.unpack(moved).simulate(inputs, sample_time=TIME))
        return np.asarray((ends[1] - ends[0]) / (2 * change * size))

    wide, near, nearest = (sloped(CHANGE / 2**k) for k in range(3))
    first, second = (4 * near - wide) / 3, (4 * nearest - near) / 3
    return (16 * second - first) / 15, np.abs(second - first)


@pytest.mark.parametrize("kind", names("blocks"))
@pytest.mark.filterwarnings("ignore")
def test_derivatives_are_those_of_extrapolated_differences(kind: str) -> None:
    for block in both_ways(kind):
        inputs = path(block)
        outputs = block.simulate(inputs, sample_time=TIME)
        span = np.ptp(outputs, axis=0).max()
        same, slopes = Tangents(block, TIME).over(inputs)
        np.testing.assert_allclose(same, outputs, rtol=0, atol=1e-12 * max(span, 1e-9))
        smooth = []
        for place, value in enumerate(block.pack().tolist()):
            try:
                expected, unsure = extrapolated(block, inputs, place)
            except ModelError:  # one side is no such model
                continue
            size = max(np.abs(expected).max(), FELT * span / (abs(value) or 1.0))
            here = unsure <= SMOOTH * size
            smooth.append(here.mean())
            error = np.abs(slopes[:, :, place] - expected)[here]
            assert (error <= TOLERANCE * size).all(), (block.title, place, error.max() / size)
        assert not smooth or np.mean(smooth) > 0.3, block.title


@pytest.mark.parametrize("kind", ["bouc-wen", "gpi", "series", "fuzzy-network"])
def test_the_sizes_of_steps_do_not_matter(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for block in both_ways(kind):
        inputs = path(block)
        slopes = derivatives(block, inputs, TIME)
        largest = np.abs(slopes).max()
        monkeypatch.setattr(module, "STEP", 1e-150)
        np.testing.assert_allclose(derivatives(block, inputs, TIME), slopes, atol=1e-13 * largest)
        monkeypatch.setattr(module, "CHANGES", (3e-3, 2e-4))
        np.testing.assert_allclose(derivatives(block, inputs, TIME), slopes, atol=1e-10 * largest)
        monkeypatch.undo()


def test_some_columns_and_starts_given_agree_with_the_whole() -> None:
    block = load("blocks", "gpi").example()
    inputs = path(block)
    whole = derivatives(block, inputs)
    np.testing.assert_array_equal(derivatives(block, inputs, places=[3, 1]), whole[:, :, [3, 1]])
    given = block.initial_state(inputs[0], "virgin").tolist()
    started = derivatives(block, inputs, initial=given)
    np.testing.assert_array_equal(started, derivatives(block, inputs, initial="virgin"))
    assert derivatives(block, inputs, places=()).shape == (len(inputs), 1, 0)


def test_a_start_that_depends_on_parameters_has_its_derivatives() -> None:
    block = load("blocks", "gpi").example()
    inputs = path(block)

    def begun(other: Block) -> Array:
        return other.initial_state(inputs[0])

    np.testing.assert_allclose(
        derivatives(block, inputs, initial=begun), derivatives(block, inputs), atol=1e-9
    )


@pytest.mark.parametrize("kind", ["gpi", "creep", "narx-polynomial", "series"])
def test_what_has_no_complex_step_has_differences(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    block = load("blocks", kind).example()
    inputs = path(block)
    exact = derivatives(block, inputs, TIME)
    monkeypatch.setattr(Block, "complex_step", False)
    near = derivatives(block, inputs, TIME)
    assert not np.array_equal(near, exact)
    np.testing.assert_allclose(near, exact, atol=1e-4 * np.abs(exact).max())


@deferred
def _outside(x: float) -> float:
    return float(np.i0(x))


def test_functions_without_derivative_are_refused_by_name() -> None:
    with refused(ModelError, names="np.i0"):
        twin(_outside)
