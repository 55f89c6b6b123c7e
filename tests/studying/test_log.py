"""A log looked back on: the cause that was put in is named first, and shares add up to the error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben import PI, DataError, ModelError, Recording, review
from mckibben.blocks.adaptive import adaptive
from mckibben.blocks.predictive import Predictive
from mckibben.control import track
from mckibben.files.headers import channel_of, parse
from mckibben.studying.refitting import Refit
from mckibben.studying.reviewing import Followed
from tests.cli.conftest import cli as cli  # a fixture
from tests.studying.plants import Faulty

MUSCLE = PI(thresholds=(0.0, 0.3, 0.8, 1.5), weights=(4.0, 1.0, 0.6, 0.4))
STEP = 0.02

FAULTS = {
    "noise": {"noise": 0.05},
    "model": {"gain": 0.88, "noise": 0.05},
    "actuator": {"lag": 0.15, "noise": 0.05},
    "delay": {"late": 8, "noise": 0.05},
    "drift": {"drift": 2.5, "noise": 0.05},
    "limits": {"high": 3.0, "noise": 0.05},
}
"""Cause -> a plant that has it."""


def reference(seed: int, duration: float = 40.0) -> Recording:
    """Return two sines of random phase, within reach [mm]."""
    t = np.arange(0, duration, STEP)
    one, other = np.random.default_rng(seed).uniform(0, 6, 2)
    wave = 0.3 * np.sin(2 * np.pi * t / 9 + one) + 0.15 * np.sin(2 * np.pi * t / 3.7 + other)
    return Recording({"displacement": 1 + 24 * (0.5 + wave)}, STEP)


def logged(seed: int = 0, **faults: float) -> tuple[Recording, float]:
    """Return the log of a loop with faults, and the RMSE that the loop itself reckoned."""
    plant = Faulty(MUSCLE, **faults)  # type: ignore[arg-type]
    found = track(MUSCLE.inverse(), plant, reference(seed), pressure_loop=False, seed=seed)
    return found.recording, found.rmse["displacement"]


def first(log: Recording, **known: object) -> Followed:
    """Return what is found of the one output."""
    return review(log, refit=False, **(known or {"model": MUSCLE})).outputs[0]  # type: ignore[arg-type]


@pytest.mark.parametrize("cause", FAULTS)
def test_the_cause_that_was_put_in_is_named_first(cause: str) -> None:
    log, rmse = logged(0, **FAULTS[cause])
    found = first(log, compensator=MUSCLE.inverse())
    assert found.causes[0].kind == cause
    assert found.achieved == pytest.approx(rmse, rel=1e-9)
    error = found.measured - found.reference
    assert np.allclose(np.sum([c.signal for c in found.causes], axis=0), error, atol=1e-9)


def test_a_delay_is_told_with_its_interval() -> None:
    late = first(logged(0, late=8, noise=0.05)[0]).delays[0]
    assert late.interval[0] < 8 * STEP < late.interval[1]
    assert late.interval[1] - late.interval[0] < STEP
    pressure = review(logged(0, dead=8, noise=0.05)[0], model=MUSCLE, refit=False).delays[0]
    assert pressure.seconds == pytest.approx(8 * STEP, abs=STEP / 4)


def test_no_delay_is_certain_where_there_is_none() -> None:
    certain = 0
    for seed in range(6):
        found = review(logged(seed, noise=0.05)[0], model=MUSCLE, refit=False)
        certain += any(d.certain for d in (*found.delays, *found.outputs[0].delays))
    assert certain <= 1  # in 5 % of the logs


def test_a_refit_is_recommended_where_the_muscle_changed_and_only_there() -> None:
    changed = review(logged(0, gain=0.85, noise=0.05)[0], model=MUSCLE).refit
    assert isinstance(changed, Refit)
    assert changed.recommended
    assert changed.new < 0.2 * changed.old
    same = review(logged(0, noise=0.1)[0], model=MUSCLE).refit
    assert isinstance(same, Refit)
    assert not same.recommended


def test_without_commands_pressures_are_compared_with_the_compensators() -> None:
    log, _ = logged(0, lag=0.15, noise=0.05)
    found = review(
        log.select(["reference_displacement", "pressure", "displacement"]),
        model=MUSCLE,
        refit=False,
    )
    assert found.judged_by == "compensator"
    assert found.outputs[0].causes[0].kind == "actuator"
    blind = log.select(["reference_displacement", "command_pressure", "displacement"])
    assert review(blind, model=MUSCLE, refit=False).judged_by == ""


def test_what_is_no_log_is_refused() -> None:
    log, _ = logged(0, noise=0.05)
    for bad, said in (
        (log.select(["pressure", "displacement"]), "reference"),
        (log.select(["reference_displacement", "displacement"]), "command_pressure"),
        (log.slice(1000, 1030), "30"),
    ):
        with pytest.raises(DataError, match=said):
            review(bad, model=MUSCLE)
    with pytest.raises(ModelError, match="--model"):
        review(log)


@pytest.mark.parametrize(
    ("header", "channel"),
    [
        ("reference", "reference_displacement"),
        ("setpoint", "reference_displacement"),
        ("desired [mm]", "reference_displacement"),
        ("ref_mm", "reference_displacement"),
        ("Position setpoint (cm)", "reference_displacement"),
        ("ref_force_N", "reference_force"),
        ("command", "command_pressure"),
        ("p_cmd_kPa", "command_pressure"),
        ("pressure_setpoint_bar", "command_pressure"),
        ("cmd_p2 [bar]", "command_pressure_2"),
        ("command_voltage", "voltage"),
        ("ref_x_mm", "ref_x"),
    ],
)
def test_headers_of_loops_are_known(header: str, channel: str) -> None:
    assert channel_of(parse(header)) == channel


def test_what_learns_and_what_plans_is_asked_as_the_loop_asks_it() -> None:
    """It then gives the commands of the log, so that nothing is laid to feedback."""
    stronger = replace(MUSCLE, weights=tuple(1.15 * weight for weight in MUSCLE.weights))
    learning = adaptive(MUSCLE, 10.0, 0.05)
    log = track(learning, Faulty(stronger), reference(0), pressure_loop=False).recording
    found = review(log, compensator=learning, refit=False)
    assert not found.feedback
    assert found.outputs[0].causes[0].kind == "model"
    plans = Predictive(MUSCLE.inverse(), horizon=10, rate_limit=1.0, pressure_range=(0.0, 8.0))
    log = track(plans, Faulty(MUSCLE), reference(0), pressure_loop=False).recording
    found = review(log, compensator=plans, refit=False)
    assert not found.feedback
    followed = found.outputs[0]
    assert followed.predicted == pytest.approx(followed.achieved, rel=1e-3)
    assert followed.causes[0].kind == "compensator"
