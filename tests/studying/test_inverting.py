"""A compensator: whose it is, whether its inverse is right, and what is to be expected of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben import GPI, PI, ModelError, PiecewiseLinear, RateDependentPI, Recording, study
from mckibben.blocks.base import Block
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.fields import Channel
from mckibben.blocks.memoryless import Affine
from mckibben.registry import load
from mckibben.signals import triangle
from mckibben.splits import given_split
from mckibben.studying.inverting import build_compensator, check_inverse, static_error, static_map
from mckibben.studying.recorded_inputs import RecordedInputs
from tests.blocks.balances import CROWDED

TIME = np.arange(0, 24, 0.02)
RISE = triangle(TIME, 4.0, [5.0, 4.2, 3.4, 2.6, 1.8, 1.0])


def recorded(u: np.ndarray, seed: int = 0) -> Recording:
    noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    return Recording({"pressure": u, "displacement": GPI.example().simulate(u) + noise}, 0.02)


TRAIN, TEST = recorded(RISE), recorded(RISE[::-1], 1)


@pytest.mark.parametrize("block", [PI.example(), GPI.example()], ids=lambda b: b.kind)
def test_the_check_covers_the_recorded_inputs(block: Block) -> None:
    check = check_inverse(block, RecordedInputs.of([TRAIN], ["pressure"]))
    assert check.error <= 1e-12
    assert np.ptp(check.pressure) > 0.9 * np.ptp(TRAIN["pressure"])
    assert np.all((check.pressure >= -1e-9) & (check.pressure <= 5 + 1e-9))


def test_the_check_keeps_names_and_units() -> None:
    block = replace(
        PiecewiseLinear.example(), input=Channel("stroke", "mm"), output=Channel("pull", "N")
    )
    recording = Recording({"stroke": TRAIN["displacement"]}, 0.02, units={"stroke": "mm"})
    check = check_inverse(block, RecordedInputs.of([recording], ["stroke"]))
    assert check.error <= 1e-12


def test_an_inverse_that_is_wrong_at_speed_is_refused() -> None:
    slow = replace(RateDependentPI.example(), rate_time_constant=0.0)
    fast = replace(slow, rate_weights=(-2.0, *slow.rate_weights[1:]))
    assert build_compensator(slow) == slow.inverse()
    with pytest.raises(ModelError):
        build_compensator(fast)


def test_what_is_expected_is_the_error_on_the_test() -> None:
    found = study([TRAIN], [TEST], models=["pi", "gpi", "mpi"], jobs=1)
    own, board = found.inverse, found.leaderboard
    assert own is not None
    assert board.best is not None
    assert own.model == board.best.model
    assert own.following_error == board.best.test_error
    assert own.following_interval == board.best.rmse_interval
    assert own.following_error < own.static_error
    assert own.check.error <= 1e-12
    assert found.passed_over == {}


def test_the_compensator_is_that_of_the_first_that_has_one() -> None:
    found = study([TRAIN], [TEST], models=["narx", "gpi"], jobs=1)
    order = [row.model for row in found.leaderboard.rows]
    assert found.inverse is not None
    assert found.inverse.model == "gpi"
    assert set(found.passed_over) == {*order[: order.index("gpi")]}


def test_no_compensator_where_a_static_map_does_as_well() -> None:
    """Without hysteresis and with noise, no model follows better than a curve."""
    noise = np.random.default_rng(2).standard_normal((2, RISE.size))
    runs = [
        Recording({"pressure": u, "displacement": 2 * u + 0.3 * e}, 0.02)
        for u, e in zip((RISE, RISE[::-1]), noise, strict=True)
    ]
    found = study([runs[0]], [runs[1]], models=["pi"], jobs=1)
    assert found.inverse is None
    assert set(found.passed_over) == {"pi"}


def test_inputs_driven_in_opposition_fill_a_line() -> None:
    half = Recording({"pressure_1": RISE, "pressure_2": 6.0 - RISE}, 0.02)
    space = RecordedInputs.of([half], ["pressure_1", "pressure_2"])
    moved = space.motion(1.0, 0)
    assert moved["pressure_1"] + moved["pressure_2"] == pytest.approx(6.0, abs=1e-9)
    assert np.ptp(moved["pressure_1"]) > 0.7 * np.ptp(RISE)
    on = np.column_stack([RISE, 6.0 - RISE])
    assert space.outside(on) == 0.0
    assert space.outside(on + 1.0) == 1.0
    assert space.outside(1.5 * (on - 3.0) + 3.0) > 0.2


def test_a_model_is_inverted_along_the_line_on_which_it_was_driven() -> None:
    """Its stored range would allow other pressures, whose motion that line does not reach."""
    drive = ((2.5, 1.0, 0.2), (2.5, -1.0, 0.8), (2.5, -0.2, -1.0))
    driven = replace(CROWDED, pressure_range=(0.0, 5.0), drive=drive)
    gauges = tuple(Affine(2.0, 1.0, c, Channel(f"gauge_{c.name}", "V")) for c in driven.driven)
    model = Series((driven.inverse(), PerChannel(gauges)))
    space = RecordedInputs.known(model)
    assert space is not None
    away = space.motion(1.0, 0).matrix(space.names)[:, :3] - 2.5
    ways = np.array(drive)[:, 1:]
    np.testing.assert_allclose(away @ np.linalg.svd(ways)[0][:, 2], 0.0, atol=1e-12)
    assert (np.ptp(away, axis=0) > np.sqrt(3.0) * np.abs(ways).max(axis=1)).all()
    assert build_compensator(model) == model.inverse()


def test_few_lengths_determine_no_high_degree() -> None:
    """Between four lengths, as good as a plane through them, and not a cubic through their noise."""
    rng = np.random.default_rng(0)
    pressure = rng.uniform(0, 4, (4, 300))
    length = np.repeat([[170.0], [180.0], [190.0], [200.0]], 300, axis=1)
    force = 30 * pressure + 2 * length + 15 * rng.standard_normal((4, 1))
    given = [np.column_stack(pair) for pair in zip(pressure, length, strict=True)]
    found = static_map(given, [row[:, np.newaxis] for row in force])
    between = np.column_stack([np.full(7, 2.0), np.linspace(170.0, 200.0, 7)])
    assert np.abs(np.diff(found(between)[:, 0], n=3)).max() < 1e-6


def test_commands_end_at_the_recorded_inputs_also_of_linear_models() -> None:
    estimator = load("estimators", "arx")().fit([TRAIN])
    stream = build_compensator(estimator.model_).stream(0.02)
    commands = np.array([stream.step(y)[0] for y in (10.0, 25.0, 5.0, 25.0)])
    ends = TRAIN["pressure"].min(), TRAIN["pressure"].max()
    assert stream.status == stream.CLIPPED
    assert ends == (pytest.approx(commands.min()), pytest.approx(commands.max()))


def test_recorded_commands_that_are_no_input_are_named() -> None:
    runs = [run.with_channels(command_pressure=run["pressure"]) for run in (TRAIN, TEST)]
    found = study(runs[:1], runs[1:], models=["gpi"], input="pressure", jobs=1).inverse
    assert found is not None
    assert found.commands == ("command_pressure",)


def test_the_static_map_is_a_polynomial_of_all_inputs() -> None:
    rng = np.random.default_rng(0)
    p, q = rng.uniform(0, 4, (2, 400))
    run = Recording({"pressure": p, "force": q, "displacement": 1 + p * q - 0.1 * p**3}, 0.02)
    split = given_split([run], [run])
    assert static_error(split, ("pressure", "force"), ("displacement",)) < 1e-4
    assert static_error(split, ("pressure",), ("displacement",)) > 1.0
