"""A balance of forces that learns stays one, is undone exactly at every step, and tells what changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben.blocks.adaptive.adaptive import Adaptive
from mckibben.blocks.core.inverse import Inverse
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_adapting import (
    FRICTION,
    STIFFNESS,
)
from mckibben.blocks.laws.trial import wander
from tests.blocks.balances import balances

Array = NDArray[np.float64]

STEP = 0.05
"""Sample time [s]."""


class Loop:
    """A learning balance stepped sample by sample, its state in sight."""

    def __init__(self, block: Adaptive) -> None:
        self.block = block
        self.inputs = np.zeros((1, len(block.inputs)))
        self.outputs = np.zeros((1, len(block.outputs)))
        self.state = np.zeros(block.n_states)
        self.run = block.bind(STEP, self.state, self.inputs, self.outputs)
        self.started = False

    def step(self, asked: Array, measured: Array) -> Array:
        self.inputs[0] = np.concatenate([asked, measured])
        if not self.started:
            self.state[:] = self.block.initial_state(self.inputs[0])
            self.started = True
        self.run()
        return self.outputs[0].copy()

    @property
    def own(self) -> Array:
        return self.state[: self.block.fixed.n_states].copy()


def path(balance: Balance, seed: int, n: int) -> Array:
    """Return displacements, what schedules and loads, shape (n, inputs)."""
    low = [5.0] * len(balance.driven) + [0.2] * len(balance.scheduled)
    high = [20.0] * len(balance.driven) + [1.0] * len(balance.scheduled)
    moves = wander(np.array(low), np.array(high), np.random.default_rng(seed), 20, n // 20 + 3)
    return np.asarray(moves[:n])


def answers(forward: Any, own: Array, pressures: Array, scheduled: Array) -> Array:
    """Return the displacements of a model that remembers what the inverse does."""
    given, out = np.concatenate([pressures, scheduled])[np.newaxis], np.zeros((1, len(pressures)))
    forward.bind(STEP, own, given, out)()
    return out[0]


@settings(max_examples=15, deadline=None)
@given(balances(), st.integers(0, 1000), st.booleans())
def test_model_and_inverse_match_at_every_step(balance: Balance, seed: int, wild: bool) -> None:
    """Whatever is measured: of a muscle that drifts, or garbage, or nothing."""
    block = Adaptive(Inverse(balance), 2.0, 0.05)
    asked, n, loop = path(balance, seed, 120), len(balance.driven), Loop(block)
    rng = np.random.default_rng(seed)
    measured = asked[0, :n]
    for sample in asked:
        before = loop.own if loop.started else block.fixed.initial_state(sample)
        pressures = loop.step(sample, measured)
        found = answers(block.present(loop.state), before, pressures, sample[n:])
        assert np.abs(found - sample[:n]).max() <= 1e-9 * 15.0
        measured = 0.9 * sample[:n] + 1.0 + 0.05 * rng.standard_normal(n)
        if wild:
            measured = measured + rng.choice([0.0, 1e3, np.nan, -30.0], n)


@pytest.mark.kernel
@settings(max_examples=15, deadline=None)
@given(balances(), st.integers(0, 1000))
def test_what_garbage_teaches_is_a_balance_still(balance: Balance, seed: int) -> None:
    """`retaught` refuses what makes energy; areas outweigh friction, as the fitted ones do."""
    block, n = Adaptive(Inverse(balance), 1.0, 0.05), len(balance.driven)
    loop, rng = Loop(block), np.random.default_rng(seed)
    for sample in path(balance, seed, 150):
        loop.step(sample, rng.uniform(-100.0, 100.0, n))
    forward = block.present(loop.state)
    changed: Balance = forward.inverse()  # type: ignore[assignment]
    for k in range(n):
        most = balance.ratios[2 * k]
        area = changed.areas[k][0] / balance.areas[k][0]
        for new, old in zip(changed.friction[k], balance.friction[k], strict=True):
            assert new <= old * area * most * (1 + 1e-12)
    matrix = np.array(changed.springs)[:, 1 : 1 + n]
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-12)
    assert np.linalg.eigvalsh(matrix)[0] > 0


def changed_by(balance: Balance, kind: int, factor: float) -> Any:
    """Return the forward block of a balance one kind of whose factors is another."""
    kinds = np.array([one for _, one in balance.learnt])
    return balance.retaught(np.where(kinds == kind, factor, balance.taught))


def followed(block: Adaptive, plant: Any, n: int, noise: float = 0.02) -> tuple[Loop, Array]:
    """Return a loop after it drove a plant, and errors, shape (n, muscles)."""
    balance: Balance = block.learner  # type: ignore[assignment]
    loop, muscles = Loop(block), len(balance.driven)
    t = STEP * np.arange(n)
    waves = [14.0 + 9.0 * np.sin((1.0 + 0.37 * k) * t) * np.sin(0.13 * t) for k in range(muscles)]
    held = [np.full(n, 1.0) for _ in balance.scheduled]
    asked, rng = np.column_stack([*waves, *held]), np.random.default_rng(0)
    state = plant.initial_state(np.zeros(len(plant.inputs)))
    measured, errors = asked[0, :muscles], np.zeros((n, muscles))
    for k, sample in enumerate(asked):
        pressures = loop.step(sample, measured)
        given, out = np.concatenate([pressures, sample[muscles:]]), np.zeros((1, muscles))
        plant.bind(STEP, state, given[np.newaxis], out)()
        errors[k] = out[0] - sample[:muscles]
        measured = out[0] + noise * rng.standard_normal(muscles)
    return loop, errors


def single() -> Balance:
    """Return one muscle that has come to rest."""
    return Balance(
        springs=((0.5, 0.15),),
        elasticity=((0.4, 0.2),),
        areas=((1.0, -0.4, 0.02),),
        friction=((0.1, 0.06, 0.03),),
        relaxation=((0.01,),),
        loads=((),),
        damping=(0.001,),
        walls=(0.0,),
        limits=(0.05, 0.3, 1.2),
        grip=0.5,
        lags=(2.0,),
        hull=((0.0, 30.0),),
        scale=30.0,
        degree=1,
        driven=Balance.example().driven[:1],
        scheduled=(),
        given=Balance.example().given[:1],
        settled=True,
    )


@pytest.mark.parametrize(
    ("kind", "factor", "name"), [(STIFFNESS, 0.85, "springs"), (FRICTION, 1.3, "friction")]
)
def test_what_changed_is_made_up_for_and_found(kind: int, factor: float, name: str) -> None:
    balance = single()
    block = Adaptive(Inverse(balance), 20.0, 0.02)
    loop, errors = followed(block, changed_by(balance, kind, factor), 4000)
    assert np.sqrt((errors[-1000:] ** 2).mean()) < 0.05 * np.abs(errors[:200]).max() + 0.005
    drift = block.drift(loop.state)
    changes = dict(zip((g.name for g in drift.groups), drift.changes, strict=True))
    assert changes.pop(name) == pytest.approx(factor - 1.0, abs=0.2 * abs(factor - 1.0))
    assert drift.alarm
    _, errors = followed(block, balance.inverse(), 4000)
    assert np.sqrt((errors**2).mean()) < 0.01  # without a change it is as good as fixed


@pytest.mark.kernel
@pytest.mark.parametrize("fault", [np.nan, 12.0])
def test_a_sensor_that_drops_out_or_stands_still_teaches_nothing(fault: float) -> None:
    balance = single()
    loop = Loop(Adaptive(Inverse(balance), 20.0, 0.02))
    asked = path(balance, 3, 400)
    loop.step(asked[0], np.array([fault]))
    loop.step(asked[1], np.array([fault]))
    for sample in asked[2:]:
        loop.step(sample, np.array([fault]))
    theta = loop.block._split(loop.state)[1]
    np.testing.assert_allclose(theta, balance.taught, atol=0.02)
