"""Creep that was under way before a recording began."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import PI, Recording
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.dynamics.starts import fitted_places, fitted_state
from mckibben.blocks.free_run import run_free
from mckibben.blocks.memoryless import Negative
from mckibben.estimators.core.data import training_data
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.hysteresis.creep_pi import CreepPIEstimator
from mckibben.estimators.optimisers.linear import solve_linear

CREEP = Creep((0.05, 0.2), (6.0, 300.0), "fitted")
SLOW = Series((PI.example(), CREEP))
STEP = 4.0


def levels(n: int, seed: int = 0) -> np.ndarray:
    """Return random levels, as pressures [bar]."""
    return np.random.default_rng(seed).uniform(0.5, 5.5, n)


def worked(block: Block, n: int, before: int, noise: float = 0.0) -> Recording:
    """Return a recording that was begun after so many samples at rest in the lowest pressure."""
    pressure = np.concatenate([np.full(before, 0.5), levels(n)])
    y = block.simulate(pressure, sample_time=STEP)
    y += noise * np.random.default_rng(1).standard_normal(y.size)
    whole = Recording({"pressure": pressure, "displacement": y}, STEP)
    return whole.slice(before, before + n)


@pytest.mark.parametrize("block", [SLOW, Series((SLOW, Negative.example()))])
def test_known_outputs_tell_how_far_elements_had_crept(block: Block) -> None:
    pressure = levels(80)
    inputs = pressure[:, np.newaxis]
    rest = block.initial_state(inputs[0])
    places = fitted_places(block)
    crept = rest.copy()
    crept[places] += [3.0, -11.0]
    y = block.simulate(pressure, initial=crept.tolist(), sample_time=STEP)
    every = np.ones(80, dtype=bool)
    np.testing.assert_allclose(fitted_state(block, inputs, y, STEP, every), crept, atol=1e-9)
    # what is not known has no say
    y[40:] = np.nan
    early = np.arange(80) < 40
    np.testing.assert_allclose(fitted_state(block, inputs, y, STEP, early), crept, atol=1e-8)


def test_a_drift_from_before_the_recording_is_found_and_gone_on_from() -> None:
    run = worked(SLOW, 200, 100, 0.01)
    train, test = run.slice(0, 120), run.slice(120, 200)
    found, settled = (CreepPIEstimator(settled=s).fit(train) for s in (None, True))
    assert fitted_places(found.model_)
    missed = [
        test["displacement"] - run_free(fit.model_, test, "displacement", (train,))
        for fit in (found, settled)
    ]
    errors = [float(np.sqrt(np.mean(error**2))) for error in missed]
    assert errors[0] < 0.5 * errors[1]
    assert found.diagnostics_.rmse < 0.5 * settled.diagnostics_.rmse


def test_where_the_muscle_was_settled_nothing_is_made_up() -> None:
    pressure = levels(160)
    y = SLOW.simulate(pressure, sample_time=STEP)
    y += 0.05 * np.random.default_rng(2).standard_normal(y.size)
    run = Recording({"pressure": pressure, "displacement": y}, STEP)
    assert fitted_places(CreepPIEstimator().fit(run).model_) == []


def test_moves_of_what_was_begun_are_those_of_finite_differences() -> None:
    runs = [worked(SLOW, 90, 40), worked(SLOW, 70, 10)]
    data = training_data(runs, "pressure", "displacement")
    estimator = CreepPIEstimator(settled=False)
    lower, upper = estimator.bounds(data)
    theta = 0.999 * np.clip(estimator.guesses(data)[0], lower, upper) + 0.0005 * (lower + upper)
    matrix = estimator.matrix(theta, data)
    linear, _ = solve_linear(
        matrix, data.target, nonnegative=True, least=estimator.least(matrix, data)
    )
    assert np.count_nonzero(linear[-4:]) == 4
    moves = estimator.moves(theta, linear, data)
    differences = SeparableEstimator.moves(estimator, theta, linear, data)
    np.testing.assert_allclose(moves, differences, atol=2e-4 * np.abs(moves).max())
