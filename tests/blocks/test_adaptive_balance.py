"""A balance of forces that learns stays one, is undone exactly at every step, and finds what changed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben.blocks.adaptive import Adaptive, adaptive
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_adaptive import FRICTION, STIFFNESS, adaptable_in
from mckibben.blocks.coupled.balance_bounds import ratios
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.laws import wander
from tests.blocks.balances import ALONE, CROWDED, STEP, balances, in_series

Array = NDArray[np.float64]


def path(balance: Balance, seed: int, n: int) -> Array:
    """Return displacements, what schedules and loads, shape (n, inputs)."""
    low = [5.0] * len(balance.driven) + [0.2] * len(balance.scheduled)
    high = [20.0] * len(balance.driven) + [1.0] * len(balance.scheduled)
    moves = wander(np.array(low), np.array(high), np.random.default_rng(seed), 20, n // 20 + 3)
    return np.asarray(moves[:n])


@settings(max_examples=15)
@given(
    balances() | balances(crowded=True) | balances(crowded=True, driven=0),
    st.integers(0, 1000),
    st.booleans(),
)
def test_model_and_inverse_match_at_every_step(balance: Balance, seed: int, wild: bool) -> None:
    """Whatever is measured: of a muscle that drifts, or garbage, or nothing."""
    block = Adaptive(Inverse(balance), 2.0, 0.05)
    asked, n, own = path(balance, seed, 120), len(balance.driven), block.fixed.n_states
    stream, rng = block.stream(STEP), np.random.default_rng(seed)
    measured, before = asked[0, :n], block.fixed.initial_state(asked[0], sample_time=STEP)
    for sample in asked:
        pressures = stream.step([*sample, *measured])
        forward, driven = block.present(stream.state), [[*pressures, *sample[n:]]]
        found = forward.simulate(driven, sample_time=STEP, initial=before.tolist())
        assert np.abs(found - sample[:n]).max() <= 1e-9 * 15.0
        before = stream.state[:own].copy()
        measured = 0.9 * sample[:n] + 1.0 + 0.05 * rng.standard_normal(n)
        if wild:
            measured = measured + rng.choice([0.0, 1e3, np.nan, -30.0], n)


@settings(max_examples=15)
@given(balances(m=0, n_lags=0) | balances(m=0, n_lags=0, crowded=True), st.integers(0, 1000))
def test_slopes_are_those_of_the_model(balance: Balance, seed: int) -> None:
    """Of coordinates by parameters, where nothing is remembered."""
    balance = replace(balance, tare=False)
    block, m = Adaptive(Inverse(balance), 20.0, 0.05), len(balance.driven)
    asked, stream = path(balance, seed, 3)[-1], block.stream(STEP)
    pressures = stream.step([*asked, *asked[:m]])
    more = stream.state[block.fixed.n_states :][: block.learnable.n_more_states]
    slopes, fitted = more[m:].reshape(m, -1), block.learnable.fitted
    steps = 1e-5 * np.diag(block.learnable.scales)
    driven = np.concatenate([pressures, asked[m:]])[np.newaxis]
    for i, h in enumerate(steps):
        above, below = (
            block.learnable.with_parameters(fitted + way * h).simulate(driven, sample_time=STEP)[0]
            for way in (1.0, -1.0)
        )
        expected = (above - below) / (2.0 * h[i])
        np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-5, atol=1e-10 / h[i])


@pytest.mark.kernel
@settings(max_examples=15)
@given(balances() | balances(crowded=True), st.integers(0, 1000))
def test_what_garbage_teaches_is_a_balance_still(balance: Balance, seed: int) -> None:
    """A balance that makes energy is refused; areas outweigh friction, as the fitted ones do."""
    c, levels = balance.coefficients(STEP), np.zeros((balance.n_schedules, 2))
    block, n = Adaptive(Inverse(balance), 1.0, 0.05), len(balance.driven)
    stream, rng = block.stream(STEP), np.random.default_rng(seed)
    for sample in path(balance, seed, 150):
        stream.step([*sample, *rng.uniform(-100.0, 100.0, n)])
    changed: Balance = block.present(stream.state).inverse()  # type: ignore[assignment]
    for k in range(len(balance.given)):
        most, softest = ratios(c, k, levels)
        area = changed.areas[k][0] / balance.areas[k][0]
        assert changed.elasticity[k][0] >= balance.elasticity[k][0] * area / softest * (1 - 1e-12)
        for new, old in zip(changed.friction[k], balance.friction[k], strict=True):
            assert new <= old * area * most * (1 + 1e-12)
    matrix = np.array(changed.springs)[:, 1 : 1 + n]
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-12)
    assert np.linalg.eigvalsh(matrix)[0] > 0


SINGLE = replace(ALONE, settled=True, loads=((),), scheduled=())
"""One muscle that has come to rest."""


def factors(block: Adaptive, state: Array) -> Array:
    """Return the estimated parameters of a learner's state."""
    size = block.learnable.fitted.size
    return state[-block.n_adapted :][:size]


def followed(block: Adaptive, plant: Any) -> tuple[Array, Array]:
    """Return a learner's state after it drove a plant, and errors."""
    t, rng = STEP * np.arange(4000), np.random.default_rng(0)
    stream, run, errors = block.stream(STEP), plant.stream(STEP), np.empty(t.size)
    asked = 14.0 + 9.0 * np.sin(t) * np.sin(0.13 * t)
    measured = asked[0]
    for k, y in enumerate(asked):
        reached = run.step(stream.step([y, measured]))[0]
        errors[k], measured = reached - y, reached + 0.02 * rng.standard_normal()
    return np.array(stream.state), errors


@pytest.mark.parametrize(("kind", "factor"), [(STIFFNESS, 0.85), (FRICTION, 1.3)])
def test_what_changed_is_compensated_and_found(kind: int, factor: float) -> None:
    block = Adaptive(Inverse(SINGLE), 20.0, 0.02)
    kinds = np.array([one for _, one in adaptable_in(SINGLE.coefficients(STEP))])
    plant = SINGLE.learnable.with_parameters(
        np.where(kinds == kind, factor, SINGLE.learnable.fitted)
    )
    state, errors = followed(block, plant)
    assert np.sqrt((errors[-1000:] ** 2).mean()) < 0.05 * np.abs(errors[:200]).max() + 0.005
    found = factors(block, state)[kinds == kind]
    assert found.mean() == pytest.approx(factor, abs=0.2 * abs(factor - 1.0))


def test_whatever_a_balance_is_in_series_with_it_learns() -> None:
    """Three muscles under a load, on two coordinates: late measurements teach nothing false."""
    balance = CROWDED
    kinds = np.array([kind for _, kind in adaptable_in(balance.coefficients(STEP))])
    changes = np.where(kinds == STIFFNESS, 1.2, balance.learnable.fitted)
    aged = balance.learnable.with_parameters(changes).inverse()
    assert isinstance(aged, Balance)
    block = adaptive(in_series(balance, 3 * STEP), 20.0, 0.04)
    plant = in_series(aged, 2 * STEP)  # and one for which a command is held
    t, rng = STEP * np.arange(2400), np.random.default_rng(0)
    asked = 1.0 + 2.0 * np.stack([9.0 + 4.0 * np.sin(t), 3.0 * np.sin(0.7 * t)], axis=1)
    asked[:, 1] *= 1.0 + np.sin(0.13 * t)
    stream, run, errors = block.stream(STEP), plant.stream(STEP), np.empty(asked.shape)
    measured, loads = asked[0], 10.0 + 5.0 * np.sin(0.3 * t)
    for k, wanted in enumerate(asked):
        reached = run.step([*stream.step([*wanted, loads[k], *measured]), loads[k]])
        errors[k] = reached - asked[max(k - 2, 0)]
        measured = reached + 0.04 * rng.standard_normal(2)
    assert np.abs(errors[-1000:]).max() < 0.05 * np.abs(errors[2:200]).max()
    found = factors(block, block._core_state(np.array(stream.state)))[kinds == STIFFNESS]
    assert found.mean() == pytest.approx(1.2, abs=0.04)
    assert block.n_clipped(np.array(stream.state)) == 0


def test_without_a_change_it_is_as_good_as_fixed() -> None:
    _, errors = followed(Adaptive(Inverse(SINGLE), 20.0, 0.02), SINGLE.inverse())
    assert np.sqrt((errors**2).mean()) < 0.01


@pytest.mark.kernel
@pytest.mark.parametrize("fault", [np.nan, 12.0])
def test_a_sensor_that_drops_out_or_stands_still_teaches_nothing(fault: float) -> None:
    block = Adaptive(Inverse(SINGLE), 20.0, 0.02)
    stream = block.stream(STEP)
    for sample in path(SINGLE, 3, 400):
        stream.step([*sample, fault])
    learnt: Balance = block.present(stream.state).inverse()  # type: ignore[assignment]
    np.testing.assert_allclose(learnt.pack(), SINGLE.pack(), rtol=0.02, atol=0.02)
