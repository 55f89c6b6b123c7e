"""Blocks made of blocks: wiring, scheduling inputs, inverses of compositions; linear coupling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from numpy.typing import NDArray

from mckibben import (
    PI,
    Channel,
    ModelError,
    Parallel,
    PerChannel,
    PiecewiseLinear,
    Play,
    Recording,
    Series,
)
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.fields import DISPLACEMENT
from tests.blocks.strategies import paths, pi_models
from tests.refusals import refused

Array = NDArray[np.float64]

FORCE = Channel("force", "N")


def compliance(softness: float, schedule: Channel = FORCE) -> FuzzyNetwork:
    """Return displacement lost under a scheduling channel, as one rule: y = u - softness times it."""
    channels = ((DISPLACEMENT,), (DISPLACEMENT,), (schedule,))
    sets = ((0.0,), (0.0,))
    wide = ((1e3,), (1e3,))
    return FuzzyNetwork(sets, wide, (1.0, -softness), *channels, limits=((-100.0, 100.0),))


@given(pi_models(), paths())
def test_series_are_one_after_another_and_parallels_a_sum(model: PI, u: Array) -> None:
    second = Play(0.7, input=DISPLACEMENT)
    expected = second.simulate(model.simulate(u))
    np.testing.assert_array_equal(Series((model, second)).simulate(u), expected)
    parts = (model, Play(0.7), Play(0.2))
    expected = model.simulate(u) + Play(0.7).simulate(u) + Play(0.2).simulate(u)
    np.testing.assert_allclose(Parallel(parts).simulate(u), expected, rtol=1e-14, atol=1e-14)


def test_blocks_in_parallel_take_their_inputs_by_name_and_add_outputs_of_one_name() -> None:
    rng = np.random.default_rng(3)
    u = rng.uniform(0.0, 4.0, (60, 2))
    pressures = [Channel(f"pressure_{k}", "bar") for k in (1, 2)]
    moved = [Channel(f"displacement_{k}", "mm") for k in (1, 2)]
    made = {
        (j, k): TransferFunction((0.3 + j, 0.1 * k), (-0.5 - 0.2 * j,), 0.1, input=p, output=y)
        for j, y in enumerate(moved)
        for k, p in enumerate(pressures)
    }
    whole = Parallel(tuple(made.values()))
    assert [c.name for c in whole.inputs] == ["pressure_1", "pressure_2"]
    expected = np.column_stack(
        [sum(made[j, k].simulate(u[:, k], sample_time=0.1) for k in (0, 1)) for j in (0, 1)]
    )
    np.testing.assert_allclose(whole.simulate(u, sample_time=0.1), expected, rtol=1e-13)
    stream = whole.stream(0.1)
    streamed = [np.array(stream.step(row)) for row in u]
    np.testing.assert_array_equal(streamed, whole.simulate(u, sample_time=0.1))
    with refused(ModelError, channel="pressure_1"):
        Parallel((made[0, 0], replace(made[0, 0], input=Channel("pressure_1", "psi"))))


def test_a_recording_is_wired_by_name_not_by_order() -> None:
    pair = PerChannel.example()
    u = np.column_stack([np.linspace(0, 3, 40), np.linspace(2, 0, 40)])
    channels = {"pressure_2": u[:, 1], "time_of_day": u[:, 0], "pressure_1": u[:, 0]}
    outputs = pair.simulate(Recording(channels, 0.1))
    found = outputs.matrix(["displacement_1", "displacement_2"])
    np.testing.assert_array_equal(found, pair.simulate(u))
    for part, given_inputs, y in zip(pair.parts, u.T, found.T, strict=True):
        np.testing.assert_array_equal(part.simulate(given_inputs), y)  # channels do not mix
    assert outputs.sample_time == 0.1


def scheduled() -> Series:
    return Series((PI.example(), compliance(0.02), PiecewiseLinear.example()))


def test_scheduling_inputs_reach_the_part_that_wants_them() -> None:
    series = scheduled()
    assert [channel.name for channel in series.inputs] == ["pressure", "force"]
    assert series.scheduling == ("force",)
    u, force = np.linspace(0, 5, 50), 20 * np.sin(np.linspace(0, 9, 50))
    model, _, curve = series.parts
    expected = curve.simulate(model.simulate(u) - 0.02 * force)
    table = np.column_stack([u, force])
    np.testing.assert_array_equal(series.simulate(table)[:, 0], expected)


def test_inverse_keeps_the_scheduling_inputs() -> None:
    series = scheduled()
    inverse = series.inverse()
    assert [channel.name for channel in inverse.inputs] == ["displacement", "force"]
    assert [channel.name for channel in inverse.outputs] == ["pressure"]
    rng = np.random.default_rng(0)
    u = np.interp(np.arange(300), np.arange(0, 300, 23), rng.uniform(0.2, 4.8, 14))
    force = np.interp(np.arange(300), np.arange(0, 300, 31), rng.uniform(0, 60, 10))
    references = series.simulate(np.column_stack([u, force]))
    recovered = inverse.simulate(np.column_stack([references, force]))
    outputs = series.simulate(np.column_stack([recovered, force]))
    assert np.abs(outputs - references).max() <= 1e-9 * np.ptp(references)


# -- linear coupling --------------------------------------------------------------------------------


def test_more_muscles_than_coordinates_are_undone_by_the_least_of_them() -> None:
    tip = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2))
    muscles = tuple(Channel(f"shortening_{k}", "mm") for k in (1, 2, 3))
    block = Coupling(((1.0, 0.0), (-0.5, 0.9), (-0.5, -0.9)), muscles, tip)
    h = np.array([[1.0, 2.0], [-3.0, 0.5]])
    v = block.inverse().simulate(h)
    np.testing.assert_allclose(block.simulate(v), h, atol=1e-14)
    np.testing.assert_allclose(v @ [0.9, 0.9, 0.9], 0.0, atol=1e-14)  # they pull together at none
    np.testing.assert_allclose(block.inverse().inverse().simulate(v), h, atol=1e-14)
    with refused(ModelError, names=(3, 2)):
        _ = block.radius
