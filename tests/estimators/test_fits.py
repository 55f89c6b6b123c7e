"""What estimators do on data of their own making; what all must do is among the contracts."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from mckibben import (
    GPI,
    PI,
    DataError,
    GPIEstimator,
    ModelError,
    MPIEstimator,
    PIEstimator,
    RateDependentPI,
    RDPIEstimator,
    Recording,
)
from mckibben.blocks.core.block import Block
from mckibben.estimators.core.searching import SearchingEstimator
from mckibben.registry import load, names
from tests.estimators.examples import example_for, quick

TIME = np.linspace(0, 1, 1500)
PRESSURE = 2.5 * (1 - 0.7 * np.floor(6 * TIME).clip(0, 5) / 5) * (1 - np.cos(12 * np.pi * TIME))
OPERATORS = ("eupi", "gpi", "mpi", "pi", "rdpi")
INVERTIBLE = (
    *OPERATORS,
    *("bouc-wen", "cpi", "gbw", "kp", "maxwell-slip", "mms", "preisach"),
)
SWARMS = tuple(
    n for n in names("estimators") if isinstance(load("estimators", n)(), SearchingEstimator)
)
RISING = tuple(n for n in INVERTIBLE if load("estimators", n).rises)


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


@pytest.mark.parametrize("name", INVERTIBLE)
def test_every_fit_can_be_inverted(name: str, loop: Recording) -> None:
    if name == "rdpi":
        loop = recorded(replace(RateDependentPI.example(), rate_weights=(0.01, 0.02, 0.01, 0.0)))
    model = quick(name).fit(loop).model_
    low, high = (float(end[0]) for end in model.reachable())
    assert low < high
    t = np.linspace(0, 1, 400)
    wave = 0.5 + 0.35 * np.sin(9 * t) + 0.1 * np.sin(40 * t)
    reference = low + (high - low) * wave
    pressure = model.inverse().simulate(reference, sample_time=0.01)
    error = np.abs(model.simulate(pressure, sample_time=0.01) - reference).max()
    assert error <= 1e-9 * (high - low)


@pytest.mark.parametrize("name", SWARMS)
@pytest.mark.parametrize("method", ["pso", "pso-ls"])
def test_swarms_fit_too_and_repeat(name: str, method: str) -> None:
    runs = example_for(name)
    first, second = (quick(name, method=method, seed=3).fit(runs) for _ in range(2))
    assert first.model_ == second.model_
    assert first.diagnostics_.rmse < 2 * np.ptp(runs[0][first.output])


@pytest.mark.parametrize("name", OPERATORS)
def test_bad_settings_and_bad_data_are_refused(name: str, loop: Recording) -> None:
    for setting, value in (
        *(("method", "magic"), ("initial", "yesterday"), ("n_operators", -1), ("n_operators", 2.5)),
        *(("n_operators", 10**9), ("n_operators", True), ("nonnegative", "maybe"), ("seed", -1)),
    ):
        with pytest.raises(ModelError, match=rf"{setting} is .*{value}.*Remedy"):
            quick(name).set_params(**{setting: value}).fit(loop)
    still = loop.with_channels(pressure=np.ones(len(loop)))
    with pytest.raises(DataError, match=r"'pressure'.*constant.*Remedy"):
        quick(name).fit(still)
    with pytest.raises(DataError, match="no channel 'force'"):
        quick(name, output="force").fit(loop)
    with pytest.raises(DataError, match="too few"):
        quick(name).fit(loop.slice(0, 5))
    with pytest.raises(DataError, match="sample time"):
        quick(name).fit([loop, replace(loop, sample_time=0.02)])


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
    with pytest.raises(ModelError, match=r"the longest goes 5 .* twice a threshold"):
        estimator.set_params(thresholds=(0.0, 2.5)).fit(flattening)


@pytest.mark.parametrize("name", INVERTIBLE)
def test_every_model_fits_data_of_its_own_making_to_the_noise(name: str, loop: Recording) -> None:
    truth = quick(name).fit(loop).model_
    again = quick(name, n_starts=16, n_refined=3).fit(recorded(truth, 0.02))
    assert again.diagnostics_.rmse < 0.021


@pytest.mark.parametrize("name", RISING)
def test_outputs_that_fall_are_fitted_like_those_that_rise(name: str, loop: Recording) -> None:
    length = loop.with_channels(length=200 - loop["displacement"])
    rising, falling = quick(name).fit(loop), quick(name, output="length").fit(length)
    # the search of cpi has a flat valley, in which rounding decides where it ends
    tolerance = 0.05 if name == "cpi" else 1e-3
    assert falling.diagnostics_.rmse == pytest.approx(rising.diagnostics_.rmse, rel=tolerance)
    assert falling.model_.n_parameters == rising.model_.n_parameters
    low, high = (float(end[0]) for end in falling.model_.reachable())
    assert 150 < low < high < 250
    reference = np.linspace(high, low, 50)
    pressure = falling.model_.inverse().simulate(reference, sample_time=1.0)
    np.testing.assert_allclose(
        falling.model_.simulate(pressure, sample_time=1.0), reference, atol=1e-9 * (high - low)
    )


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


def test_gpi_counts_seventeen_parameters_for_ten_operators(loop: Recording) -> None:
    assert quick("gpi", n_operators=10).fit(loop).model_.n_parameters == 17


@pytest.mark.parametrize("envelope", ["tanh", "exponential", "piecewise-linear"])
def test_gpi_envelopes_stay_in_order(envelope: str, loop: Recording) -> None:
    model = quick("gpi", envelope=envelope).fit(loop).model_
    low, high = model.input_range
    u = np.linspace(low, high, 5000)
    assert np.all(model.falling(u) >= model.rising(u))
    assert np.all(np.diff(model.rising(u)) > 0)
    assert np.all(np.diff(model.falling(u)) > 0)


def test_papers_threshold_rule(loop: Recording) -> None:
    model = quick("gpi", n_operators=5, threshold_rule="paper").fit(loop).model_
    np.testing.assert_allclose(model.thresholds, np.arange(6) / 5 * loop["pressure"].max())


def test_rate_dependence_is_found() -> None:
    truth = RateDependentPI(
        (0.0, 0.6, 1.2), (-0.02, 0.03, 0.02), (3.0, 1.5, 1.0), 0.0, 0.0, (0.0, 5.0)
    )
    recording = recorded(truth)
    static = MPIEstimator(n_operators=5).fit(recording).diagnostics_.rmse
    rate = RDPIEstimator(n_operators=5, rate_time_constant=0.0).fit(recording).diagnostics_.rmse
    assert rate < 0.5 * static


def test_rate_dependent_model_refuses_data_without_time(loop: Recording) -> None:
    with pytest.raises(DataError, match=r"no time.*Remedy"):
        RDPIEstimator().fit(replace(loop, sample_time=None))


def test_fitted_start_finds_the_peak_before_the_recording() -> None:
    truth = PI.example()
    u = np.concatenate([[2.0], 2.5 + 1.5 * np.cos(np.linspace(np.pi, 30, 600))])
    y = truth.simulate(u)
    loop = Recording({"pressure": u[1:], "displacement": y[1:]}, 0.01)
    blind = PIEstimator(thresholds=truth.thresholds).fit(loop)
    fitted = PIEstimator(thresholds=truth.thresholds, initial="fitted").fit(loop)
    assert fitted.diagnostics_.rmse < 0.2 * blind.diagnostics_.rmse
    assert fitted.diagnostics_.peaks[0] == pytest.approx(2.0, abs=0.01)


def test_interrupted_fit_keeps_the_best_model(loop: Recording) -> None:
    def impatient(share: float, best: float) -> None:
        if share > 0.3 and share < 1:
            raise KeyboardInterrupt

    fit = GPIEstimator(n_operators=4).fit(loop, progress=impatient)
    assert fit.diagnostics_.interrupted
    assert fit.diagnostics_.rmse < 1.0


def test_interrupt_while_diagnosing_keeps_the_model(
    loop: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    def impatient(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("mckibben.estimators.core.estimator.covariance_of", impatient)
    fit = quick("pi").fit(loop)
    assert fit.diagnostics_.interrupted
    assert fit.diagnostics_.rmse < 2
    assert np.isnan(fit.diagnostics_.standard_errors).all()


def test_settings_may_be_numpy_numbers(loop: Recording) -> None:
    assert quick("pi", n_operators=np.int64(3)).fit(loop).model_.n_parameters == 4
    assert quick("pi", thresholds=np.array([0.0, 1.0])).fit(loop).model_.n_parameters == 3
    with pytest.raises(ModelError, match="thresholds is 'abc'"):
        PIEstimator(thresholds="abc").fit(loop)  # type: ignore[arg-type]


def test_progress_ends_at_one(loop: Recording) -> None:
    told: list[float] = []
    GPIEstimator(n_operators=4).fit(loop, progress=lambda share, best: told.append(share))
    assert told[-1] == 1.0
    assert told == sorted(told)
