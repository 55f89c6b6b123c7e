"""What is likely of a muscle decides where its recordings do not, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mckibben import ModelError, Recording, muscles
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.muscles import Prior, Sheet
from mckibben.muscles.prior import of_muscles
from mckibben.muscles.traits import traits
from mckibben.signals.broadband import random_wave
from tests.refusals import refused

RAIL = muscles.load("rail")
SHEET = Sheet(
    diameter_mm=24.0,
    rest_length_mm=280.0,
    braid_angle_deg=24.0,
    max_pressure_bar=6.0,
    max_contraction=0.22,
)
TRUTH = muscles.scaled(RAIL.balance, RAIL.sheet, SHEET)
"""A muscle that nobody has seen."""

STEP = 0.05


def moved(seed: int, seconds: float, noise: float = 0.02) -> Recording:
    n = round(seconds / STEP)
    time = np.arange(n) * STEP
    pressure = random_wave(time, 0.3, 5.5, seed=seed) * np.clip(time, 0.0, 1.0)
    force = random_wave(time, 0.1, 300.0, 50.0, seed=seed + 50)
    given = Recording({"pressure": pressure, "force": force}, STEP)
    y = TRUTH.inverse().simulate(given)["displacement"]
    y = y + noise * np.random.default_rng(seed).standard_normal(n)
    return given.with_channels({"displacement": "mm"}, displacement=y)


def without_rail() -> Prior:
    return of_muscles([m for m in muscles.list() if m.name != "rail"], SHEET)


def fitted(run: Recording, prior: Prior | None) -> Block:
    return BalanceEstimator(prior=prior).fit(run).model_


def error(model: Block, run: Recording) -> float:
    found = model.simulate(run.select(["pressure", "force"]))["displacement"]
    return float(np.sqrt(np.mean((found - run["displacement"]) ** 2)))


def test_with_little_data_a_prior_helps_and_with_much_it_does_not_harm() -> None:
    test, little, much = moved(90, 60.0, noise=0.0), moved(1, 10.0), moved(2, 90.0)
    assert error(fitted(little, without_rail()), test) < 0.7 * error(fitted(little, None), test)
    assert error(fitted(much, without_rail()), test) < 1.2 * error(fitted(much, None), test)


def test_a_prior_without_doubt_returns_itself() -> None:
    prior = without_rail()
    levels, shapes = (dict.fromkeys(prior.levels, 1e-3) for _ in range(2))
    sure = replace(prior, levels=levels, shapes=shapes, zero=1e-3)
    placed = balance_in(fitted(moved(1, 5.0), sure))
    assert placed is not None
    away = traits(placed.balance, SHEET) - prior.mean
    assert np.sqrt(np.nanmean(away**2)) < 0.12  # eight stops do not make every friction


def test_a_prior_is_of_one_muscle() -> None:
    run = moved(1, 5.0)
    both = {"pressure_1": run["pressure"], "pressure_2": run["pressure"][::-1].copy()}
    both |= {
        "displacement_1": run["displacement"],
        "displacement_2": run["displacement"][::-1].copy(),
    }
    with refused(ModelError, parameter="prior"):
        BalanceEstimator(prior=without_rail()).fit(Recording(both, STEP))


def test_one_held_length_and_a_prior_give_forces_at_others() -> None:
    time = np.arange(600) * STEP
    pressure = 5.5 * np.minimum(time / 10.0, (30.0 - time) / 20.0)

    def held(length: float) -> Recording:
        given = Recording({"pressure": pressure, "displacement": np.full(600, length)}, STEP)
        found = np.maximum(load_of(TRUTH.inverse()).simulate(given)["force"], 0.0)
        return given.with_channels({"force": "N"}, force=found)

    model = load_of(fitted(held(12.0), without_rail()))
    for run in map(held, (0.0, 25.0)):
        found = model.simulate(run.select(["pressure", "displacement"]))["force"]
        assert np.sqrt(np.mean((found - run["force"]) ** 2)) < 0.1 * held(0.0)["force"].max()
