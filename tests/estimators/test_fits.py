"""What estimators of loops do on data of their own making; what all must do is among laws."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from mckibben import (
    GPI,
    PI,
    ModelError,
    MPIEstimator,
    PIEstimator,
    RateDependentPI,
    RDPIEstimator,
    Recording,
)
from mckibben.blocks.core.block import Block
from tests.estimators.examples import quick

TIME = np.linspace(0, 1, 1500)
PRESSURE = 2.5 * (1 - 0.7 * np.floor(6 * TIME).clip(0, 5) / 5) * (1 - np.cos(12 * np.pi * TIME))


def recorded(block: Block, noise: float = 0.0, seed: int = 0) -> Recording:
    """Return a recording of a block under decaying cycles from 0 bar."""
    rng = np.random.default_rng(seed)
    y = block.simulate(PRESSURE, sample_time=0.01)
    return Recording(
        {"pressure": PRESSURE, "displacement": y + noise * rng.standard_normal(y.size)}, 0.01
    )


@pytest.fixture(scope="module")
def loop() -> Recording:
    """A saturating loop with noise."""
    return recorded(GPI.example(), 0.02)


def test_pi_recovers_its_own_weights_with_intervals() -> None:
    truth = PI((0.0, 0.5, 1.0, 1.5), (3.0, 1.5, 1.0, 0.5), 2.0, (0.0, 5.0))
    inside = []
    for seed in range(40):
        fit = PIEstimator(thresholds=truth.thresholds).fit(recorded(truth, 0.05, seed))
        errors = np.array(fit.diagnostics_.standard_errors)
        inside.append(np.abs(fit.model_.pack() - truth.pack()) < 1.96 * errors)
    assert np.abs(fit.model_.pack() - truth.pack()).max() < 0.1
    assert 0.88 < np.mean(inside) <= 1.0


@pytest.mark.parametrize(
    ("initial", "start", "stop"),
    [("virgin", 0, 402), ("first_sample", 400, 803), ("virgin", 801, 1203)],
)
def test_slope_rule_recovers_the_weights_of_every_kind_of_branch(
    initial: Literal["virgin", "first_sample"], start: int, stop: int
) -> None:
    """Operators begin after r on the rise from rest, after 2 r on the fall and the rise that follow."""
    truth = PI((0.0, 0.5, 1.0, 1.5), (3.0, 1.5, 1.0, 0.5), 2.0, (0.0, 5.0), initial)
    t = np.concatenate([np.linspace(0, 5, 401), np.linspace(5, 0, 401), np.linspace(0, 5, 401)])
    loop = Recording({"pressure": t, "displacement": truth.simulate(t)}, 0.01)
    one_branch = np.zeros(t.size, dtype=bool)
    one_branch[start:stop] = True
    estimator = PIEstimator(thresholds=truth.thresholds, method="slopes", initial=initial)
    fit = estimator.fit(loop, rows=[one_branch])
    assert isinstance(fit.model_, PI)
    np.testing.assert_allclose(fit.model_.pack()[:-1], truth.pack()[:-1], rtol=1e-6)
    assert fit.model_.offset == pytest.approx(truth.offset, rel=1e-6)


def test_slope_rule_pools_slopes_that_fall_and_refuses_short_branches() -> None:
    t = np.concatenate([np.linspace(0, 5, 401), np.linspace(5, 0, 401), np.linspace(0, 5, 401)])
    flattening = Recording({"pressure": t, "displacement": np.sqrt(1 + 10 * t)}, 0.01)
    rising = np.arange(t.size) >= 802
    estimator = PIEstimator(thresholds=(0.0, 0.5, 1.0, 1.5), method="slopes")
    weights = estimator.fit(flattening, rows=[rising]).fitted.pack()[:-1]
    assert weights == pytest.approx(((np.sqrt(51) - 1) / 5, 0, 0, 0))
    with pytest.raises(ModelError, match="5"):
        estimator.set_params(thresholds=(0.0, 2.5)).fit(flattening)


def test_virgin_gpi_models_are_recovered_and_deliver_what_was_optimised() -> None:
    example = GPI.example()
    up, down = example.rising.shifted(0.8), example.falling.shifted(0.8)
    # where virgin operators start depends on how high the envelopes are
    truth = replace(example, initial="virgin", rising=up, falling=down)
    loop = recorded(truth)
    model = quick("gpi", n_operators=10, initial="virgin").fit(loop).model_
    error = np.abs(model.simulate(PRESSURE) - loop["displacement"]).max()
    assert error <= 0.01 * np.ptp(loop["displacement"])
    assert model.initial == "virgin"


@pytest.mark.parametrize("envelope", ["tanh", "exponential", "piecewise-linear"])
def test_gpi_envelopes_stay_in_order(envelope: str, loop: Recording) -> None:
    model = quick("gpi", envelope=envelope).fit(loop).model_
    low, high = model.input_range
    u = np.linspace(low, high, 5000)
    assert np.all(model.falling(u) >= model.rising(u))
    assert np.all(np.diff(model.rising(u)) > 0)
    assert np.all(np.diff(model.falling(u)) > 0)


def test_rate_dependence_is_found() -> None:
    truth = RateDependentPI(
        (0.0, 0.6, 1.2), (-0.02, 0.03, 0.02), (3.0, 1.5, 1.0), 0.0, 0.0, (0.0, 5.0)
    )
    recording = recorded(truth)
    static = MPIEstimator(n_operators=5).fit(recording).diagnostics_.rmse
    rate = RDPIEstimator(n_operators=5, rate_time_constant=0.0).fit(recording).diagnostics_.rmse
    assert rate < 0.5 * static


def test_fitted_start_finds_the_peak_before_the_recording() -> None:
    truth = PI.example()
    u = np.concatenate([[2.0], 2.5 + 1.5 * np.cos(np.linspace(np.pi, 30, 600))])
    y = truth.simulate(u)
    loop = Recording({"pressure": u[1:], "displacement": y[1:]}, 0.01)
    blind = PIEstimator(thresholds=truth.thresholds).fit(loop)
    fitted = PIEstimator(thresholds=truth.thresholds, initial="fitted").fit(loop)
    assert fitted.diagnostics_.rmse < 0.2 * blind.diagnostics_.rmse
    assert fitted.diagnostics_.peaks[0] == pytest.approx(2.0, abs=0.01)


def test_papers_threshold_rule(loop: Recording) -> None:
    model = quick("gpi", n_operators=5, threshold_rule="paper").fit(loop).model_
    np.testing.assert_allclose(model.thresholds, np.arange(6) / 5 * loop["pressure"].max())
