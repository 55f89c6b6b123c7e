"""Creep that was under way before a recording began."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from mckibben import PI, Recording
from mckibben.blocks.compose import Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.dynamic.creep import Creep
from mckibben.blocks.dynamic.creep_start import begun_places, begun_state
from mckibben.blocks.memoryless.negative import Negative
from mckibben.comparison.free_run import run_free
from mckibben.estimators.core.checking import training_data
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.optimisers.linear import solve_linear
from mckibben.estimators.play_type.creep_pi import CreepPIEstimator

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
    places = begun_places(block)
    crept = rest.copy()
    crept[places] += [3.0, -11.0]
    y = block.simulate(pressure, initial=crept.tolist(), sample_time=STEP)
    every = np.ones(80, dtype=bool)
    np.testing.assert_allclose(begun_state(block, rest, inputs, y, STEP, every), crept, atol=1e-9)
    # what is not known has no say
    y[40:] = np.nan
    early = np.arange(80) < 40
    np.testing.assert_allclose(begun_state(block, rest, inputs, y, STEP, early), crept, atol=1e-8)


def test_only_creep_whose_start_is_fitted_has_such_places() -> None:
    n = SLOW.parts[0].n_states
    assert begun_places(SLOW) == [n, n + 1]
    assert begun_places(Series((PI.example(), replace(CREEP, initial="first_sample")))) == []


def test_a_drift_from_before_the_recording_is_found_and_gone_on_from() -> None:
    run = worked(SLOW, 200, 100, 0.01)
    train, test = run.slice(0, 120), run.slice(120, 200)
    found, settled = (CreepPIEstimator(settled=s).fit(train) for s in (None, True))
    assert begun_places(found.model_)
    assert any("under way" in note for note in found.diagnostics_.notes)
    missed = [
        test["displacement"] - run_free(fit.model_, test, "displacement", (train,))
        for fit in (found, settled)
    ]
    errors = [float(np.sqrt(np.mean(error**2))) for error in missed]
    assert errors[0] < 0.5 * errors[1]
    assert found.diagnostics_.rmse < 0.5 * settled.diagnostics_.rmse


def test_an_interrupt_leaves_the_settled_model() -> None:
    train = worked(SLOW, 120, 100, 0.01)
    shares: list[float] = []

    def stop(share: float, best: float) -> None:
        shares.append(share)
        if share > 0.55:
            raise KeyboardInterrupt

    found = CreepPIEstimator().fit(train, progress=stop)
    assert found.diagnostics_.interrupted
    assert shares == sorted(shares)
    settled = CreepPIEstimator(settled=True).fit(train)
    np.testing.assert_array_equal(found.model_.pack(), settled.model_.pack())


def test_where_the_muscle_was_settled_nothing_is_made_up() -> None:
    pressure = levels(160)
    y = SLOW.simulate(pressure, sample_time=STEP)
    y += 0.05 * np.random.default_rng(2).standard_normal(y.size)
    run = Recording({"pressure": pressure, "displacement": y}, STEP)
    assert begun_places(CreepPIEstimator().fit(run).model_) == []


def test_what_falls_is_begun_as_what_rises_is() -> None:
    run = worked(SLOW, 150, 100, 0.01)
    falling = run.with_channels(displacement=30 - run["displacement"])
    one, other = (CreepPIEstimator(settled=False).fit(r) for r in (run, falling))
    assert begun_places(other.model_)
    assert other.diagnostics_.rmse == pytest.approx(one.diagnostics_.rmse, rel=0.05)


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


@pytest.mark.parametrize("seed", range(5))
def test_linear_parameters_of_either_sign_are_solved_for_beside_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    basis = rng.standard_normal((60, 5))
    target = basis @ rng.uniform(-1, 1, 5) + 3 + 0.1 * rng.standard_normal(60)
    least = np.array([-np.inf, 0.0, 0.2, -np.inf, 0.0])
    reference = lsq_linear(
        np.column_stack([basis, np.ones(60)]),
        target,
        (np.append(least, -np.inf), np.inf),
        tol=1e-14,
        method="bvls",
    )
    x, offset = solve_linear(basis, target, nonnegative=True, least=least)
    np.testing.assert_allclose([*x, offset], reference.x, rtol=1e-6, atol=1e-8)


def test_two_columns_that_are_one_are_told_together() -> None:
    rng = np.random.default_rng(0)
    basis = rng.standard_normal((60, 3))
    twice = np.column_stack([basis, basis[:, 0]])
    target = basis @ [-2.0, 0.5, 1.0] + 3
    x, offset = solve_linear(
        twice, target, nonnegative=True, least=np.array([-np.inf, 0, 0, -np.inf])
    )
    np.testing.assert_allclose([x[0] + x[3], x[1], x[2], offset], [-2, 0.5, 1, 3], atol=1e-9)
