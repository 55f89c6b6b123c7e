"""The estimator of valves and their air finds what made a recording."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from mckibben import DataError, ModelError, Recording
from mckibben.blocks.dynamics.air import Air
from mckibben.channels import Channels
from mckibben.estimators.dynamics.air import AirEstimator
from tests.refusals import refused

STEP, NOISE = 0.01, 0.005
REGULATOR = Air(0.6, 0.3, 0.08, 0.05, 0.09, 0.03)


@cache
def recorded(air: Air) -> Recording:
    rng = np.random.default_rng(0)
    levels = np.repeat(rng.uniform(1.0, 9.0, 60), rng.integers(5, 60, 60))
    volts = np.concatenate([np.full(20, levels[0]), levels])
    noise = NOISE * rng.standard_normal(volts.size)
    pressure = air.simulate(volts, sample_time=STEP) + noise
    return Recording({"voltage": volts, "pressure": pressure}, STEP)


@cache
def fitted(air: Air) -> tuple[Air, AirEstimator]:
    estimator = AirEstimator().fit(recorded(air))
    assert isinstance(estimator.model_, Air)
    assert estimator.diagnostics_.rmse < 1.05 * NOISE
    return estimator.model_, estimator


@pytest.mark.parametrize(
    "air",
    [
        REGULATOR,
        replace(REGULATOR, dead_time=0.0, filling_time=0.2, venting_time=0.03),
        replace(REGULATOR, supply=4.0, dead_time=0.12),
    ],
    ids=["regulator", "slow to fill", "short of supply"],
)
def test_parameters_are_found_within_three_standard_errors(air: Air) -> None:
    found, estimator = fitted(air)
    assert found.dead_time == pytest.approx(air.dead_time)
    errors = np.array(estimator.diagnostics_.standard_errors)
    assert np.isfinite(errors).all()
    assert (np.abs(found.pack() - air.pack()) < 3 * errors).all()
    assert (errors < 0.02 * np.maximum(air.pack(), 0.1)).all()


def test_limits_are_found_where_they_show_and_kept_where_they_are_given() -> None:
    short = replace(REGULATOR, supply=4.0, ambient=0.6)
    found, _ = fitted(short)
    assert found.supply == pytest.approx(4.0, abs=0.005)
    assert found.ambient == pytest.approx(0.6, abs=0.005)
    free, _ = fitted(REGULATOR)
    assert free.supply is None
    assert free.ambient == 0.0
    told = AirEstimator(supply=7.0, ambient=-0.5).fit(recorded(REGULATOR)).model_
    assert isinstance(told, Air)
    assert (told.supply, told.ambient) == (7.0, -0.5)


def test_what_is_no_command_is_refused() -> None:
    run = recorded(REGULATOR)
    objects = AirEstimator.objection
    assert objects([run], Channels(("voltage",), ("pressure",))) is None
    assert objects([run], Channels(("displacement",), ("pressure",)))
    assert objects([run], Channels(("pressure",), ("displacement",)))
    falling = run.with_channels(pressure=5.0 - run["pressure"])
    with refused(DataError, channel="voltage"):
        AirEstimator(longest_dead_time=0.0).fit(falling)
    with refused(ModelError, parameter="initial"):
        AirEstimator(initial="fitted").fit(run)  # type: ignore[arg-type]
    with refused(DataError, channel="time"):
        AirEstimator().fit(replace(run, sample_time=None))
