"""Laws of the balance of forces: exact both ways, passive, and the minimum of a convex energy."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from mckibben import ModelError, ModelWarning
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.load_estimate import LoadEstimate
from mckibben.blocks.laws import wander
from mckibben.blocks.setting import with_fields
from tests.blocks.balances import (
    ALONE,
    CROWDED,
    FURTHEST,
    HIGHEST,
    SEEDS,
    STEP,
    balances,
    channels,
    motion,
    run,
    undone,
)
from tests.blocks.strategies import numbers
from tests.refusals import refused
from tests.twins import TWINS

Array = NDArray[np.float64]


def beside(driven: Array, block: Block, inputs: Array) -> Array:
    """Return other driven values with what schedules a block's inputs."""
    return np.column_stack([driven, inputs[:, block.n_driven :]])


# -- exact both ways -----------------------------------------------------------------------------


DRIVEN = balances(crowded=True, driven=0) | balances(crowded=True, driven=1)
ANY = balances() | balances(heavy=True) | balances(crowded=True) | DRIVEN


@given(ANY, SEEDS, st.sampled_from(["first_sample", "virgin"]))
def test_pressures_give_the_motion_that_needs_them(block: Balance, seed: int, start: str) -> None:
    inputs = motion(block, (-5.0, FURTHEST), seed)
    found = undone(block, inputs, start)
    np.testing.assert_allclose(found, inputs[:, : block.n_driven], atol=1e-9 * FURTHEST)


@given(balances() | balances(heavy=True), SEEDS)
def test_motion_tells_the_pressures_that_made_it(block: Balance, seed: int) -> None:
    inputs = motion(block.inverse(), (0.0, HIGHEST), seed)
    found = undone(block.inverse(), inputs)
    np.testing.assert_allclose(found, inputs[:, : len(block.given)], atol=1e-9 * HIGHEST)


def along(drive: Any, steps: Array) -> Array:
    """Return pressures at steps along the directions in which they were driven."""
    table = np.array(drive)
    return np.asarray(table[:, 0] + steps @ table[:, 1:].T)


def driven_motion(block: Balance, seed: int) -> Array:
    """Return pressures up to 1.5 bar from their middle as driven, and what schedules."""
    inputs, ways = motion(block.inverse(), (0.0, HIGHEST), seed), np.array(block.drive)[:, 1:]
    reach = np.full(ways.shape[1], 1.5 / np.abs(ways).sum(axis=1).max())
    steps = wander(-reach, reach, np.random.default_rng(seed), 8, 20)
    inputs[:, : len(block.given)] = along(block.drive, np.resize(steps, (len(inputs), reach.size)))
    return inputs


@given(balances(crowded=True, driven=0), SEEDS, st.booleans())
def test_motion_tells_the_pressures_that_were_driven(
    block: Balance, seed: int, slack: bool
) -> None:
    """As many directions as coordinates leave no choice, of muscles that go slack either."""
    if slack:
        n = len(block.given)
        block = replace(block, bladders=(2.0, 3.0, 1.0)[:n], pushes=(60.0, 50.0, 40.0)[:n])
    inputs = driven_motion(block, seed)
    found = undone(block.inverse(), inputs)
    np.testing.assert_allclose(found, inputs[:, : len(block.given)], atol=1e-9 * HIGHEST)


def test_a_bundle_that_is_slack_at_its_middle_is_driven() -> None:
    """Two muscles side by side, whose pressures rose together, held where they need more."""
    two = {
        name: 2 * getattr(ALONE, name)
        for name in (
            "elasticity",
            "areas",
            "friction",
            "relaxation",
            "damping",
            "lines",
            "walls",
            "hull",
        )
    }
    block = replace(
        ALONE, **two, given=channels("pressure", "bar", 2), directions=((1.0,), (1.0,)),
        bladders=(8.0, 8.0), pushes=(5.0, 5.0), drive=((1.0, 0.5), (1.0, 0.5)),
    )  # fmt: skip
    pressures = np.repeat(1.0 + np.sin(np.arange(100) / 9.0)[:, np.newaxis] ** 2, 2, axis=1) + 1.0
    inputs = np.column_stack([pressures, np.zeros(100)])
    np.testing.assert_allclose(undone(block.inverse(), inputs), pressures, atol=1e-9)


def test_a_preload_is_how_hard_muscles_pull_against_each_other() -> None:
    inputs = motion(CROWDED, (0.0, 10.0), 0)
    stiffer = [with_fields(CROWDED, {"preload": bar}) for bar in (2.0, 3.0, 4.0)]
    pressures = [run(block, inputs) for block in stiffer]
    assert np.all(np.diff([given.mean() for given in pressures]) > 0.5)
    for block in stiffer:
        np.testing.assert_allclose(undone(block, inputs), inputs[:, :2], atol=1e-7)
    for block in (
        ALONE,
        replace(CROWDED, drive=((1.0, 0.5, 0.1), (1.0, 0.5, -0.1), (1.0, 0.2, 0.4))),
    ):
        with refused(ModelError, parameter="preload"):
            with_fields(block, {"preload": 1.0})


@given(DRIVEN, SEEDS)
def test_pressures_stay_along_the_directions_in_which_they_were_driven(
    block: Balance, seed: int
) -> None:
    """Also where they are clipped, which is what other muscles take part in."""
    limited = replace(block, pressure_range=(1.0, 3.0))
    inputs = motion(block, (-5.0, FURTHEST), seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        pressures = limited.simulate(inputs, sample_time=STEP)
    assert pressures.min() >= 1.0
    assert pressures.max() <= 3.0
    table = np.array(block.drive)
    away, ways = pressures - table[:, 0], table[:, 1:]
    steps = np.linalg.lstsq(ways, away.T, rcond=None)[0]
    np.testing.assert_allclose(ways @ steps, away.T, atol=1e-9 * HIGHEST)


@given(balances() | balances(heavy=True), SEEDS)
def test_pressures_that_are_clipped_move_muscles_that_need_them(block: Balance, seed: int) -> None:
    inputs = motion(block, (-5.0, 2.0 * FURTHEST), seed)
    free = run(block, inputs)
    low, high = (float(q) for q in np.quantile(free, [0.2, 0.8]))
    limited = replace(block, pressure_range=(low, high))
    with pytest.warns(ModelWarning):
        pressures = limited.simulate(inputs, sample_time=STEP)
    assert pressures.min() >= low
    assert pressures.max() <= high
    reached = run(block.inverse(), beside(pressures, block, inputs))
    found = run(block, beside(reached, block, inputs))
    np.testing.assert_allclose(found, pressures, atol=1e-9 * high)


@given(ANY, SEEDS)
def test_drawn_balances_agree_with_their_twin(block: Balance, seed: int) -> None:
    inputs = motion(block, (-5.0, FURTHEST), seed, 3)
    expected = TWINS["balance"](block, inputs.tolist(), STEP)
    np.testing.assert_allclose(run(block, inputs), expected, atol=1e-9 * HIGHEST)


# -- memory --------------------------------------------------------------------------------------


def state_after(block: Block, inputs: Array) -> Array:
    state = block.initial_state(inputs[0], sample_time=STEP)
    block.bind(STEP, state, inputs, np.empty((len(inputs), len(block.outputs))))()
    return state


# -- energy --------------------------------------------------------------------------------------


@given(ANY, SEEDS)
def test_any_pressures_find_their_equilibrium(block: Balance, seed: int) -> None:
    """Jumps from anywhere to anywhere, also beyond what is known."""
    rng, n = np.random.default_rng(seed), len(block.given)
    inputs = motion(block.inverse(), (0.0, HIGHEST), seed)
    inputs[:, :n] = rng.uniform(-0.5, 3.0 * HIGHEST, (len(inputs), n))
    inputs[:, n:] = rng.permuted(inputs[:, n:], axis=0)
    assert state_after(block.inverse(), inputs)[-1] == 0.0


# -- what is out of reach --------------------------------------------------------------------------


@given(balances(n=2) | balances(crowded=True) | DRIVEN, SEEDS, st.booleans())
def test_what_cannot_be_reached_is_told(block: Balance, seed: int, slack: bool) -> None:
    """Muscles that would have to push harder than they can, or pressures out of their range."""
    n, m = len(block.given), len(block.driven)
    limited = replace(block, pressure_range=(0.0, HIGHEST))
    if slack:
        limited = replace(block, bladders=(2.0, 3.0, 1.0)[:n], pushes=(4.0, 0.0, 2.0)[:n])
    inputs = motion(limited, (-5.0, FURTHEST), seed)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        pressures = limited.simulate(inputs, sample_time=STEP)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if told else "error")  # no balance at what was not solved
        found = run(limited.inverse(), beside(pressures, limited, inputs))
    if not told:
        np.testing.assert_allclose(found, inputs[:, :m], atol=1e-8)
    else:
        assert told[0].category is ModelWarning
        assert np.abs(found - inputs[:, :m]).max() > 1e-9


# -- loads ---------------------------------------------------------------------------------------


# -- time ----------------------------------------------------------------------------------------


def ramps(block: Block, highest: float, steps: int) -> Array:
    """Return ramps between turning points, so many steps each."""
    rng = np.random.default_rng(4)
    turns = rng.uniform(0.0, highest, (9, len(block.inputs)))
    grid = np.arange(8 * steps + 1) / steps
    return np.column_stack([np.interp(grid, range(9), column) for column in turns.T])


@given(balances(m=0, n_lags=2), st.booleans())
def test_on_ramps_lags_are_exact_in_steps_of_any_length(block: Balance, damped: bool) -> None:
    """So is damping, but for the first step of a ramp: velocities are found from two steps."""
    block = replace(block, lines=())  # whose areas are those of the last sample
    if not damped:
        block = replace(block, damping=(0.0,) * len(block.given))
    coarse = run(block, ramps(block, FURTHEST, 5), 0.2)
    fine = run(block, ramps(block, FURTHEST, 40), 0.025)
    exact = np.arange(len(coarse)) % 5 != 1 if damped else slice(None)
    np.testing.assert_allclose(fine[::8][exact], coarse[exact], atol=1e-9 * np.abs(coarse).max())


def test_a_hanging_load_swings_as_newton_says() -> None:
    """20 kg on 16 N/mm, whose pressure moves at up to 1 Hz; noise of a sensor is 0.02 mm."""
    block = replace(
        ALONE, elasticity=((),), areas=((60.0, -25.0),), friction=((),), limits=(), lags=(),
        relaxation=((),), springs=((0.0, 16.0),), damping=(0.1,), lines=(), walls=(0.0,), mass=(0.02,),
    )  # fmt: skip

    def pressure(t: Any) -> Any:
        return 1.5 * (1.0 - np.cos(2.0 * np.pi * t)) * np.minimum(t / 4.0, 1.0) ** 2

    def moving(t: float, now: Array) -> list[float]:
        y, v = now
        pull = pressure(t) * (60.0 - 25.0 * y / block.scale)
        return [v, (pull - 16.0 * y - 0.1 * v) / 0.02]

    def missed(step: float) -> float:
        time = np.arange(round(8.0 / step)) * step
        inputs = np.column_stack([pressure(time), np.zeros(time.size)])
        exact = solve_ivp(moving, (0.0, 8.0), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-9).y[0]
        return float(np.sqrt(np.mean((run(block.inverse(), inputs, step)[:, 0] - exact) ** 2)))

    assert missed(0.02) < 0.01  # less than the noise, and so is what half the step changes
    assert missed(0.01) < 0.7 * missed(0.02)


# -- loads that are estimated ----------------------------------------------------------------------


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
