"""Plans stay within limits, close the data gaps, and start and end at rest."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import PI, Recording, data_gaps, load_rig, plan
from mckibben.blocks.base import Block
from mckibben.errors import DataError
from mckibben.parsers import limits as limits_of
from mckibben.planning.limits import Limit, limits_as_wanted
from mckibben.planning.motion import motion
from mckibben.report.words import plan_sentences
from tests.diagnosis.lacking import Recorder
from tests.refusals import refused

GIVEN = {"pressure": (0.5, 4.0, 1.5)}
STEP = 0.02


def run_of(block: Block, commands: Recording, seed: int, noise: float = 0.02) -> Recording:
    """Record a plant that is the model itself, and white noise."""
    found = block.simulate(commands)
    name = block.outputs[0].name
    away = noise * np.random.default_rng(seed).standard_normal(len(found))
    return found.with_channels({name: found.units[name]}, **{name: found[name] + away})


def slow_sine(seconds: float, low: float = 0.5, high: float = 4.0) -> Recording:
    time = STEP * np.arange(round(seconds / STEP))
    wave = low + (high - low) * (0.5 - 0.5 * np.cos(2 * np.pi * time / seconds))
    return Recording({"pressure": wave}, STEP)


@pytest.fixture(scope="module")
def play() -> Block:
    return PI.example()


@pytest.mark.parametrize("seed", range(5))
def test_commands_keep_to_limits_and_come_home(seed: int) -> None:
    limits = {
        "pressure": Limit(0.5, 4.0, 1.5, 0.7),
        "force": Limit(0.0, 90.0, 60.0, 0.0),
        "torque": Limit(2.0, 2.0, 1.0, 2.0),
    }
    parts = motion(limits, 60.0, STEP, True, np.random.default_rng(seed))
    commands = np.concatenate([part for _, part in parts])
    assert len(commands) == pytest.approx(60.0 / STEP, abs=1)
    for column, limit in zip(commands.T, limits.values(), strict=True):
        assert column.min() >= limit.low
        assert column.max() <= limit.high
        assert np.abs(np.diff(column)).max() <= limit.rate * STEP * (1 + 1e-6)
        assert column[0] == column[-1] == pytest.approx(limit.rest)


@pytest.mark.parametrize("plant", ["lugre_muscle", "antagonistic_joint", "lifter"])
def test_a_plan_closes_every_gap_that_motion_can(plant: str) -> None:
    own = Recorder(plant, 0)
    first = own.record(own.moving(own.cycles)[-1500:])
    found = plan(first, minutes=2.0, seed=3)
    assert {"rate", "minor loops", "creep"} <= {gap.what for gap in found.gaps}
    assert {gap.what for gap in found.gaps} == {what for one in found.steps for what in one.gaps}
    low, high = np.transpose(own.ends)
    shares = (found.recording.matrix([*own.pressures, *own.loads]) - low) / (high - low)
    assert not data_gaps([first, own.record(shares)])
    assert plan(first, minutes=2.0, seed=3).recording == found.recording
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["seconds"] == pytest.approx(
        120.0, abs=0.03
    )


def test_a_plan_without_recordings_has_all_kinds_of_motion() -> None:
    found = plan(rig="mas20-hanging", minutes=2.0)
    assert {step.what for step in found.steps} >= {"random", "repeats", "holds"}


def test_limits_are_read_and_narrowed() -> None:
    assert limits_of("b=::3") == ("b", (None, None, 3.0))
    for text in ("a", "a=1", "a=1:2:3:4", "a=x:1", "=1:2"):
        with pytest.raises(ValueError):
            limits_of(text)
    limits = {"pressure": Limit(0.5, 4.0, 1.5, 0.5)}
    assert limits_as_wanted(limits, {"pressure": [1.0, None]})["pressure"] == Limit(
        1.0, 4.0, 1.5, 1.0
    )


def test_what_goes_beyond_recordings_is_told(play: Block) -> None:
    recorded = run_of(play, slow_sine(8.0, 1.5, 3.0), 0)
    ends = (1.5, 3.0), (1.5, 4.0), (0.5, 3.0), (0.5, 4.0)
    narrow, *wide = (plan(recorded, minutes=0.75, limits={"pressure": each}) for each in ends)
    assert narrow.extrapolated == ()
    for one in wide:  # above, below, or both
        assert one.extrapolated == ("pressure",)
        assert len(plan_sentences(one)) == len(plan_sentences(narrow)) + 1


@pytest.mark.parametrize(
    ("how", "fields"),
    [
        ({"limits": {"pressure": (4.0, 1.0)}}, {"channel": "pressure"}),
        ({"limits": {"pressure": (0.5, 4.0, 0.01)}}, {"channel": "pressure"}),
        ({"limits": {"pressure": (0.5, 4.0, 0.0)}}, {"channel": "pressure"}),
        ({"limits": {"pressure": (2.0, 2.0)}}, {"parameter": "limits", "names": "pressure"}),
        ({"limits": {"force": (0.0, 2.0)}}, {"channel": "force"}),
        ({"minutes": 0.01}, {"channel": "pressure", "names": "minutes"}),
        ({"minutes": float("nan")}, {"parameter": "minutes", "names": "nan"}),
        ({"rig": "rail"}, {"channel": "voltage"}),
        ({"sample_time": None}, {"channel": "time", "names": "rate"}),
    ],
)
def test_the_impossible_is_refused(
    play: Block, how: dict[str, Any], fields: dict[str, Any]
) -> None:
    recorded = run_of(play, slow_sine(8.0), 0)
    given: dict[str, Any] = {"minutes": 1.0} | how
    if "sample_time" in given:
        recorded = replace(recorded, sample_time=given.pop("sample_time"))
    with refused(**fields):
        plan(recorded, **given)


def test_limits_beyond_those_of_a_rig_are_refused() -> None:
    with refused(DataError, channel="pressure"):
        plan(rig=load_rig("mas20-hanging"), limits={"pressure": (0.0, 30.0)})
