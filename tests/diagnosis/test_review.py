"""A log looked back on: parts add up to the error, and intervals hold what was put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben import PI, DataError, ModelError, Recording, review
from mckibben.blocks.adaptive import adaptive
from mckibben.control import track
from mckibben.diagnosis.review import Delay, Refit, Review
from mckibben.files.headers import channel_of, parse
from tests.cli.conftest import cli as cli  # a fixture
from tests.diagnosis.faulty import Faulty
from tests.refusals import refused

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


def found_in(log: Recording, **known: object) -> Review:
    return review(log, refit=False, **(known or {"model": MUSCLE}))  # type: ignore[arg-type]


def within(delay: Delay, seconds: float) -> bool:
    return delay.interval[0] < seconds < delay.interval[1]


@pytest.mark.parametrize("cause", FAULTS)
def test_parts_add_up_to_the_error_that_the_loop_reckoned(cause: str) -> None:
    log, rmse = logged(0, **FAULTS[cause])
    one = found_in(log, compensator=MUSCLE.inverse()).outputs[0]
    assert one.achieved == pytest.approx(rmse, rel=1e-9)
    error = one.measured - one.reference
    assert np.allclose(np.sum(list(one.parts.values()), axis=0), error, atol=1e-9)
    sizes = {"model": one.residual, "pressure": one.pressure, "command": one.predicted}
    largest = {"actuator": "pressure", "limits": "command"}.get(cause, "model")
    assert max(sizes, key=lambda part: sizes[part] or 0.0) == largest


def test_the_delay_of_motion_or_pressure_is_in_its_interval() -> None:
    late = found_in(logged(0, late=8, noise=0.05)[0]).delays[-1]
    assert within(late, 8 * STEP)
    assert late.interval[1] - late.interval[0] < STEP
    log = logged(0, dead=8, noise=0.05)[0]
    assert found_in(log).delays[0].seconds == pytest.approx(8 * STEP)
    # whether commands are logged when they are sent, or beside their reference
    beside = np.append(log["command_pressure"][:1], log["command_pressure"][:-1])
    found = found_in(log.with_channels(command_pressure=beside))
    assert found.delays[0].seconds == pytest.approx(8 * STEP)


def test_intervals_of_delay_and_drift_hold_zero_where_there_is_none() -> None:
    """In 95 % of logs, of white and of correlated noise."""
    missed = 0
    for seed in range(20):
        log, _ = logged(seed, noise=0.05)
        rng = np.random.default_rng(seed)
        slow = np.convolve(0.05 * rng.standard_normal(len(log) + 39), np.ones(40) / 6, "valid")
        log = log.with_channels(displacement=log["displacement"] + slow)
        found = found_in(log)
        one = found.outputs[0]
        missed += not within(found.delays[-1], 0.0)
        missed += not one.drift_interval[0] < 0 < one.drift_interval[1]
    assert missed <= 6  # of 40; the 99 % point of a binomial distribution at 5 % is 6


def test_a_drift_is_in_its_interval() -> None:
    one = found_in(logged(0, drift=2.5, noise=0.05)[0]).outputs[0]
    assert one.drift_interval[0] > 0 or one.drift_interval[1] < 0


def test_commands_at_a_limit_are_counted() -> None:
    assert found_in(logged(0, high=3.0)[0]).clipped > 100
    assert found_in(logged(0)[0]).clipped == 0


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
    found = found_in(log.select(["reference_displacement", "pressure", "displacement"]))
    assert found.judged_by == "compensator"
    one = found.outputs[0]
    assert (one.pressure or 0.0) > one.residual
    blind = log.select(["reference_displacement", "command_pressure", "displacement"])
    assert len(found_in(blind).delays) == 1


def test_what_is_no_log_is_refused() -> None:
    log, _ = logged(0, noise=0.05)
    for bad, channel in (
        (log.select(["pressure", "displacement"]), "reference_displacement"),
        (log.select(["reference_displacement", "displacement"]), "pressure"),
    ):
        with refused(DataError, channel=channel):
            review(bad, model=MUSCLE)
    with refused(ModelError, parameter="model"):
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


def test_commands_of_a_log_stand_for_a_compensator_that_learns() -> None:
    learning = adaptive(MUSCLE, 10.0, 0.05)
    stronger = replace(MUSCLE, weights=tuple(1.15 * weight for weight in MUSCLE.weights))
    log = track(learning, Faulty(stronger), reference(0), pressure_loop=False).recording
    found = found_in(log, compensator=learning)
    assert found.judged_by == "command"
    assert found.outputs[0].residual > 0
    silent = log.select(["reference_displacement", "pressure", "displacement"])
    assert found_in(silent, compensator=learning).outputs[0].predicted is None
