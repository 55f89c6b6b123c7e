"""Four virtual plants are what they say: repeatable, finite, noisy as told, and true to their facts."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben.arrays import Array
from mckibben.recording import Recording
from tests.plants import Plant, continuum_section, lifter, pushing_rig, soft_finger
from tests.plants.courses import through

MODULES = {
    "lifter": lifter,
    "soft_finger": soft_finger,
    "continuum_section": continuum_section,
    "pushing_rig": pushing_rig,
}
LOADS = {"lifter": 30.0, "soft_finger": 0.0, "pushing_rig": 70.0}


def recordings(plant: Plant) -> list[Recording]:
    return [*plant.train, *(run for runs in plant.test.values() for run in runs)]


def answer(name: str, command: Array, load: float | None = None) -> Array:
    """Return the first output under a constant load; of three muscles the first is inflated."""
    module = MODULES[name]
    if name == "continuum_section":
        alone = np.column_stack([command, 0 * command, 0 * command])
        return module.respond(alone, np.zeros((command.size, 0)))[:, 0]
    loads = np.full((command.size, 1), LOADS[name] if load is None else load)
    return module.respond(command[:, None], loads)[:, 0]


@pytest.mark.parametrize("name", MODULES)
def test_one_seed_gives_one_plant_and_another_seed_another(name: str) -> None:
    plants = [MODULES[name].plant(seed) for seed in (1, 1, 2)]
    first, again, other = map(recordings, plants)
    assert plants[0].name == name
    assert first == again
    assert all(one != two for one, two in zip(first, other, strict=True))
    assert plants[0].facts == plants[2].facts


@pytest.mark.parametrize("name", MODULES)
def test_runs_are_of_the_told_length_and_range(name: str) -> None:
    plant = MODULES[name].plant(3)
    assert 60.0 <= sum(run.duration or 0.0 for run in plant.train) <= 120.0
    for run in recordings(plant):
        assert run.sample_time in (0.01, 0.02)
        for channel in run.channels:
            if channel.startswith("pressure"):
                assert run[channel].min() > -0.02
                assert run[channel].max() < MODULES[name].HIGH + 0.02


@pytest.mark.parametrize("name", MODULES)
def test_records_are_the_noise_free_answer_and_noise(name: str) -> None:
    module = MODULES[name]
    run = module.plant(4).train[0]
    given = [channel for channel in run.channels if channel.startswith("pressure")]
    outputs = [channel for channel in run.channels if channel.startswith(("displacement", "angle"))]
    loads = [channel for channel in run.channels if channel in ("force", "wall")]
    answered = module.respond(run.matrix(given), run.matrix(loads) if loads else np.zeros((9, 0)))
    assert answered.shape == (run.n_samples, len(outputs))
    # its inputs are as noisy, so that it is but near
    error = np.std(run.matrix(outputs) - answered)
    assert 0.0003 * module.SPAN < error < 0.003 * module.SPAN


@pytest.mark.parametrize("name", MODULES)
def test_loops_are_as_wide_as_those_of_real_muscles(name: str) -> None:
    module = MODULES[name]
    once = through([module.HIGH], 20.0, module.STEP)
    output = answer(name, np.tile(once, 2))[once.size :]
    half = once.size // 2
    width = np.max(np.abs(output[:half] - output[half:][::-1])) / np.ptp(output)
    assert 0.05 < width < 0.20


@pytest.mark.parametrize("name", MODULES)
def test_answers_stay_finite_whatever_is_asked(name: str) -> None:
    wild = np.tile([-50.0, 0.0, 50.0, 2.0], 200)
    assert np.isfinite(answer(name, wild)).all()


@pytest.mark.parametrize(
    ("name", "moved"), [("lifter", 0.0), ("soft_finger", 0.002), ("pushing_rig", 0.05)]
)
def test_dead_zones_end_where_the_facts_say(name: str, moved: float) -> None:
    module = MODULES[name]
    command = np.linspace(0.0, 2.0, round(100.0 / module.STEP))
    begins = command[np.flatnonzero(answer(name, command) > moved)[0]]
    assert begins == pytest.approx(module.facts()["dead_zone"], abs=0.05)


def test_a_rig_gives_way_by_its_static_stiffness() -> None:
    command = np.full(6000, 3.0)
    # friction is on one side on both ways up, so that it falls out but for what grows with the pull
    soft, hard = (answer("pushing_rig", command, load)[-1] for load in (65.0, 75.0))
    assert 10.0 / (soft - hard) == pytest.approx(pushing_rig.facts()["static_stiffness"], rel=0.1)


def test_the_finger_vents_slowly_and_stops_at_the_wall() -> None:
    command = np.repeat([0.0, 2.4, 0.0], 500)
    free, held = (answer("soft_finger", command, wall) for wall in (0.0, 1.0))
    filling = np.argmax(free[500:1000] > 0.6)
    venting = np.argmax(free[1000:] < 0.6)
    assert venting > 1.5 * filling
    assert free.max() > 1.1
    assert held.max() < 1.05


def test_the_lifter_softens_in_ten_minutes() -> None:
    once = through([5.0], 20.0, lifter.STEP)
    lifts = answer("lifter", np.tile(once, 30)).reshape(30, -1).max(axis=1)
    assert 0.5 < lifts[-1] - lifts[1] < 3.0
    assert np.all(np.diff(lifts) > 0.0)


def test_even_pressures_leave_a_section_of_even_bellows_nearly_straight() -> None:
    even = np.full((400, 3), 1.5)
    tip = continuum_section.respond(even, np.zeros((400, 0)))[-1]
    assert 1.0 < np.hypot(*tip) < 0.25 * continuum_section.SPAN
