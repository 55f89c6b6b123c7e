"""Plans keep to their limits, and never lose to random motion by their own measure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import PI, Recording
from mckibben.blocks.base import Block
from mckibben.errors import DataError, ModelError
from mckibben.excitation.candidates import random_motion
from mckibben.excitation.information import Slopes, standard_errors
from mckibben.excitation.limits import (
    Limit,
    followed,
    narrowed,
    parsed,
)
from mckibben.excitation.planning import plan
from mckibben.excitation.plans import Plan

LIMITS = {"pressure": Limit(0.5, 4.0, 1.5, 0.5)}
GIVEN = {"pressure": (0.5, 4.0, 1.5)}
STEP = 0.02


def run_of(block: Block, commands: Recording, seed: int, noise: float = 0.02) -> Recording:
    """Record a plant that is the model itself, and white noise."""
    found = block.simulate(commands)
    name = block.outputs[0].name
    rng = np.random.default_rng(seed)
    return found.with_channels(
        {name: found.units[name]}, **{name: found[name] + noise * rng.standard_normal(len(found))}
    )


def slow_sine(seconds: float, low: float = 0.5, high: float = 4.0) -> Recording:
    time = STEP * np.arange(round(seconds / STEP))
    wave = low + (high - low) * (0.5 - 0.5 * np.cos(2 * np.pi * time / seconds))
    return Recording({"pressure": wave}, STEP)


@pytest.fixture(scope="module")
def play() -> Block:
    return PI.example()


@pytest.fixture(scope="module")
def first(play: Block) -> Plan:
    small = run_of(play, slow_sine(8.0, 0.5, 1.2), 0)
    return plan(small, model=play, minutes=0.75, limits=GIVEN, seed=1)


def test_commands_keep_to_limits_and_come_home(first: Plan) -> None:
    pressure = first.recording["pressure"]
    assert pressure.min() >= 0.5 - 1e-12
    assert pressure.max() <= 4.0 + 1e-12
    step = first.recording.sample_time or 1.0
    assert np.abs(np.diff(pressure)).max() <= 1.5 * step * (1 + 1e-9)
    assert pressure[0] == pytest.approx(0.5, abs=0.1)
    assert pressure[-1] == pytest.approx(pressure[0], abs=1e-9)
    assert first.recording.duration == pytest.approx(45.0, rel=0.08)


def test_a_plan_is_never_worse_than_random_motion_by_its_own_measure(first: Plan) -> None:
    for name, (now, after) in first.errors.items():
        assert after < now
        assert after <= first.random[name] * (1 + 1e-9)


def test_plans_are_the_same_for_the_same_seed(play: Block, first: Plan) -> None:
    small = run_of(play, slow_sine(8.0, 0.5, 1.2), 0)
    again = plan(small, model=play, minutes=0.75, limits=GIVEN, seed=1)
    assert again.recording == first.recording


def test_limits_are_read_and_narrowed() -> None:
    assert parsed(["a=1:2", "b=::3"]) == {"a": [1.0, 2.0], "b": [None, None, 3.0]}
    for text in ("a", "a=1", "a=1:2:3:4", "a=x:1", "=1:2"):
        with pytest.raises(DataError, match="CHANNEL=LOW:HIGH"):
            parsed([text])
    found = narrowed(LIMITS, {"pressure": [1.0, None]})["pressure"]
    assert found == Limit(1.0, 4.0, 1.5, 1.0)


def test_predicted_standard_errors_are_the_spread_of_estimates() -> None:
    """Least squares of a model of its own motion spreads as its slopes say (Gauss-Markov)."""
    block = PI.example()
    places = [0, 1, 2]
    values = block.pack()
    commands = followed(
        random_motion(600, STEP, 0.5, 4.0, 0.5, np.random.default_rng(3))[:, np.newaxis],
        np.array([0.5]),
        LIMITS,
        STEP,
    )
    own = Slopes(block, places, STEP)
    base, slopes, _ = own.over(commands, own.start(commands[0]))
    noise, matrix = 0.05, slopes[:, 0, :]
    said = standard_errors(matrix.T @ matrix / noise**2)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(200):
        away = noise * rng.standard_normal(len(base))
        found.append(np.linalg.lstsq(matrix, away, rcond=None)[0])
    assert np.std(found, axis=0) == pytest.approx(said, rel=0.2)
    assert (values[places] != 0).all()


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"limits": {"pressure": (4.0, 1.0)}}, "pressure"),
        ({"limits": {"pressure": (0.5, 4.0, 0.01)}}, "pressure"),
        ({"limits": {"pressure": (0.5, 4.0, 0.0)}}, "pressure"),
        ({"limits": {"pressure": (2.0, 2.0)}}, "pressure"),
        ({"limits": {"force": (0.0, 2.0)}}, "force"),
        ({"minutes": 0.01}, "--minutes"),
        ({"minutes": float("nan")}, "nan"),
        ({"goal": "nonsense"}, "nonsense"),
        ({"goal": ""}, "weights 1"),
        ({"rig": "rail"}, "voltage"),
        ({"muscle": "rail"}, "--muscle"),
        ({"sample_time": None}, "--rate"),
        ({"weights": 0.0}, "parameters"),
    ],
)
def test_the_impossible_is_refused(play: Block, how: dict[str, Any], said: str) -> None:
    recorded = run_of(play, slow_sine(8.0), 0)
    given: dict[str, Any] = {"minutes": 1.0, "model": play} | how
    if "sample_time" in given:
        recorded = replace(recorded, sample_time=given.pop("sample_time"))
    if "weights" in given:
        given["model"] = play.unpack(given.pop("weights") * play.pack())
    with pytest.raises((DataError, ModelError), match=said):
        plan(recorded, **given)


def test_limits_beyond_those_of_a_rig_are_refused() -> None:
    with pytest.raises(DataError, match="pressure"):
        plan(rig="mas20-hanging", limits={"pressure": (0.0, 30.0)})
