"""Loads by displacements and pressures are those that were, and take work from what moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import ModelError
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.load_estimate import LoadEstimate
from tests.blocks.balances import (
    ALONE,
    FURTHEST,
    HIGHEST,
    LOADED,
    SEEDS,
    balances,
    measured,
    motion,
    run,
)
from tests.blocks.strategies import numbers

Array = NDArray[np.float64]


@given(st.integers(1, 3), st.data(), SEEDS)
def test_the_loads_estimated_are_those_that_were(n: int, data: st.DataObject, seed: int) -> None:
    block = data.draw(balances(n=n, n_loads=data.draw(st.sampled_from([1, n]))))
    inputs = motion(block, (0.0, HIGHEST), seed)
    loads = inputs[:, inputs.shape[1] - block.n_loads :]
    inputs[0, :n] = 0.0  # from rest; of a tare nothing tells the load there
    loads[0] *= 0.0 if block.tare else 1.0
    found = run(LoadEstimate(block), measured(block, inputs))
    np.testing.assert_allclose(found, loads, atol=1e-9 * LOADED)


def test_without_a_load_at_rest_none_need_be_said() -> None:
    block = replace(Balance.example(), tare=True)
    inputs = motion(block, (0.0, 2.5), 1)
    inputs[0, 3] = 0.0
    found = run(LoadEstimate.of(block.inverse()), measured(block, inputs))
    np.testing.assert_allclose(found[:, 0], inputs[:, 3], atol=1e-9 * LOADED)


def test_one_load_on_two_muscles_is_estimated_by_least_squares() -> None:
    """What a pressure is off by counts by the muscle's share of all."""
    example = Balance.example()
    block = replace(example, loads=((1.0,), (2.0,)), limits=(), friction=((), ()), tare=True)
    inputs = motion(block, (0.0, 2.5), 2)
    known = measured(block, inputs)
    tare = LoadEstimate(block).initial_state(known[0])[-4]
    area = np.polyval(block.areas[0][::-1], (known[:, 0] + tare) / block.scale)
    off = np.array([0.0, 0.0, 0.1, 0.0, 0.0])
    shift = run(LoadEstimate(block), known + off) - run(LoadEstimate(block), known)
    np.testing.assert_allclose(shift[:, 0], 0.1 * area * 1.0 / (1.0 + 4.0), atol=1e-9)


@given(balances(n=2, n_loads=2), numbers(0.0, HIGHEST), SEEDS)
def test_a_closed_cycle_at_held_pressure_takes_work(block: Balance, p: float, seed: int) -> None:
    """Forces at the end of a step of a convex energy do its rise at least: the sum is a bound."""
    rng = np.random.default_rng(seed)
    turns = rng.uniform(-10.0, FURTHEST, (6, 2))
    turns[-1] = turns[0]
    path = np.column_stack([np.interp(np.linspace(0, 5, 101), range(6), y) for y in turns.T])
    held = np.full((len(path), len(LoadEstimate(block).inputs)), 1.0)
    held[:, :2], held[:, 2:4] = path, p
    loads = run(LoadEstimate(block), held, initial="virgin")
    work = -np.sum(loads[1:] * np.diff(path, axis=0))
    assert work >= -1e-9 * np.abs(loads).max()


def test_friction_takes_work_and_elasticity_none() -> None:
    """The same cycle, fine enough, with friction and without."""
    path = 10.0 + 8.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 20_001))
    works = []
    for friction in (((1.5,),), ((0.0,),)):
        block = replace(
            ALONE,
            limits=(0.5,),
            friction=friction,
            lags=(),
            relaxation=((),),
            damping=(0.0,),
            lines=(),
        )
        inputs = np.column_stack([path, np.full(path.size, 2.0)])
        loads = run(LoadEstimate(block), inputs, initial="virgin")[:, 0]
        works.append(-np.sum(0.5 * (loads[1:] + loads[:-1]) * np.diff(path)))
    limit = 0.5 * (2.0 + ALONE.grip)
    # along 32 mm it slips, but for what turns it round, 2 limits after each of both reversals; and it
    # is stretched by its limit first
    assert works[0] == pytest.approx(1.5 * limit * (32.0 - 4.0 * limit - 0.5 * limit), rel=0.1)
    assert works[1] == pytest.approx(0.0, abs=1e-4)


def test_what_tells_no_loads_is_refused() -> None:
    example = Balance.example()
    unloaded = replace(example, loads=((), ()), scheduled=example.scheduled[:1])
    with pytest.raises(ModelError, match=r"knows no load.*Remedy:"):
        LoadEstimate(unloaded)
    two = (*example.scheduled, Channel("force_2", "N"))
    with pytest.raises(ModelError, match=r"do not tell them apart\. Remedy:"):
        LoadEstimate(replace(example, loads=((1.0, 1.0), (0.5, 0.5)), scheduled=two))
    with pytest.raises(ModelError, match=r"an estimate of loads already.*Remedy:"):
        LoadEstimate.of(LoadEstimate.example())
