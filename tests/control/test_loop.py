"""Loops: on a plant simple enough to know the answer, and on the soft arm."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import PI, Affine, DataError, ModelError, Recording, Series, load, load_rig
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.feedback import FeedforwardFeedback, PIDFeedback
from mckibben.blocks.fields import Channel
from mckibben.control import DisturbanceObserver, Twin, control_law, track, tune_pid
from mckibben.control.pressure_loop import PressureLoop
from tests.refusals import refused

BLOCK = PI.example()
LOW, HIGH = (float(end[0]) for end in BLOCK.reachable())


def plant(load: float = 0.0) -> Twin:
    """Return a plant that is the block, under a load that it knows nothing of."""
    if not load:
        return Twin(BLOCK, sample_time=0.02)
    moved, share = BLOCK.output, 1 - float(np.exp(-0.02 / 0.05))
    lag = TransferFunction((share,), (share - 1,), 0.02, input=moved, output=moved)
    return Twin(Series((BLOCK, lag, Affine(1.0, load, moved, moved))))


def feedback(kp: float, ki: float, kd: float = 0.0, *, highest: float = 5.0) -> PIDFeedback:
    channels = (Channel("displacement", "mm"),), (Channel("pressure", "bar"),)
    return PIDFeedback.of(*channels, (kp,), (ki,), (kd,), limits=(0.0, highest))


def reference(cycles: int = 3) -> Recording:
    t = np.arange(500 * cycles) * 0.02
    middle, half = 0.5 * (LOW + HIGH), 0.3 * (HIGH - LOW)
    return Recording({"displacement": middle + half * np.sin(2 * np.pi * t / 10)}, 0.02)


@pytest.mark.parametrize("law", ["feedforward-pid", "observer"])
def test_feedback_removes_a_load_that_no_model_knows(law: str) -> None:
    loaded, ahead = plant(load=-0.8), BLOCK.inverse()
    controller = control_law(law, ahead, lambda: tune_pid(loaded, sample_time=0.02))
    blind = track(ahead, loaded, reference(), settle=5.0, pressure_loop=False)
    seeing = track(controller, loaded, reference(), settle=5.0, pressure_loop=False)
    assert blind.rmse["displacement"] > 0.7
    assert seeing.rmse["displacement"] < 0.2 * blind.rmse["displacement"]


def test_limits_and_slew_are_counted_with_their_cost() -> None:
    found = track(BLOCK.inverse(), plant(), reference(), slew=0.5, pressure_loop=False)
    assert found.clipped > 0
    assert found.rmse["displacement"] > 0.01
    steps = np.diff(found.recording["command_pressure"])
    assert np.abs(steps).max() <= 0.5 * 0.02 + 1e-12


def test_integral_does_not_wind_up() -> None:
    pid = feedback(0.1, 1.0).stream(0.02)
    for _ in range(1000):
        out = pid.step([100.0, 0.0])
    assert out[0] == 5.0
    for _ in range(60):
        out = pid.step([-10.0, 0.0])
    assert out[0] < 5.0


def test_noise_beyond_a_range_is_no_wish() -> None:
    names = [f"displacement_{k}" for k in (1, 2, 3)]
    pid = PIDFeedback.of(
        tuple(Channel(name, "mm") for name in names),
        tuple(Channel(f"pressure_{k}", "bar") for k in (1, 2, 3)),
        *[(0.0,) * 3] * 3,
        limits=(0.0, 2.5),
    )
    for first, is_refused in ((-0.02, False), (2.52, False), (-10.0, True), (17.0, True)):
        columns = dict.fromkeys(names, np.full(3, 30.0))
        extensor = np.array([first, 1.0, 1.0])
        wanted = Recording(columns | {"pressure_extensor": extensor}, 0.05)
        with pytest.raises(DataError) if is_refused else nullcontext():
            track(pid, load_rig("soft-arm"), wanted, approach=0.1)


def test_bad_loops_are_refused() -> None:
    controller = BLOCK.inverse()
    with refused(DataError, names="displacement"):
        track(controller, plant(), Recording({"pressure": np.ones(10)}, 0.02))
    with pytest.raises(DataError):
        track(controller, plant(), Recording({"displacement": np.ones(10)}, None))
    with refused(ModelError, parameter="slew"):
        track(controller, plant(), reference(), slew=-1.0)
    with refused(ModelError, parameter="settle"):
        track(controller, plant(), reference(1), settle=1e3)
    with refused(ModelError, parameter="ki"):
        PIDFeedback.of(BLOCK.outputs, BLOCK.inputs, (1.0, 2.0), (1.0,), limits=(0.0, 5.0))
    with refused(ModelError, names="'bang'"):
        control_law("bang", controller, PIDFeedback.example)
    with refused(ModelError, parameter="preview"):
        track(controller, plant(), reference(), preview=-1.0)
    with refused(ModelError, parameter="filter_time"):
        DisturbanceObserver(BLOCK.inverse(), filter_time=0.0)


class Scripted(Twin):
    """A plant that measures what stands in a table, whatever is applied."""

    def reset(self, seed: int = 0) -> np.ndarray:
        self.rows = iter(np.random.default_rng(seed).normal(10.0, 1.0, (1000, 1)))
        return next(self.rows)

    def step(self, action: Any) -> np.ndarray:
        return next(self.rows)


@pytest.mark.parametrize("behind", [False, True])
def test_what_is_tracked_is_what_the_saved_block_gives(behind: bool, tmp_path: Path) -> None:
    pid = feedback(0.05, 0.2, 0.002, highest=2.0)
    block = FeedforwardFeedback.of(BLOCK.inverse(), pid) if behind else pid
    table = Scripted(BLOCK, sample_time=0.02)
    found = track(block, table, reference(1), approach=0.0, pressure_loop=False).recording
    block.save(tmp_path / "controller.json")
    measured = found["displacement"]
    # what is due at a step was asked for at the one before
    asked = np.append(found["reference_displacement"][1:], reference(1)["displacement"][-1])
    stream = load(tmp_path / "controller.json").stream(0.02)
    again = [stream.step([r, y])[0] for r, y in zip(asked, measured, strict=True)]
    np.testing.assert_array_equal(np.clip(again, 0.0, 5.0), found["command_pressure"])


@pytest.mark.parametrize("step", [0.2, 0.6])
def test_in_long_steps_pressure_follows_what_is_asked_for(step: float) -> None:
    """What is seen has settled, and is a step old: a gain on it would swing from end to end."""
    loop = PressureLoop(np.array([0.0]), np.array([5.0]), step)
    pressure, off = np.zeros(1), []
    for place in range(200):  # up and down by more than what is slight in every step
        wanted = np.array([0.5 + 0.4 * abs(place % 20 - 10)])
        pressure = loop.step(wanted, pressure) - 0.1  # a regulator whose zero is off
        off.append(float(pressure[0] - wanted[0]))
    assert np.abs(off[50:]).max() < 0.6
    assert abs(np.mean(off[50:])) < 0.05


@pytest.mark.parametrize("lag", [0.0, 0.001, 0.01, 0.1, 0.5])
@pytest.mark.parametrize("step", [0.001, 0.005, 0.05])
def test_a_pressure_with_any_lag_follows_closer_than_without_the_loop(
    step: float, lag: float
) -> None:
    """Gains that a slow valve needs make the pressure of a fast one swing from end to end."""
    low, high = np.array([0.0]), np.array([5.0])
    share = 1.0 if lag == 0.0 else 1.0 - float(np.exp(-step / lag))

    def errors(looped: bool) -> np.ndarray:
        loop, pressure, missed = PressureLoop(low, high, step), np.zeros(1), []
        rng = np.random.default_rng(0)
        for time in step * np.arange(round(10.0 / step)):
            wanted = np.array([2.5 + 0.3 * np.sin(2 * np.pi * time)])
            seen = pressure + 0.005 * rng.standard_normal(1)
            command = loop.step(wanted, seen) if looped else wanted
            pressure = pressure + share * (command - pressure)
            missed.append(float(pressure[0] - wanted[0]))
        return np.array(missed[len(missed) // 2 :])

    rms = [float(np.sqrt(np.mean(errors(looped) ** 2))) for looped in (True, False)]
    assert rms[0] < max(0.75 * rms[1], 0.005)
