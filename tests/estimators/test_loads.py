"""Models that are told the load, on the rail."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import DataError, Recording, compare, load_rig, registry
from mckibben.control import BlockController, EstimatedLoad, track
from mckibben.estimators.coupled.force_estimate import ForceEstimate, fit_force_estimate
from mckibben.rigs import record
from mckibben.signals import resample

pytestmark = pytest.mark.long

NAMES = ("status-1", "status-2", "status-3", "training-pulls-100N", "status-4")
FREE = ("free-0.05Hz", "free-0.1Hz", "free-0.2Hz")


@pytest.fixture(scope="module")
def runs() -> dict[str, Recording]:
    return {
        run.name: resample(recording, 0.05)
        for run, recording in record("mpi-narmax", runs=[*NAMES, *FREE])
    }


@pytest.fixture(scope="module")
def train(runs: dict[str, Recording]) -> list[Recording]:
    return [runs[name] for name in NAMES[:4]]


@pytest.fixture(scope="module")
def estimate(train: list[Recording]) -> ForceEstimate:
    return fit_force_estimate(train)


def test_one_model_for_all_loads_beats_one_for_each(
    runs: dict[str, Recording], train: list[Recording]
) -> None:
    test = [runs["status-4"]]
    board = compare(train, test, models=["balance"], load="force")
    told = next(row for row in board.rows if row.model == "balance")
    single = [row for row in board.rows if row is not told]
    assert len(single) == len(train)
    assert told.test_error < 0.4 * min(row.test_error for row in single)
    assert all(row.rmse_interval is not None for row in board.rows)


def test_hysteresis_is_identified_on_all_runs_without_load(runs: dict[str, Recording]) -> None:
    free, pulled = [runs[name] for name in FREE], runs["training-pulls-100N"]
    settings = {"memory": "rdpi", "method": "ls", "n_sets": 2, "constants": False}
    settings["input"] = "voltage"
    estimator_class = registry.load("estimators", "mpi-narmax")
    model = estimator_class(**settings, learns_from="loaded").fit([*free, pulled]).model_
    alone = registry.load("estimators", "rdpi")(input="voltage", rate_time_constant=0.25).fit(free)
    hysteresis, network = model.parts
    given = pulled.select(["voltage"])
    assert hysteresis.simulate(given)["displacement_free"] == pytest.approx(
        alone.model_.simulate(given)["displacement"]
    )
    # the printed fourth layer has no constants
    terms = np.reshape(network.consequents, (-1, network.n_regressors + 1))
    assert not terms[:, -1].any()
    assert terms[:, :-1].all()
    everything = estimator_class(**settings).fit([*free, pulled]).model_
    assert everything.parts[0] == hysteresis
    assert everything.parts[1] != network


def test_force_is_estimated_from_pressure_and_displacement(
    runs: dict[str, Recording], estimate: ForceEstimate
) -> None:
    run = runs["status-4"]
    estimated = estimate.block.simulate(run)["force"]
    assert np.sqrt(np.mean((estimated - run["force"]) ** 2)) < 0.04 * np.ptp(run["force"])


def test_force_comes_with_an_interval_from_runs_left_out(
    runs: dict[str, Recording], train: list[Recording], estimate: ForceEstimate
) -> None:
    run = estimate.estimate(runs["status-4"])
    inside = (run["force_low"] <= run["force"]) & (run["force"] <= run["force_high"])
    assert inside.mean() >= 0.9
    for given, level in ((train[:2], 0.9), (train, 1.5)):
        with pytest.raises(DataError):
            fit_force_estimate(given, level=level)


def test_an_estimated_load_serves_as_well_as_a_measured_one(
    train: list[Recording], estimate: ForceEstimate
) -> None:
    model = registry.load("estimators", "balance")().fit(train).model_
    rig = load_rig("rail")
    t = np.arange(600) * 0.05
    reference = Recording(
        {
            "displacement": 20.0 + 10.0 * np.sin(0.2 * np.pi * t),
            "force": 50.0 - 50.0 * np.cos(0.1 * np.pi * t),
        },
        0.05,
    )
    told = BlockController(model.inverse())
    guessed = EstimatedLoad(told, estimate.block)
    errors = [
        track(c, rig, reference, approach=5.0, settle=5.0).rmse["displacement"]
        for c in (told, guessed)
    ]
    assert errors[1] < 1.5 * errors[0]
