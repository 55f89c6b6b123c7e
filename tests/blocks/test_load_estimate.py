"""Loads by displacements and pressures are those that were, and take work from what moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.load_estimate import LoadEstimate
from tests.blocks.balances import (
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
