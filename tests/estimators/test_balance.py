"""Identification of a balance of forces: it finds its own kind and keeps to physics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import DataError, ModelError, ModelWarning, Recording
from mckibben.blocks.base import Block
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.coupled.balance import Balance, Placed, balance_in
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.fields import DISPLACEMENT, FORCE, PRESSURE, Channel
from mckibben.blocks.memoryless import PiecewiseLinear
from mckibben.estimators.coupled.balance import TERMS, BalanceEstimator
from mckibben.estimators.coupled.balance_bench import with_loads
from mckibben.estimators.coupled.balance_slopes import run
from mckibben.rigs import load_rig
from mckibben.signals.broadband import random_wave
from tests.refusals import refused

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
    limits=(0.5, 3.0, 12.0),
    friction_growth=0.94,
    highest_pressure=9.4,
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


def behind(front: Block, seed: int) -> Recording:
    """Return a recording of the muscle behind what acts in front of it."""
    plain = recording(seed, noise=0.0)
    moved = Series((front, MUSCLE.inverse())).simulate(plain.select(["pressure", "force"]))
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(plain))
    return plain.with_channels({}, displacement=moved["displacement"] + noise)


@pytest.fixture(scope="module")
def found() -> BalanceEstimator:
    return BalanceEstimator().fit([recording(seed) for seed in (1, 2)])


def placed(estimator: BalanceEstimator) -> Placed:
    found = balance_in(estimator.fitted)
    assert found is not None
    return found


def balance_of(estimator: BalanceEstimator) -> Balance:
    return placed(estimator).balance


def error(estimator: BalanceEstimator, on: Recording) -> float:
    missed = estimator.predict(on).ravel() - on["displacement"]
    return float(np.sqrt(np.mean(missed**2)))


# -- what it finds -------------------------------------------------------------------------------


def test_it_recovers_a_muscle_of_its_own_kind(found: BalanceEstimator) -> None:
    # its stops break away at other travels than those of the muscle
    assert found.diagnostics_.rmse < 1.5 * NOISE
    assert error(found, recording(3)) < 1.5 * NOISE
    balance = balance_of(found)
    np.testing.assert_allclose(balance.lags, MUSCLE.lags, rtol=0.2)
    np.testing.assert_allclose(balance.areas[0][0], 60.0, rtol=0.05)
    assert balance.loads == ((1.0,),)


def test_loads_beyond_those_trained_enter_as_they_are(found: BalanceEstimator) -> None:
    assert error(found, recording(4, strongest=140.0)) < 0.1


def test_a_load_that_counts_the_other_way_is_the_same(found: BalanceEstimator) -> None:
    turned = BalanceEstimator().fit([recording(seed, sign=-1.0) for seed in (1, 2)])
    assert balance_of(turned).loads == ((-1.0,),)
    assert turned.diagnostics_.rmse == pytest.approx(found.diagnostics_.rmse, rel=1e-4)


def test_a_dead_zone_is_found() -> None:
    lost = PiecewiseLinear((0.0, 0.3, 0.6), (0.0, 0.006, 0.306), PRESSURE, PRESSURE)
    estimator = BalanceEstimator().fit([behind(lost, 1), behind(lost, 2)])
    (zone,) = placed(estimator).before
    assert isinstance(zone, PiecewiseLinear)
    assert zone.knots[1] == pytest.approx(0.3, rel=0.05)
    assert error(estimator, behind(lost, 3)) < 1.5 * NOISE


def test_times_of_filling_and_venting_are_found() -> None:
    air = Air(1.0, 0.0, 0.0, 0.3, 0.6, ambient=None, input=PRESSURE, output=PRESSURE)
    estimator = BalanceEstimator().fit([behind(air, 1), behind(air, 2)])
    first = placed(estimator).before[0]
    assert isinstance(first, Air)
    assert first.filling_time == pytest.approx(0.3, rel=0.1)
    assert first.venting_time == pytest.approx(0.6, rel=0.1)
    # commands make up for it within the pressures recorded
    compensator = estimator.fitted.inverse()
    low, high = compensator.reachable()
    wanted = np.repeat([5.0, 25.0, 5.0], 200)
    with pytest.warns(ModelWarning, match="clipped"):
        given = compensator.simulate(np.column_stack([wanted, 0.0 * wanted]), sample_time=STEP)
    assert low[0] <= given.min() < given.max() <= high[0] < 4.1


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("mass", {"mass": (0.02,)}),
        ("obstacle", {"obstacles": ((1.0, 8.0, 40.0),)}),
    ],
)
def test_terms_are_added_that_a_muscle_has(kind: str, change: dict[str, Any]) -> None:
    muscle = replace(MUSCLE, **change)
    *train, other = (recording(seed, muscle=muscle, highest=1.0) for seed in (1, 2, 3))
    estimator, without = BalanceEstimator().fit(train), BalanceEstimator(terms=()).fit(train)
    assert kind in estimator.terms_
    assert {*estimator.terms_} <= {*TERMS}
    assert error(estimator, other) < 1.5 * NOISE
    assert error(without, other) > 1.2 * error(estimator, other)


@pytest.mark.parametrize(
    ("field", "value"), [("walls", (0.3,)), ("asymmetry", 0.4)]
)  # of which each can stand for the other where friction is the same along the way
def test_friction_that_differs_by_direction_is_followed(field: str, value: Any) -> None:
    muscle = replace(MUSCLE, **{field: value})
    *train, other = (recording(seed, muscle=muscle) for seed in (1, 2, 3))
    estimator = BalanceEstimator().fit(train)
    assert error(estimator, other) < 1.5 * NOISE


def test_terms_that_may_not_be_added_are_none(found: BalanceEstimator) -> None:
    plain = BalanceEstimator(terms=()).fit([recording(1), recording(2)])
    assert plain.terms_ == ()
    assert plain.fitted.n_parameters < found.fitted.n_parameters
    assert not placed(plain).before


def test_what_is_found_has_a_standard_error(found: BalanceEstimator) -> None:
    values, errors = found.fitted.pack(), np.array(found.diagnostics_.standard_errors)
    names = list(found.fitted.parameter_names)
    place = names.index("area at rest")
    assert 0.0 < errors[place] < 0.05 * values[place]
    assert values[place] == pytest.approx(60.0, rel=0.02)  # its stops are not those of the muscle
    assert np.isnan(errors[names.index("share of force")])  # it sets the unit of forces
    assert names.index("share of force") not in found.undetermined()


def test_it_keeps_to_physics(found: BalanceEstimator) -> None:
    b = balance_of(found)
    assert (
        min(*b.friction[0], *b.relaxation[0], b.damping[0], *b.lines, b.walls[0], b.friction_growth)
        >= 0
    )
    y = np.linspace(b.hull[0][0], b.hull[0][1], 200)
    u = y / b.scale
    area = sum(a * u**i for i, a in enumerate(b.areas[0]))
    most = max(1.0, b.asymmetry or 1.0)
    rise = most * b.friction_growth / b.highest_pressure
    taken = sum(h * (rise * r + b.walls[0]) for h, r in zip(b.friction[0], b.limits, strict=True))
    assert float(np.min(area - taken)) > 0
    elastic = sum(e * i * u ** (i - 1) for i, e in enumerate(b.elasticity[0], start=2)) / b.scale
    for p in (0.0, 4.0):
        narrows = sum(a * i * u ** (i - 1) for i, a in enumerate(b.areas[0]) if i) / b.scale
        assert float(np.min(b.springs[0][1] + elastic - p * narrows)) > -1e-6


# -- how recordings may be -----------------------------------------------------------------------


def test_lengths_that_fall_from_afar_are_the_same_to_it() -> None:
    runs = [
        one.with_channels({}, displacement=250.0 - one["displacement"])
        for one in map(recording, (1, 2, 3))
    ]
    other = BalanceEstimator().fit(runs[:2])
    assert other.diagnostics_.rmse < 1.5 * NOISE
    assert error(other, runs[2]) < 1.5 * NOISE


def test_a_fit_does_not_depend_on_units(found: BalanceEstimator) -> None:
    for name, unit in {"pressure": 10.0, "displacement": 1e-3, "force": 1e3}.items():
        runs = [
            one.with_channels(**{name: unit * one[name]}) for one in (recording(1), recording(2))
        ]
        rmse = BalanceEstimator().fit(runs).diagnostics_.rmse
        rmse /= unit if name == "displacement" else 1.0
        assert rmse == pytest.approx(found.diagnostics_.rmse, rel=0.01), name


def test_held_muscles_are_learned_from_by_their_force() -> None:
    """At a length of its own, where it has long been: the same muscle is found."""
    time = np.arange(600) * STEP
    p = np.minimum(time / 2.0, 1.0) * random_wave(time, 0.3, 4.0, seed=8)
    y = np.full(600, 15.0)
    lacking, _ = run(
        MUSCLE.coefficients(STEP), p[:, np.newaxis], y[:, np.newaxis], np.zeros((600, 1)), held=True
    )
    held = Recording({"pressure": p, "displacement": y, "force": -lacking[:, 0]}, STEP)
    estimator = BalanceEstimator().fit([recording(1), recording(2), held])
    assert error(estimator, recording(3)) < 1.5 * NOISE
    lags = np.array(balance_of(estimator).lags)
    # what relaxes slowly may be shared by two time constants
    assert all(np.abs(lags / lag - 1.0).min() < 0.2 for lag in MUSCLE.lags)


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
    np.testing.assert_allclose(found, [0.0, 40.0, 80.0], atol=2.0)
    assert estimator.diagnostics_.rmse < 2.0 * NOISE
    assert error(estimator, hung(4, 0.0)) < 2.5 * NOISE  # under the load of the first


def test_every_recording_has_its_load_also_one_that_is_left_out() -> None:
    runs = [hung(1, 0.0), hung(2, 40.0)]
    still = dict.fromkeys(("pressure", "displacement"), np.zeros(400))
    runs = [run.select(["pressure", "displacement"]) for run in runs] + [Recording(still, STEP)]
    estimator = BalanceEstimator(unknown_load=True, steps=2, n_stops=2, terms=()).fit(runs)
    assert estimator.loads_.shape == (3, 1)
    assert estimator.loads_[1] > 0.0
    assert not estimator.loads_[[0, 2]].any()


def test_what_a_missing_load_is_does_not_depend_on_samples_that_do_not_count() -> None:
    first, second = recording(1), recording(2).select(["pressure", "displacement"])
    counting = np.arange(len(first)) >= 600
    _, filled = with_loads([first, second], ["force"], [counting, np.ones(len(second), dtype=bool)])
    np.testing.assert_allclose(filled["force"], first["force"][600:].mean())


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
    assert estimator.diagnostics_.rmse < 1.5 * NOISE
    assert error(estimator, held(3)) < 2.5 * NOISE


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


def test_what_does_not_move_or_means_nothing_is_refused_by_name() -> None:
    first = recording(1)
    both = {"pressure_1": first["pressure"], "pressure_2": first["pressure"][::-1].copy()}
    moved = {
        "displacement_1": first["displacement"],
        "displacement_2": 1e-4 * first["displacement"],
    }
    with refused((DataError, ModelError), channel="displacement_2"):
        BalanceEstimator().fit(Recording(both | moved, STEP))
    with refused(ModelError, parameter="terms", names="magic"):
        BalanceEstimator(terms=("mass", "magic")).fit(first)
    with refused(ModelError, parameter="unknown_load"):
        BalanceEstimator(tare=True, unknown_load=True).fit(first)
    for lags in ((12.0, 1.0), (5.0, 500.0)):
        with refused(ModelError, parameter="lags"):
            BalanceEstimator(lags=lags).fit(first)


# -- several muscles -----------------------------------------------------------------------------


JOINT = replace(
    MUSCLE,
    springs=((0.0, 12.0),),
    elasticity=2 * ((30.0, 20.0),),
    areas=2 * ((60.0, -30.0, -5.0),),
    friction=2 * MUSCLE.friction,
    relaxation=2 * MUSCLE.relaxation,
    damping=(0.1, 0.1),
    lines=(),
    walls=(0.0, 0.0),
    hull=2 * ((-20.0, 20.0),),
    scale=20.0,
    given=tuple(Channel(f"pressure_{k}", "bar") for k in (1, 2)),
    directions=((1.0,), (-1.0,)),
    preload=2.0,
)
"""Two muscles that are alike, and pull a joint either way."""


def joint(seed: int, sign: float = 1.0, n: int = 1200) -> Recording:
    time = np.arange(n) * STEP
    rises = np.minimum(time / 2.0, 1.0)
    p = [rises * random_wave(time, 0.3, 4.0, seed=10 * seed + k) for k in (1, 2)]
    force = rises * random_wave(time, 0.2, 40.0, -40.0, seed=100 + seed)
    y = JOINT.inverse().simulate(np.column_stack([*p, force]), sample_time=STEP)[:, 0]
    y = y + NOISE * np.random.default_rng(seed).standard_normal(n)
    channels = {"pressure_1": p[0], "pressure_2": p[1], "displacement": y, "force": sign * force}
    return Recording(channels, STEP)


def test_muscles_that_are_alike_come_out_alike_at_a_joint() -> None:
    estimator = BalanceEstimator().fit([joint(1), joint(2)])
    assert error(estimator, joint(3)) < 1.6 * NOISE
    balance = balance_of(estimator)
    np.testing.assert_allclose(balance.directions, [[1.0], [-1.0]])
    first, second = np.array(balance.areas)[:, 0]
    assert first == pytest.approx(second, rel=0.2)
    np.testing.assert_allclose(balance.areas[0][0], 60.0, rtol=0.1)
    turned = BalanceEstimator().fit([joint(1, -1.0), joint(2, -1.0)])
    assert turned.diagnostics_.rmse == pytest.approx(estimator.diagnostics_.rmse, rel=0.05)


def test_a_differential_drive_is_stored_and_any_pressures_are_not() -> None:
    time, none = np.arange(600) * STEP, np.zeros(600)
    swing = random_wave(time, 0.3, 1.5, -1.5, seed=3)
    sums = 4.0 + random_wave(time, 0.2, 1.0, -1.0, seed=4)

    def found(both: Any, **settings: Any) -> Balance:
        p = np.column_stack([0.5 * both + swing, 0.5 * both - swing])
        y = JOINT.inverse().simulate(np.column_stack([p, none]), sample_time=STEP)[:, 0]
        run = Recording({"pressure_1": p[:, 0], "pressure_2": p[:, 1], "displacement": y}, STEP)
        return balance_of(BalanceEstimator(steps=1, n_stops=2, terms=(), **settings).fit(run))

    line = np.array(found(4.0 + none).drive)
    np.testing.assert_allclose(line[:, 0], 2.0 + swing.mean() * np.array([1.0, -1.0]))
    np.testing.assert_allclose(np.abs(line[:, 1]), swing.std())
    assert line[0, 1] == pytest.approx(-line[1, 1])
    assert found(4.0 + none, drive="any").drive == ()
    assert found(sums).drive == ()


def test_fronts_of_several_muscles_stand_before_each() -> None:
    lost = (
        PiecewiseLinear((0.0, 0.3, 0.6), (0.0, 0.006, 0.306), channel, channel)
        for channel in JOINT.given
    )
    filled = Series((PerChannel(tuple(lost)), JOINT.inverse()))

    def dead(seed: int) -> Recording:
        plain = joint(seed)
        moved = filled.simulate(plain.select(["pressure_1", "pressure_2", "force"]))
        noise = NOISE * np.random.default_rng(seed).standard_normal(len(plain))
        return plain.with_channels({}, displacement=moved["displacement"] + noise)

    estimator = BalanceEstimator().fit([dead(1), dead(2)])
    (zones,) = placed(estimator).before
    assert isinstance(zones, PerChannel)
    for zone in zones.parts:  # sharp, or one that fades
        assert 3.0 - zone.simulate(np.array([3.0]))[0] == pytest.approx(0.294, rel=0.1)


def test_the_order_of_recordings_does_not_change_what_terms_are_chosen() -> None:
    """Held lengths, measured twice: one after another, or in two turns."""
    rig = load_rig("mas10-test-stand").changed({"sample_time": 0.05})
    time = np.arange(0.0, 16.0, 0.05)
    pressure = 6.0 - 0.75 * np.abs(time - 8.0)

    def held(length: float, seed: int) -> Recording:
        run = rig.run(
            Recording({"pressure": pressure, "length": np.full(time.size, length)}, 0.05), seed=seed
        )
        given = {"pressure": run["pressure"], "force": run["force"]}
        return Recording(given | {"displacement": 200.0 - run["length"]}, 0.05)

    runs = {
        (length, seed): held(length, seed) for length in (200.0, 192.0, 184.0) for seed in (1, 2)
    }
    turns = sorted(runs), sorted(runs, key=lambda key: key[1])
    one, other = (BalanceEstimator().fit([runs[key] for key in turn]).terms_ for turn in turns)
    assert one == other
