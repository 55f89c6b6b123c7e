"""Play, Prandtl-Ishlinskii and Preisach models, and curves: operators side by side, cases by hand.

The laws that they share are in `tests.contracts.test_memory`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import EUPI, GPI, PiecewiseLinear, Play
from mckibben.blocks.hysteresis.eupi import eupi_matrix
from mckibben.blocks.hysteresis.maxwell_slip import slip_matrix
from mckibben.blocks.hysteresis.play_operators import play_matrix
from mckibben.blocks.hysteresis.preisach import DEPTH, Preisach
from tests.blocks.strategies import (
    HIGH,
    LOW,
    eupi_models,
    gpi_models,
    numbers,
    paths,
    pi_models,
    preisach_models,
)

Array = NDArray[np.float64]


# -- play operators ------------------------------------------------------------------------------


def test_starts() -> None:
    assert Play(1.0).simulate([3.0, 2.0]).tolist() == [2.0, 2.0]
    assert Play(1.0).simulate([3.0, 2.0], initial="virgin").tolist() == [2.0, 2.0]
    assert Play(1.0).simulate([0.5, 0.0], initial="virgin").tolist() == [0.0, 0.0]
    assert Play(1.0).simulate([0.5, 0.0], initial=[1.2]).tolist() == [1.2, 1.0]
    assert Play(1.0, initial=(1.2,)).simulate([0.5, 0.0]).tolist() == [1.2, 1.0]


# -- operators side by side, from which estimators find weights ------------------------------------


@pytest.mark.kernel
@given(paths(), st.lists(numbers(0.01, 1.0), min_size=1, max_size=6))
def test_play_operators_side_by_side_are_single_operators(u: Array, steps: list[float]) -> None:
    r = np.cumsum(steps)
    operators = np.empty((u.size, r.size))
    play_matrix(u, u, u, r, u[0] - r, operators)
    for column, threshold in zip(operators.T, r.tolist(), strict=True):
        np.testing.assert_array_equal(column, Play(threshold).simulate(u))


@pytest.mark.kernel
@given(gpi_models(), paths())
def test_generalised_operators_side_by_side_are_the_model(model: GPI, u: Array) -> None:
    r, rising, falling = np.array(model.thresholds), model.rising(u), model.falling(u)
    operators = np.empty((u.size, r.size))
    play_matrix(u, rising, falling, r, rising[0] - r, operators)
    np.testing.assert_allclose(operators @ model.weights, model.simulate(u), atol=1e-10)


@pytest.mark.kernel
@given(eupi_models(), paths())
def test_unparallel_operators_side_by_side_are_the_model(model: EUPI, u: Array) -> None:
    bare = replace(model, polynomial=(0.0, 0.0, 0.0), offset=0.0)
    r = np.array(model.thresholds)
    operators = np.empty((u.size, r.size))
    edges = model.falling_slope, model.falling_threshold
    eupi_matrix(u - LOW, *edges, r, u[0] - LOW - r, operators)
    np.testing.assert_allclose(operators @ model.weights, bare.simulate(u), atol=1e-10)


@pytest.mark.kernel
@pytest.mark.parametrize("models", [pi_models, gpi_models, eupi_models, preisach_models])
@settings(max_examples=300)
@given(data=st.data())
def test_the_lowest_input_leads_to_what_is_reachable_after_any_peak(
    models: Any, data: st.DataObject
) -> None:
    model = data.draw(models())
    low, high = (float(end[0]) for end in model.reachable())
    swings = np.full(61, LOW)
    swings[1::2] = np.linspace(LOW, HIGH, 30)  # a higher peak wipes out those before
    outputs = model.simulate(swings, initial="first_sample")
    rounding = 1e-9 * (1.0 + np.abs(outputs).max())
    assert outputs[::2].max() <= low + rounding
    assert outputs[-2] >= high - rounding


def test_springs_side_by_side_are_each_alone() -> None:
    u, limits = np.random.default_rng(0).uniform(0.0, 5.0, 300), np.array([0.2, 0.9, 2.0])
    stiffness, ratio = 1.3, 0.7
    deflections = np.empty((u.size, limits.size))
    slip_matrix(u, limits, stiffness, ratio, limits.copy(), deflections)
    for limit, found in zip(limits.tolist(), deflections.T, strict=True):
        s, expected = limit, [limit]
        for move in np.diff(u).tolist():
            s = min(s + move, limit) if move >= 0 else max(s + stiffness * move, -ratio * limit)
            expected.append(s)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)


# -- models ----------------------------------------------------------------------------------------


def test_a_held_reference_holds_the_input() -> None:
    """Rounding must not be taken for a reversal, on which the input jumps across the dead zone."""
    model = GPI.example()
    u = np.concatenate([np.linspace(0.5, 4.5, 40), np.linspace(4.5, 1.0, 40), np.full(500, 1.0)])
    recovered = model.inverse().simulate(model.simulate(u))
    assert np.ptp(recovered[-500:]) == 0.0


@pytest.mark.kernel
def test_preisachs_model_forgets_the_smallest_of_too_many_loops_and_no_other() -> None:
    """Ever smaller loops nest; when the input leaves them all, nothing of them is left."""
    block = Preisach.example()
    low, high = block.input_limits
    shrinking = 0.5 * (low + high) + 0.45 * (high - low) * (-0.95) ** np.arange(DEPTH + 12)
    around = np.array([low, high, *shrinking, high, low + 0.3 * (high - low)])
    directly = np.array([low, high, high, low + 0.3 * (high - low)])
    outputs = block.simulate(around)
    assert outputs[-1] == pytest.approx(block.simulate(directly)[-1], rel=1e-12)
    inputs = block.inverse().simulate(outputs)
    np.testing.assert_allclose(block.simulate(inputs), outputs, atol=1e-9 * np.ptp(outputs))


# -- curves ----------------------------------------------------------------------------------------


def test_a_piecewise_linear_curve_goes_on_straight_beyond_its_ends() -> None:
    curve = PiecewiseLinear((0.0, 1.0, 3.0), (0.0, 2.0, 3.0))
    assert curve.simulate([-1.0, 5.0]).tolist() == [-2.0, 4.0]
