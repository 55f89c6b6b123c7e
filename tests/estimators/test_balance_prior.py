"""What is likely of a muscle decides where its recordings do not, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import Recording, muscles
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.muscles import Prior, Sheet
from mckibben.muscles.prior import of_muscles
from mckibben.muscles.traits import traits
from mckibben.signals.broadband import random_wave

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
SETTINGS: dict[str, Any] = {"n_stops": 4, "elasticity": 4, "terms": ("elasticity", "areas")}


def moved(seed: int, seconds: float, noise: float = 0.02) -> Recording:
    n = round(seconds / STEP)
    time = np.arange(n) * STEP
    pressure = random_wave(time, 0.3, 5.5, seed=seed) * np.clip(time, 0.0, 1.0)
    force = random_wave(time, 0.1, 300.0, 50.0, seed=seed + 50)
    given = Recording({"pressure": pressure, "force": force}, STEP)
    y = TRUTH.inverse().simulate(given)["displacement"]
    rng = np.random.default_rng(seed)
    return given.with_channels(
        {"displacement": "mm"}, displacement=y + noise * rng.standard_normal(n)
    )


def without_rail() -> Prior:
    return of_muscles([m for m in muscles.list() if m.name != "rail"], SHEET)


def fitted(runs: Recording | list[Recording], prior: Prior | None) -> Block:
    return BalanceEstimator(prior=prior, **SETTINGS).fit(runs).model_


def error(model: Block, run: Recording) -> float:
    found = model.simulate(run.select(["pressure", "force"]))["displacement"]
    return float(np.sqrt(np.mean((found - run["displacement"]) ** 2)))


@pytest.mark.long
def test_with_little_data_a_prior_helps_and_with_much_it_changes_nothing() -> None:
    test = moved(90, 60.0, noise=0.0)
    little, much = moved(1, 5.0), [moved(seed, 60.0) for seed in (2, 3)]
    assert error(fitted(little, without_rail()), test) < 0.7 * error(fitted(little, None), test)
    told, untold = (fitted(much, prior) for prior in (without_rail(), None))
    given = test.select(["pressure", "force"])
    apart: Array = told.simulate(given)["displacement"] - untold.simulate(given)["displacement"]
    assert np.sqrt(np.mean(apart**2)) < 0.3 * error(untold, test)


def test_a_prior_without_doubt_returns_itself() -> None:
    prior = without_rail()
    sure = replace(
        prior,
        levels=dict.fromkeys(prior.levels, 1e-3),
        shapes=dict.fromkeys(prior.shapes, 1e-3),
        zero=1e-3,
    )
    placed = balance_in(fitted(moved(1, 5.0), sure))
    assert placed is not None
    away = traits(placed.balance, SHEET) - prior.mean
    assert np.sqrt(np.nanmean(away**2)) < 0.1  # four stops do not make every friction


def test_one_inflation_of_a_held_muscle_tells_of_other_lengths() -> None:
    def held(displacement: float) -> Recording:
        time = np.arange(600) * STEP
        pressure = 6.0 * np.clip(np.minimum(time / 14.0, (29.0 - time) / 14.0), 0.0, 1.0)
        y = np.full(600, displacement)
        run = Recording({"pressure": pressure, "displacement": y}, STEP)
        force = load_of(TRUTH.inverse()).simulate(run)["force"]
        return run.with_channels(force=force)

    model = BalanceEstimator(prior=of_muscles(muscles.list(), SHEET, RAIL), **SETTINGS).fit(
        held(5.0)
    )
    found, run = load_of(model.model_), held(25.0)
    off = found.simulate(run.select(["pressure", "displacement"]))["force"] - run["force"]
    assert np.sqrt(np.mean(off**2)) < 0.04 * SHEET.force
