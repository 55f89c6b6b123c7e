"""Loops: on a plant simple enough to know the answer, and on the soft arm."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mckibben import PI, DataError, ModelError, Recording, load_rig
from mckibben.control import PID, DisturbanceObserver, Feedforward, FeedforwardPID, track, tune_pid


class Simple:
    """A plant that is a block: hysteresis, a first-order lag, and a load."""

    name = "simple"
    inputs = ("pressure",)
    outputs = ("pressure", "displacement")

    def __init__(self, lag: float = 0.0, load: float = 0.0, step: float = 0.02) -> None:
        self.lag, self.load, self.time = lag, load, step

    def changed(self, settings: Mapping[str, Any]) -> Simple:
        return Simple(self.lag, self.load, settings.get("sample_time", self.time))

    def limits(self, name: str) -> SimpleNamespace:
        return SimpleNamespace(low=0.0, high=5.0)

    def reset(self, seed: int = 0) -> np.ndarray:
        self.stream = BLOCK.stream()
        self.y = float(self.stream.step(0.0)[0])
        return np.array([0.0, self.y + self.load])

    def step(self, action: Any) -> np.ndarray:
        share = 1.0 if self.lag == 0 else 1 - np.exp(-self.time / self.lag)
        self.y += share * (float(self.stream.step(action["pressure"])[0]) - self.y)
        return np.array([action["pressure"], self.y + self.load])


BLOCK = PI.example()
LOW, HIGH = (float(end[0]) for end in BLOCK.reachable())


def reference(cycles: int = 3) -> Recording:
    t = np.arange(500 * cycles) * 0.02
    middle, half = 0.5 * (LOW + HIGH), 0.3 * (HIGH - LOW)
    return Recording({"displacement": middle + half * np.sin(2 * np.pi * t / 10)}, 0.02)


def test_an_exact_inverse_tracks_its_own_plant_exactly() -> None:
    found = track(Feedforward(BLOCK.inverse()), Simple(), reference(), pressure_loop=False)
    assert found.rmse["displacement"] < 1e-9 * (HIGH - LOW)
    assert found.clipped == 0
    assert {"reference_displacement", "command_pressure", "displacement"} <= set(
        found.recording.channels
    )


@pytest.mark.parametrize("kind", ["pid", "observer"])
def test_feedback_removes_a_load_that_no_model_knows(kind: str) -> None:
    plant = Simple(lag=0.05, load=-0.8)
    ahead = BLOCK.inverse()
    pid = tune_pid(plant, sample_time=0.02)
    controller = FeedforwardPID(ahead, pid) if kind == "pid" else DisturbanceObserver(ahead)
    blind = track(Feedforward(ahead), plant, reference(), settle=5.0, pressure_loop=False)
    seeing = track(controller, plant, reference(), settle=5.0, pressure_loop=False)
    assert blind.rmse["displacement"] > 0.7
    assert seeing.rmse["displacement"] < 0.2 * blind.rmse["displacement"]


def test_limits_and_slew_are_counted_with_their_cost() -> None:
    found = track(
        Feedforward(BLOCK.inverse()), Simple(), reference(), slew=0.5, pressure_loop=False
    )
    assert found.clipped > 0
    assert found.rmse["displacement"] > 0.01
    steps = np.diff(found.recording["command_pressure"])
    assert np.abs(steps).max() <= 0.5 * 0.02 + 1e-12


def test_integral_does_not_wind_up() -> None:
    pid = PID((0.1,), (1.0,), limits=(0.0, 5.0))
    pid.reset(0.02)
    far = np.array([100.0])
    for _ in range(1000):
        out = pid.step(far, np.zeros(1), np.empty(0))
    assert out[0] == 5.0
    for _ in range(60):
        out = pid.step(np.array([-10.0]), np.zeros(1), np.empty(0))
    assert out[0] < 5.0


def test_the_same_seed_gives_the_same_loop() -> None:
    pid = PID((0.05,), (0.2,), limits=(0.0, 5.0))
    first, again = (track(pid, Simple(), reference(1), noise=0.1, seed=3) for _ in range(2))
    np.testing.assert_array_equal(first.recording["displacement"], again.recording["displacement"])


def test_the_arm_follows_with_feedback() -> None:
    rig = load_rig("soft-arm")
    t = np.arange(400) * 0.05
    wave = 30.0 + 5.0 * np.sin(2 * np.pi * t / 20)
    wanted = Recording(
        {f"displacement_{k}": wave for k in (1, 2, 3)}
        | {"pressure_extensor": np.full(t.size, 1.0)},
        0.05,
    )
    pid = tune_pid(rig, sample_time=0.05, hold=6.0, scheduled={"pressure_extensor": 1.0})
    found = track(pid, rig, wanted, approach=10.0, settle=5.0)
    assert max(found.rmse.values()) < 1.0


def test_bad_loops_are_refused() -> None:
    controller = Feedforward(BLOCK.inverse())
    with pytest.raises(DataError, match="no displacement"):
        track(controller, Simple(), Recording({"pressure": np.ones(10)}, 0.02))
    with pytest.raises(DataError, match="no time"):
        track(controller, Simple(), Recording({"displacement": np.ones(10)}, None))
    with pytest.raises(ModelError, match="slew"):
        track(controller, Simple(), reference(), slew=-1.0)
    with pytest.raises(ModelError, match="nothing is left"):
        track(controller, Simple(), reference(1), settle=1e3)
    with pytest.raises(ModelError, match="kp, ki"):
        PID((1.0, 2.0), (1.0,))
    with pytest.raises(ModelError, match="filter_time"):
        DisturbanceObserver(BLOCK.inverse(), filter_time=0.0)


@pytest.mark.parametrize("behind", [False, True])
def test_a_controller_as_a_block_gives_the_same_pressures(behind: bool) -> None:
    pid = PID((0.05,), (0.2,), (0.002,), limits=(0.0, 2.0))
    controller = FeedforwardPID(BLOCK.inverse(), pid) if behind else pid
    stream = controller.block().stream(0.02)
    controller.reset(0.02)
    rng = np.random.default_rng(0)
    wanted = np.cumsum(rng.normal(0.0, 0.3, 400)) + 10.0
    for value, noise in zip(wanted, rng.normal(0.0, 1.0, 400), strict=True):
        reference, measured = np.array([value]), np.array([value + noise])
        expected = controller.step(reference, measured, np.empty(0))
        np.testing.assert_allclose(stream.step([value, value + noise]), expected, atol=1e-13)


def test_a_controller_that_is_no_block_says_so() -> None:
    with pytest.raises(ModelError, match=r"DisturbanceObserver is no block.*Remedy:"):
        DisturbanceObserver(BLOCK.inverse()).block()
