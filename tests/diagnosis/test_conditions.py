"""What is not the muscle's own changes no verdict: zeros of sensors, and other inputs."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import PI, DataError, Recording
from mckibben.diagnosis.characterization import characterize
from mckibben.signals import staircase
from tests.refusals import refused

STEP = 0.01
TIME = np.arange(3000) * STEP
SLOW = 2.5 - 2.5 * np.cos(2 * np.pi * TIME / 10.0)
MUSCLE = PI((0.0, 0.4), (2.0, 4.0), 0.0, (0.0, 5.0))


def run(zero: float, seed: int) -> Recording:
    noise = 0.01 * np.random.default_rng(seed).standard_normal(TIME.size)
    return Recording({"pressure": SLOW, "displacement": MUSCLE.simulate(SLOW) + noise + zero}, STEP)


@pytest.mark.parametrize("zeros", [(0.0, 80.0), (-300.0, 0.02, 250.0)])
def test_zeros_of_recordings_change_no_verdict(zeros: tuple[float, ...]) -> None:
    same = characterize([run(0.0, seed) for seed, _ in enumerate(zeros)])
    moved = characterize([run(zero, seed) for seed, zero in enumerate(zeros)])
    assert moved.has_loop
    for name in ("loop_width", "gain", "mid_width", "branch_gap"):
        assert getattr(moved, name) == pytest.approx(getattr(same, name), rel=0.05, abs=0.02), name


def two(other: np.ndarray) -> Recording:
    """Return three cycles of one input, a rest, and whatever another input does in all that."""
    u = np.concatenate([SLOW, np.zeros(1000)])
    y = MUSCLE.simulate(u) + 7.0 * other
    noise = 0.005 * np.random.default_rng(3).standard_normal(u.size)
    return Recording({"pressure_1": u, "pressure_2": other, "displacement": y + noise}, STEP)


def test_what_another_input_does_is_not_taken_for_the_own() -> None:
    still = two(np.zeros(4000))
    ramps = np.concatenate([np.zeros(3000), np.linspace(0, 4, 500), np.full(500, 4.0)])
    clean = characterize(still, "pressure_1", "displacement")
    told = characterize(two(ramps), "pressure_1", "displacement")
    apart = characterize(two(ramps), "pressure_1", "displacement", scheduling=["pressure_2"])
    assert told == apart  # channels of one quantity are inputs all
    assert abs(apart.creep or 0.0) < 0.1
    assert apart.loop_width == pytest.approx(clean.loop_width, rel=0.02)
    assert apart.n_recordings == apart.n_stretches == 1


def test_a_payload_that_steps_within_branches_is_refused() -> None:
    u = staircase(TIME, [0.0, 3.0, 1.0, 4.0], hold=7.0, ramp=0.5)
    payload = np.where(TIME % 7.5 > 3.0, 20.0, 5.0)
    run = Recording({"pressure": u, "displacement": u - 0.1 * payload, "force": payload}, STEP)
    with refused(DataError, channel="pressure", names="force"):
        characterize(run)


def test_inputs_that_move_as_one_are_refused() -> None:
    one = two(0.5 * np.concatenate([SLOW, np.zeros(1000)])).slice(0, 3000)
    with refused(DataError, channel="pressure_1", names="pressure_2"):
        characterize(one, "pressure_1", "displacement", scheduling=["pressure_2"])


def isometric(length: float, gain: float, gap: float, seed: int) -> Recording:
    """Return three cycles of force at a length, whose branches are apart by some of its range."""
    lag = gap * np.sin(2 * np.pi * TIME / 10.0)
    noise = 0.5 * np.random.default_rng(seed).standard_normal(TIME.size)
    force = gain * (SLOW - lag) - 5 * length + noise
    still = np.full(TIME.size, length)
    return Recording({"pressure": SLOW, "displacement": still, "force": force}, STEP)


LENGTHS = ((0.0, 200.0, 0.1), (10.0, 140.0, -0.05), (20.0, 70.0, -0.2))
"""Held, with the gain there; loops that go round either way hide each other."""


@pytest.mark.parametrize("asked", [(), ("displacement",)])
def test_every_held_length_has_its_loop_and_its_gain(asked: tuple[str, ...]) -> None:
    runs = [isometric(*each, seed) for seed in range(2) for each in LENGTHS]
    found = characterize(runs, output="force", scheduling=asked)
    assert found.has_loop
    assert [level.held for level in found.levels] == [
        (("displacement", length, "mm"),) for length, _, _ in LENGTHS
    ]
    for level, (length, gain, gap) in zip(found.levels, LENGTHS, strict=True):
        alone = characterize(
            [isometric(length, gain, gap, seed) for seed in range(2)], output="force"
        )
        assert level.found.gain == pytest.approx(gain, rel=0.05)
        assert level.found.loop_width == alone.loop_width
    assert (found.gain, found.loop_width) == (
        found.levels[0].found.gain,
        found.levels[0].found.loop_width,
    )
    assert (found.n_recordings, found.n_samples) == (6, 6 * TIME.size)
    assert sorted(cycle.recording for cycle in found.cycles) == sorted(3 * list(range(6)))
