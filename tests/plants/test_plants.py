"""Plants are what they say they are: repeatable, plausible, and tested on motion that is new."""

from __future__ import annotations

import functools
import sys

import numpy as np
import pytest

from mckibben import Recording
from mckibben.arrays import Array
from tests.plants import DEVELOP, PLANTS, SEALED, Plant

every_plant = pytest.mark.parametrize("name", PLANTS)


@functools.cache
def drawn(name: str, seed: int = 0) -> Plant:
    return PLANTS[name](seed)


def checked(plant: Plant) -> list[Recording]:
    return [run for runs in plant.test.values() for run in runs]


def answer(
    name: str, first: Array, others: float | None = None, load: float | None = None
) -> Array:
    """Return the first output where the first pressure alone is moved, the others at mid-range."""
    plant = drawn(name)
    bench = plant.bench
    held = bench.middle if others is None else others
    pressures = np.full((first.size, len(bench.pressures)), held)
    pressures[:, 0] = first
    loads = np.full((first.size, len(bench.loads)), bench.load if load is None else load)
    return plant.respond(pressures, loads)[:, 0]


def slow_loop(name: str, others: float | None = None) -> tuple[float, float]:
    """Return width at mid-range and stroke of the second of two slow loops."""
    bench = drawn(name).bench
    one = round(100.0 / bench.sample_time)
    share = 0.5 * (1.0 - np.cos(2 * np.pi * np.arange(2 * one) / one))
    swing = bench.high * (0.13 + 0.7 * share)
    moved, swing = answer(name, swing, others)[one:], swing[one:]
    rising, falling = slice(0, one // 2), slice(None, one // 2, -1)
    up = np.interp(bench.middle, swing[rising], moved[rising])
    down = np.interp(bench.middle, swing[falling], moved[falling])
    return float(abs(down - up)), float(np.ptp(moved))


def test_every_plant_is_for_developing_or_sealed() -> None:
    assert sorted(DEVELOP + SEALED) == sorted(PLANTS)
    assert all(drawn(name).name == name for name in PLANTS)


@every_plant
def test_a_seed_draws_the_same_runs_again_and_another_seed_others(name: str) -> None:
    plant, again, other = drawn(name), PLANTS[name](0), drawn(name, 1)
    assert plant.train == again.train
    assert plant.test == again.test
    assert plant.facts == again.facts == other.facts
    assert all(one != another for one, another in zip(plant.train, other.train, strict=True))
    assert 60.0 <= sum(run.duration or 0.0 for run in plant.train) <= 120.0


@every_plant
def test_runs_are_what_the_plant_answers_but_for_noise(name: str) -> None:
    plant = drawn(name)
    bench = plant.bench
    pressure_noise, output_noise = bench.noise
    runs = [*plant.train, *checked(plant)]
    for run in runs:
        pressures, seen = run.matrix(bench.pressures), run.matrix(bench.outputs)
        assert np.ptp(seen[:, 0]) > 100 * output_noise
        assert pressures.min() > -5 * pressure_noise
        assert pressures.max() < bench.high + 5 * pressure_noise
    for run in runs[:1] if plant.facts.get("one_session") else runs:
        answered = plant.respond(run.matrix(bench.pressures), _loads(plant, run))
        error = np.std(run.matrix(bench.outputs) - answered, axis=0)
        assert (0.5 * output_noise < error).all()
        assert (error < 4 * output_noise).all()  # its inputs are as noisy


@every_plant
def test_a_loop_closed_by_and_by_is_the_same_motion(name: str) -> None:
    plant = drawn(name)
    bench, run = plant.bench, plant.train[0]
    pressures = bench.allowed(run.matrix(bench.pressures)[:200])
    loads = np.full((len(pressures), len(bench.loads)), bench.load)
    motion = plant.move(np.tile(pressures[0], (len(pressures), 1)), loads)
    outputs = []
    for k, row in enumerate(pressures):
        motion.commands[k] = row
        outputs.append(next(motion.outputs))
    answered = plant.respond(pressures, loads)
    assert np.array_equal(np.reshape(outputs, answered.shape), answered)


@every_plant
def test_answers_stay_finite_whatever_is_asked(name: str) -> None:
    assert np.isfinite(answer(name, np.tile([-50.0, 0.0, 50.0, 2.0], 200))).all()


@every_plant
def test_loops_are_wide_as_friction_and_stiffness_have_it(name: str) -> None:
    width, stroke = slow_loop(name)
    assert 0.05 < width / stroke < 0.20
    # relaxation, viscosity and the line add to it
    assert 0.9 < width / float(drawn(name).facts["loop_width"]) < 1.7  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "name", ["lugre_muscle", "load_rig", "lifter", "pushing_rig", "soft_finger"]
)
def test_outputs_move_from_where_the_facts_say(name: str) -> None:
    plant = drawn(name)
    command = np.linspace(0.0, 2.0, round(100.0 / plant.bench.sample_time))
    moved = answer(name, command)
    begins = command[np.flatnonzero(moved > 0.002 * np.ptp(moved))[0]]
    assert begins == pytest.approx(plant.facts["lifts_from"], abs=0.1)


@every_plant
def test_no_five_seconds_of_test_are_in_train(name: str) -> None:
    plant = drawn(name)
    size = round(5.0 / plant.bench.sample_time)
    windows = np.concatenate([_windows(plant, run, size) for run in plant.train])
    for run in checked(plant):
        for window in _windows(plant, run, size)[:: size // 20]:
            apart = np.sqrt(np.mean((windows - window) ** 2, axis=(1, 2)))
            assert apart.min() > 0.008


@every_plant
def test_steps_are_short_enough(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plant = drawn(name)
    run = plant.train[0]
    pressures, loads = run.matrix(plant.bench.pressures), _loads(plant, run)
    answered = plant.respond(pressures, loads)
    module = sys.modules[f"tests.plants.{name}"]
    monkeypatch.setattr(module, "SUBSTEPS", 2 * module.SUBSTEPS)
    assert np.std(answered - plant.respond(pressures, loads)) < plant.bench.noise[1]


def test_loops_of_the_arm_widen_with_pressure_of_the_others() -> None:
    assert slow_loop("three_muscle_arm", 4.5)[0] > 1.2 * slow_loop("three_muscle_arm", 1.0)[0]


def test_a_rig_gives_way_by_its_static_stiffness() -> None:
    # friction is on one side on both ways up, so that it falls out but for what grows with the pull
    still = np.full(6000, 3.0)
    soft, hard = (answer("pushing_rig", still, load=load)[-1] for load in (65.0, 75.0))
    (stiffness,) = drawn("pushing_rig").facts["static_stiffness"]  # type: ignore[misc]
    assert 10.0 / (soft - hard) == pytest.approx(stiffness, rel=0.1)


def test_the_finger_vents_slowly_and_stops_at_the_wall() -> None:
    command = np.repeat([0.0, 2.4, 0.0], 500)
    free, held = (answer("soft_finger", command, load=wall) for wall in (0.0, 1.0))
    assert np.argmax(free[1000:] < 0.6) > 1.5 * np.argmax(free[500:1000] > 0.6)
    assert held.max() < 1.05 < 1.1 < free.max()


def test_the_lifter_softens_in_ten_minutes() -> None:
    once = 5.0 * np.bartlett(2000)
    lifts = answer("lifter", np.tile(once, 30)).reshape(30, -1).max(axis=1)
    assert 0.5 < lifts[-1] - lifts[1] < 3.0
    assert np.all(np.diff(lifts) > 0.0)


def _loads(plant: Plant, run: Recording) -> Array:
    names = plant.bench.loads
    return run.matrix(names) if names else np.empty((run.n_samples, 0))


def _windows(plant: Plant, run: Recording, size: int) -> Array:
    """Return stretches of pressures and loads, each by its scale, at 20 points: (n, channels, 20)."""
    bench = plant.bench
    pressures = run.matrix(bench.pressures) / bench.high
    known = np.hstack([pressures, _loads(plant, run) / (bench.load or 1.0)])
    cut = np.lib.stride_tricks.sliding_window_view(known, size, axis=0)
    return np.ascontiguousarray(cut[:: size // 50, :, :: size // 20])
