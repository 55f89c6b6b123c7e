"""Plants are what they say they are: repeatable, plausible, and tested on motion that is new."""

from __future__ import annotations

import functools
import sys

import numpy as np
import pytest

from mckibben import Recording
from mckibben.arrays import Array
from tests.plants import DEVELOP, PLANTS, SEALED, Plant

NAMES = tuple(PLANTS)
MIDDLE, LOW, HIGH = 3.0, 0.8, 5.0  # bar


@functools.cache
def drawn(name: str, seed: int) -> Plant:
    return PLANTS[name](seed)


def checked(plant: Plant) -> list[Recording]:
    return [run for runs in plant.test.values() for run in runs]


def slow_loop(plant: Plant, others: float = MIDDLE) -> tuple[float, float]:
    """Return width at mid-range and stroke of the first output while its muscle alone is moved."""
    one = round(40.0 / plant.bench.sample_time)
    swing = LOW + (HIGH - LOW) * 0.5 * (1.0 - np.cos(2 * np.pi * np.arange(2 * one) / one))
    pressures = np.full((2 * one, len(plant.bench.pressures)), others)
    pressures[:, 0] = swing
    loads = np.full(
        (2 * one, len(plant.bench.loads)),
        _first(plant, "weight") if "force" in plant.bench.loads else 0.0,
    )
    moved, swing = plant.respond(pressures, loads)[one:, 0], swing[one:]
    rising, falling = slice(0, one // 2), slice(None, one // 2, -1)
    up = np.interp(MIDDLE, swing[rising], moved[rising])
    down = np.interp(MIDDLE, swing[falling], moved[falling])
    return float(down - up), float(np.ptp(moved))


def test_every_plant_is_for_developing_or_sealed() -> None:
    assert sorted(DEVELOP + SEALED) == sorted(NAMES)
    assert all(drawn(name, 0).name == name for name in NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_seed_draws_the_same_runs_again_and_another_seed_others(name: str) -> None:
    plant, again, other = drawn(name, 0), PLANTS[name](0), drawn(name, 1)
    assert plant.train == again.train
    assert plant.test == again.test
    assert plant.facts == again.facts == other.facts
    assert all(one != another for one, another in zip(plant.train, other.train, strict=True))


@pytest.mark.parametrize("name", NAMES)
def test_runs_are_what_the_plant_answers_but_for_noise(name: str) -> None:
    plant = drawn(name, 0)
    bench = plant.bench
    for run in (*plant.train, *checked(plant)):
        answer = plant.respond(run.matrix(bench.pressures), _loads(plant, run))
        seen = run.matrix(bench.outputs)
        assert np.isfinite(answer).all()
        assert np.ptp(seen[:, 0]) > 100 * bench.output_noise
        assert np.std(seen - answer) < 3 * bench.output_noise
        pressures = run.matrix(bench.pressures)
        assert pressures.min() > -5 * bench.pressure_noise
        assert pressures.max() < 6.0


@pytest.mark.parametrize("name", NAMES)
def test_train_and_test_are_of_like_size(name: str) -> None:
    plant = drawn(name, 0)
    train = sum(run.duration or 0.0 for run in plant.train)
    test = sum(run.duration or 0.0 for run in checked(plant))
    assert 60.0 <= train <= 120.0
    assert 0.8 <= test / train <= 1.3


@pytest.mark.parametrize("name", NAMES)
def test_loops_are_wide_as_friction_and_stiffness_have_it(name: str) -> None:
    plant = drawn(name, 0)
    width, stroke = slow_loop(plant)
    assert 0.05 < width / stroke < 0.20
    friction = _first(plant, "friction_torque" if "friction_torque" in plant.facts else "friction")
    stiffness = _first(
        plant, "joint_stiffness" if "torque" in plant.bench.loads else "static_stiffness"
    )
    expected = 2 * friction / stiffness
    assert 0.9 < width / expected < 1.7  # relaxation, viscosity and the line add to it


def test_loops_of_the_arm_widen_with_pressure_of_the_others() -> None:
    arm = drawn("three_muscle_arm", 0)
    assert slow_loop(arm, others=4.5)[0] > 1.2 * slow_loop(arm, others=1.0)[0]


@pytest.mark.parametrize("name", NAMES)
def test_no_five_seconds_of_test_are_in_train(name: str) -> None:
    plant = drawn(name, 0)
    size = round(5.0 / plant.bench.sample_time)
    windows = np.concatenate([_windows(plant, run, size) for run in plant.train])
    for run in checked(plant):
        for window in _windows(plant, run, size)[:: size // 20]:
            apart = np.sqrt(np.mean((windows - window) ** 2, axis=(1, 2)))
            assert apart.min() > 0.05  # bar, or 10 N, or N m


@pytest.mark.parametrize("name", NAMES)
def test_steps_are_short_enough(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plant = drawn(name, 0)
    run = plant.train[0]
    pressures, loads = run.matrix(plant.bench.pressures), _loads(plant, run)
    answer = plant.respond(pressures, loads)
    module = sys.modules[PLANTS[name].__module__]
    monkeypatch.setattr(module, "SUBSTEPS", 2 * module.SUBSTEPS)
    finer = plant.respond(pressures, loads)
    assert np.std(answer - finer) < plant.bench.output_noise


def _first(plant: Plant, fact: str) -> float:
    """Return a fact, of the first muscle where it is of each."""
    known = plant.facts[fact]
    return float(known[0] if isinstance(known, tuple) else known)


def _loads(plant: Plant, run: Recording) -> Array:
    names = plant.bench.loads
    return run.matrix(names) if names else np.empty((run.n_samples, 0))


def _windows(plant: Plant, run: Recording, size: int) -> Array:
    """Return stretches of pressures and loads at 20 points each, shape (n, channels, 20)."""
    loads = _loads(plant, run) * (0.1 if "force" in plant.bench.loads else 1.0)
    known = np.hstack([run.matrix(plant.bench.pressures), loads])
    cut = np.lib.stride_tricks.sliding_window_view(known, size, axis=0)
    return np.ascontiguousarray(cut[:: size // 50, :, :: size // 20])
