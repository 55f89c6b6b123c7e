"""Identification of a balance of forces: it finds its own kind and keeps to physics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import DataError, ModelError, Recording
from mckibben.arrays import Array
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.fields import DISPLACEMENT, FORCE, PRESSURE
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.memoryless.contact import Contact
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.estimators.coupled.balance_loads import under
from mckibben.estimators.coupled.balance_slopes import run
from mckibben.estimators.optimisers.constrained import constrained_least_squares
from mckibben.signals.broadband import random_wave

STEP = 0.05
NOISE = 0.02

MUSCLE = Balance(
    springs=((5.0, 8.0),),
    elasticity=((40.0, 30.0),),
    areas=((60.0, -35.0, -5.0),),
    friction=((6.0, 4.0, 1.5),),
    relaxation=((1.5, 1.0),),
    loads=((1.0,),),
    damping=(0.1,),
    lines=(0.04,),
    walls=(0.0,),
    limits=(0.05, 0.3, 1.2),
    grip=0.6,
    lags=(1.0, 12.0),
    hull=((-8.0, 40.0),),
    scale=40.0,
    degree=1,
    driven=(DISPLACEMENT,),
    scheduled=(FORCE,),
    given=(PRESSURE,),
)


def recording(
    seed: int,
    strongest: float = 60.0,
    n: int = 1200,
    *,
    noise: float = NOISE,
    sign: float = 1.0,
    muscle: Balance = MUSCLE,
    highest: float = 0.3,
) -> Recording:
    """Return a muscle under a load, both moving at random from rest, at frequencies up to one [Hz]."""
    time = np.arange(n) * STEP
    rises = np.minimum(time / 2.0, 1.0)
    p = rises * random_wave(time, highest, 4.0, seed=seed)
    force = rises * random_wave(time, highest * 2.0 / 3.0, strongest, seed=100 + seed)
    y = muscle.inverse().simulate(np.column_stack([p, force]), sample_time=STEP)[:, 0]
    y = y + noise * np.random.default_rng(seed).standard_normal(n)
    channels = {"pressure": p, "displacement": y, "force": sign * force}
    return Recording(channels, STEP, meta={"name": f"run-{seed}"})


@pytest.fixture(scope="module")
def found() -> BalanceEstimator:
    return BalanceEstimator().fit([recording(seed) for seed in (1, 2)])


def balance_of(estimator: BalanceEstimator) -> Balance:
    block = estimator.fitted
    solved = block.parts[0] if isinstance(block, Series) else block
    assert isinstance(solved, Inverse)
    forward = solved.forward
    assert isinstance(forward, Balance)
    return forward


def error(estimator: BalanceEstimator, on: Recording) -> float:
    return float(np.sqrt(np.mean((estimator.predict(on)[0] - on["displacement"]) ** 2)))


def test_it_recovers_a_muscle_of_its_own_kind(found: BalanceEstimator) -> None:
    # its stops break away at other travels than those of the muscle
    assert found.diagnostics_.rmse < 2.5 * NOISE
    assert error(found, recording(3)) < 3.0 * NOISE
    balance = balance_of(found)
    np.testing.assert_allclose(balance.lags, MUSCLE.lags, rtol=0.35)
    np.testing.assert_allclose(balance.areas[0][0], 60.0, rtol=0.05)
    assert balance.loads == ((1.0,),)


def test_loads_beyond_those_trained_enter_as_they_are(found: BalanceEstimator) -> None:
    assert error(found, recording(4, strongest=140.0)) < 0.15


def test_a_dead_zone_is_found_where_there_is_one(found: BalanceEstimator) -> None:
    assert isinstance(found.fitted, Inverse)
    filled = Series((Contact(0.15), MUSCLE.inverse()))

    def dead(seed: int) -> Recording:
        plain = recording(seed)
        moved = filled.simulate(plain.select(["pressure", "force"]))["displacement"]
        noise = NOISE * np.random.default_rng(seed).standard_normal(len(plain))
        return plain.with_channels({}, displacement=moved + noise)

    estimator = BalanceEstimator().fit([dead(1), dead(2)])
    (contact, _) = estimator.fitted.parts  # type: ignore[attr-defined]
    assert 0.07 < contact.pressure < 0.3
    assert error(estimator, dead(3)) < 0.1


def test_a_mass_is_found_by_how_fast_it_swings() -> None:
    heavy = replace(MUSCLE, mass=(0.02,))
    *train, other = (recording(seed, muscle=heavy, highest=2.0) for seed in (1, 2, 3))
    errors = []
    for told in (False, True):
        estimator = BalanceEstimator(mass=told).fit(train)
        errors.append(error(estimator, other))
    assert errors[1] < 3.0 * NOISE < 0.5 * errors[0]
    np.testing.assert_allclose(balance_of(estimator).mass, 0.02, rtol=0.2)


def test_it_keeps_to_physics(found: BalanceEstimator) -> None:
    b = balance_of(found)
    assert min(*b.friction[0], *b.relaxation[0], b.damping[0], b.lines[0], b.walls[0], b.grip) >= 0
    y = np.linspace(b.hull[0][0], b.hull[0][1], 200)
    u = y / b.scale
    area = sum(a * u**i for i, a in enumerate(b.areas[0]))
    taken = sum(h * (r + b.walls[0]) for h, r in zip(b.friction[0], b.limits, strict=True))
    assert float(np.min(area - taken)) > 0
    elastic = sum(e * i * u ** (i - 1) for i, e in enumerate(b.elasticity[0], start=2)) / b.scale
    for p in (0.0, 4.0):
        narrows = sum(a * i * u ** (i - 1) for i, a in enumerate(b.areas[0]) if i) / b.scale
        assert float(np.min(b.springs[0][1] + elastic - p * narrows)) > -1e-6


def test_lengths_that_fall_from_afar_are_the_same_to_it(found: BalanceEstimator) -> None:
    runs = [
        run_.with_channels({}, displacement=250.0 - run_["displacement"])
        for run_ in map(recording, (1, 2))
    ]
    other = BalanceEstimator().fit(runs)
    assert other.diagnostics_.rmse < 2.5 * NOISE


def test_held_muscles_are_learned_from_by_their_force() -> None:
    """At a length of its own, where it has long been: the same muscle is found."""
    time = np.arange(600) * STEP
    p = np.minimum(time / 2.0, 1.0) * random_wave(time, 0.3, 4.0, seed=8)
    y = np.full((600, 1), 15.0)
    lacking, _ = run(
        MUSCLE.coefficients(STEP),
        np.ascontiguousarray(p[:, np.newaxis]),
        y,
        np.zeros((600, 1)),
        held=True,
        settled=True,
    )
    channels = {"pressure": p, "displacement": y[:, 0], "force": -lacking[:, 0]}
    free = [recording(1), recording(2)]
    estimator = BalanceEstimator().fit([*free, Recording(channels, STEP)])
    assert error(estimator, recording(3)) < 3.0 * NOISE
    np.testing.assert_allclose(balance_of(estimator).lags, MUSCLE.lags, rtol=0.35)


def hung(seed: int, weight: float, n: int = 1000) -> Recording:
    """Return a muscle under a weight, driven at random from rest."""
    time = np.arange(n) * STEP
    p = np.minimum(time / 2.0, 1.0) * random_wave(time, 0.3, 4.0, seed=seed)
    force = np.full(n, weight)
    y = MUSCLE.inverse().simulate(np.column_stack([p, force]), sample_time=STEP)[:, 0]
    y = y + NOISE * np.random.default_rng(seed).standard_normal(n)
    return Recording({"pressure": p, "displacement": y, "force": force}, STEP)


def test_weights_that_nobody_measured_are_found() -> None:
    runs = [
        hung(seed, 40.0 * (seed - 1)).select(["pressure", "displacement"]) for seed in (1, 2, 3)
    ]
    estimator = BalanceEstimator().fit(runs)
    found = estimator.loads_[:, 0] * 60.0  # bar on an area at rest of 60 N/bar
    np.testing.assert_allclose(found, [0.0, 40.0, 80.0], atol=1.0)
    assert estimator.diagnostics_.rmse < 2.5 * NOISE
    assert error(estimator, hung(4, 0.0)) < 3.0 * NOISE  # under the load of the first
    heavier = under(estimator.fitted, estimator.loads_[1])
    other = hung(5, 40.0)
    missed = heavier.simulate(other.select(["pressure"]))["displacement"] - other["displacement"]
    assert np.sqrt(np.mean(missed**2)) < 3.0 * NOISE


TAUT = replace(MUSCLE, walls=(0.1,))
SLACK = replace(TAUT, springs=((-20.0, 4.0),), bladders=(4.0,), pushes=(6.0,))


HEAVY = replace(TAUT, mass=(0.01,))


@pytest.mark.parametrize("block", [TAUT, SLACK, HEAVY])
def test_slopes_are_those_of_differences(block: Balance) -> None:
    some = recording(6, n=300)
    p, y, x = (
        np.ascontiguousarray(some[name][:, np.newaxis])
        for name in ("pressure", "displacement", "force")
    )

    def at(values: Array) -> Array:
        changed = replace(
            block.unpack(values[: block.n_parameters]),
            lags=tuple(np.exp(values[block.n_parameters :])),
        )
        return run(changed.coefficients(STEP), p, y, x, held=False)[0][:, 0]

    values = np.concatenate([block.pack(), np.log(block.lags)])
    exact = run(block.coefficients(STEP), p, y, x, held=False)[1][:, 0]
    width = exact.shape[1] - 1 - len(block.lags)
    # the block packs tables first, then damping, lines, walls, grip, bladders, pushes and mass;
    # coefficients have hull, wall, push, damping, line, bladder and mass first
    late = ([6, 3] if block.pushes else []) + ([7] if block.mass else [])
    places = [*range(8, width), 4, 5, 2, width, *late, *range(width + 1, exact.shape[1])]
    for place, column in enumerate(places):
        step = np.zeros(values.size)
        step[place] = 1e-6 * (abs(values[place]) or 0.1)
        slope = (at(values + step) - at(values - step)) / (2 * step[place])
        missed = np.abs(slope - exact[:, column])
        # but for the samples at which a stop just breaks away
        assert np.quantile(missed, 0.97) < 1e-4 * (np.abs(slope).max() + 1e-6), place


def test_least_squares_within_inequalities_meet_the_conditions_of_optimality() -> None:
    rng = np.random.default_rng(0)
    slopes, target = rng.standard_normal((40, 6)), rng.standard_normal(40)
    sides, least = rng.standard_normal((9, 6)), 0.3 * rng.standard_normal(9)
    x, pressed = constrained_least_squares(slopes, target, sides, least)
    assert (sides @ x - least > -1e-12).all()
    assert (pressed >= 0).all()
    np.testing.assert_allclose(pressed * (sides @ x - least), 0.0, atol=1e-9)
    np.testing.assert_allclose(slopes.T @ (slopes @ x - target), sides.T @ pressed, atol=1e-9)
    x, pressed = constrained_least_squares(slopes, target, np.eye(6), np.zeros(6))
    assert (pressed > 0).any()
    assert (x[pressed > 0] == 0.0).all()
    with pytest.raises(ModelError):
        constrained_least_squares(slopes, target, np.eye(6)[[0, 0]] * [[1.0], [-1.0]], np.ones(2))


def test_recordings_that_begin_under_a_pressure_long_held_count_as_a_whole() -> None:
    def held(seed: int) -> Recording:
        time = np.arange(1200) * STEP
        p = 1.5 + np.minimum(time / 2.0, 1.0) * (random_wave(time, 0.3, 4.0, seed=seed) - 1.5)
        block = replace(MUSCLE, settled=True).inverse()
        y = block.simulate(np.column_stack([p, 0.0 * p]), sample_time=STEP)[:, 0]
        y = y - y[0] + NOISE * np.random.default_rng(seed).standard_normal(len(p))
        return Recording({"pressure": p, "displacement": y}, STEP)

    estimator = BalanceEstimator().fit([held(1), held(2)])
    assert balance_of(estimator).settled
    assert estimator.diagnostics_.rmse < 2.5 * NOISE
    assert error(estimator, held(3)) < 3.0 * NOISE


def test_what_recordings_cannot_tell_is_left_out() -> None:
    steady = recording(1)
    steady = steady.with_channels({}, force=np.full(len(steady), 20.0))
    told = BalanceEstimator(steps=2).fit(steady)
    assert [channel.name for channel in told.fitted.inputs] == ["pressure"]

    time = np.arange(800) * STEP
    p = 4.0 * np.abs(2.0 * (time / 8.0 % 1.0) - 1.0)[::-1]
    y = MUSCLE.inverse().simulate(np.column_stack([p, 0 * p]), sample_time=STEP)[:, 0]
    same = BalanceEstimator(steps=2).fit(Recording({"pressure": p, "displacement": y}, STEP))
    assert not balance_of(same).lags


def test_what_has_the_wrong_sign_or_does_not_move_is_refused_by_name() -> None:
    def fit(*runs: Recording, **settings: Any) -> None:
        BalanceEstimator(**settings).fit(list(runs))

    first, second, third = (recording(seed) for seed in (1, 2, 3))
    turned = second.with_channels({}, displacement=-second["displacement"])
    pushed = recording(2, sign=-1.0)
    weights = [hung(seed, weight) for seed, weight in enumerate((0.0, 30.0, 60.0))]
    both = {"pressure_1": first["pressure"], "pressure_2": first["pressure"][::-1].copy()}
    moved = {
        "displacement_1": first["displacement"],
        "displacement_2": 1e-4 * first["displacement"],
    }
    for runs, said in (
        ((recording(1, sign=-1.0), pushed), "force"),
        ((first, pushed, third), "run-2.*force"),
        ([run_.with_channels({}, force=-run_["force"]) for run_ in weights], "force"),
        ((first, turned, third), "run-2.*displacement"),
        ((Recording(both | moved, STEP),), "displacement_2"),
    ):
        with pytest.raises((DataError, ModelError), match=said):
            fit(*runs)
    fit(*weights)
    for settings in ({"lags": (12.0, 1.0)}, {"n_lags": 10}, {"lags": (5.0, 500.0)}):
        with pytest.raises(ModelError, match="lags"):
            fit(first, **settings)
