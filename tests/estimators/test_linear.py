"""Prediction-error methods: against independent references, against local minima, and intervals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from mckibben import DataError, ModelError, Recording
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.estimators.core.data import training_data
from mckibben.estimators.dynamics.prediction_error import Orders, errors
from mckibben.papers.field_models.run import matched
from mckibben.registry import load
from tests.golden.plants import runs
from tests.refusals import refused
from tests.slopes import smooth_slopes

Array = NDArray[np.float64]

STEP = 0.1
B, F = (0.5, 0.3), (-1.5, 0.7)
C, D = (0.4, 0.1), (-0.9, 0.2)


def recorded(
    seed: int,
    n: int = 1000,
    noise: float = 0.3,
    c: tuple[float, ...] = (),
    d: tuple[float, ...] = (),
) -> Recording:
    """Return a second-order system with coloured noise on its output, driven by random levels."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0, 5, n // 10), 10) + 0.1 * rng.standard_normal(n)
    clean = lfilter(B, [1.0, *F], u)
    e = lfilter([1.0, *c], [1.0, *d], noise * rng.standard_normal(n))
    return Recording({"pressure": u, "displacement": clean + e}, STEP)


@pytest.mark.parametrize(
    "orders",
    [
        Orders(b=2, a=2),
        Orders(b=3, a=2, c=2, delay=1),
        Orders(b=2, f=3),
        Orders(b=2, f=2, c=2, d=2, delay=2),
        Orders(b=2, f=2, c=2, d=2, lags=(0, 2)),
        Orders(b=2, a=2, c=1, inputs=2),
        Orders(b=2, f=2, c=1, d=1, inputs=2),
    ],
)
@pytest.mark.parametrize("start", ["estimated", "first_sample"])
def test_derivatives_of_prediction_errors(orders: Orders, start: Any) -> None:
    run = training_data(recorded(1, 200), "pressure", "displacement").runs[0]
    run = replace(run, driven=np.column_stack([run.u, 0.5 * run.u[::-1] ** 2])[:, : orders.inputs])
    rng = np.random.default_rng(2)
    theta = 0.2 * rng.standard_normal(orders.size)
    slopes = errors(theta, orders, run, start)[1][:, : orders.size]
    exact = smooth_slopes(lambda point: errors(point, orders, run, start)[0], theta, 2e-3)
    assert (np.abs(slopes - exact) <= 1e-9 * np.abs(exact).max(axis=0)).all()


def test_prediction_errors_are_those_of_a_naive_loop() -> None:
    orders = Orders(b=2, f=2, c=1, d=1)
    run = training_data(recorded(3, 60), "pressure", "displacement").runs[0]
    b, f, c, d, constant = (0.5, 0.3), (-1.2, 0.4), 0.3, -0.6, 1.5
    w, v, e = [0.0] * 60, [0.0] * 60, [0.0] * 60
    for t in range(60):
        # the input has been at its first value before
        past = [(w[t - k] if t >= k else 0.0, run.u[max(t - k, 0)]) for k in (1, 2)]
        w[t] = b[0] * run.u[t] + b[1] * past[0][1] - f[0] * past[0][0] - f[1] * past[1][0]
        v[t] = run.y[t] - w[t] - constant
        before_v, before_e = (v[t - 1], e[t - 1]) if t else (0.0, 0.0)
        e[t] = v[t] + d * before_v - c * before_e
    found, _ = errors(np.array([*b, *f, c, d, constant]), orders, run)
    np.testing.assert_allclose(found, e, atol=1e-10)


@pytest.mark.parametrize("seed", range(2))
def test_box_jenkins_finds_the_truth_whatever_the_noise(seed: int) -> None:
    fit = load("estimators", "bj")().fit(recorded(seed, 2000, c=C, d=D))
    model = fit.model_
    assert isinstance(model, TransferFunction)
    np.testing.assert_allclose(model.numerator, B, atol=0.06)
    np.testing.assert_allclose(model.denominator, F, atol=0.03)
    assert model.noise_deviation == pytest.approx(0.3, rel=0.1)


def test_arx_is_ordinary_least_squares() -> None:
    recording = recorded(4, 400)
    u, y = recording["pressure"], recording["displacement"]
    rows = np.arange(2, 400)
    columns = np.column_stack([u[rows], u[rows - 1], y[rows - 1], y[rows - 2], np.ones(398)])
    expected = np.linalg.lstsq(columns, y[rows], rcond=None)[0]
    model: Any = load("estimators", "arx")().fit(recording).model_
    # the start of the run is estimated too, so the first two samples tell nothing
    np.testing.assert_allclose(model.numerator, expected[:2], rtol=1e-6)
    np.testing.assert_allclose(model.denominator, -expected[2:4], rtol=1e-6)


PRESSURES, MOVED = ("pressure_1", "pressure_2"), ("displacement_1", "displacement_2")
TOPS = (((0.5, 0.3), (0.2, 0.1)), ((0.1, -0.05), (0.4, 0.2)))
BELOW = (((-1.5, 0.7), (-0.9, 0.1)), ((-0.6, 0.2), (-1.2, 0.5)))
"""B and F from every input to every output."""


def several(noise: float, n: int = 1500) -> Recording:
    """Return two outputs, each the sum of a filter of its own for either input, from rest."""
    rng = np.random.default_rng(8)
    u = np.repeat(rng.uniform(0, 5, (2, n // 10)), 10, axis=1)
    u[:, :20] = 0.0
    channels = dict(zip(PRESSURES, u, strict=True))
    for name, tops, below in zip(MOVED, TOPS, BELOW, strict=True):
        parts = [lfilter(b, [1.0, *f], x) for b, f, x in zip(tops, below, u, strict=True)]
        channels[name] = 3.0 + sum(parts) + noise * rng.standard_normal(n)
    return Recording(channels, STEP)


def test_output_error_of_several_inputs_finds_every_filter() -> None:
    recording = several(0.02)
    fit = load("estimators", "oe")(input=PRESSURES, output=MOVED).fit(recording)
    parts = iter(fit.model_.parts)
    for tops, below in zip(TOPS, BELOW, strict=True):
        for b, f in zip(tops, below, strict=True):
            part = next(parts)
            np.testing.assert_allclose(part.numerator, b, atol=0.02)
            np.testing.assert_allclose(part.denominator, f, atol=0.05)
    assert fit.diagnostics_.rmse == pytest.approx(0.02, rel=0.05)
    modelled = fit.predict(recording)
    u = recording.matrix(PRESSURES)
    for place, name in enumerate(MOVED):
        own = fit.model_.parts[2 * place : 2 * place + 2]
        expected = sum(
            part.output_offset
            + lfilter(part.numerator, [1.0, *part.denominator], u[:, k])
            - part.input_offset * part.gain
            for k, part in enumerate(own)
        )
        np.testing.assert_allclose(modelled[:, place], expected, atol=1e-9, err_msg=name)


def test_arx_of_several_inputs_is_ordinary_least_squares() -> None:
    recording, rows = several(0.3), np.arange(2, 1500)
    a, b = (recording[name] for name in PRESSURES)
    y = recording[MOVED[0]]
    columns = [a[rows], a[rows - 1], b[rows], b[rows - 1], y[rows - 1], y[rows - 2], np.ones(1498)]
    expected = np.linalg.lstsq(np.column_stack(columns), y[rows], rcond=None)[0]
    made = load("estimators", "arx")(input=PRESSURES, output=MOVED)
    first, second, *_ = made.fit(recording).model_.parts
    np.testing.assert_allclose([*first.numerator, *second.numerator], expected[:4], rtol=1e-6)
    assert first.denominator == second.denominator
    np.testing.assert_allclose(first.denominator, -expected[4:6], rtol=1e-6)


def test_bad_data_and_settings_are_refused() -> None:
    recording = recorded(9, 400)
    with pytest.raises(DataError):
        load("estimators", "oe")().fit(replace(recording, sample_time=None))
    with pytest.raises(DataError):
        load("estimators", "oe")(n_poles=10, n_zeros=10).fit(recording.slice(0, 25))
    with refused(ModelError, parameter="n_zeros"):
        load("estimators", "oe")(n_zeros=0).fit(recording)


def test_a_model_is_matched_by_ranges() -> None:
    recording = recorded(10, 400, noise=0.0)
    model = TransferFunction((0.5, 0.3), F, STEP)
    twisted = recording.with_channels(
        displacement=3.0 * model.simulate(recording["pressure"], sample_time=STEP) - 7
    )
    left = matched(model, twisted).simulate(twisted)["displacement"] - twisted["displacement"]
    assert np.abs(left).max() < 1e-9


WARM = ProcessModel(6.8, (5.7,), 9.1, 156.0, 0.0, 0.0, 2.0)


def warm(seed: int, n: int = 1000) -> Recording:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0, 5, (n + 500) // 50), 50)
    y = WARM.simulate(u, sample_time=0.5) + 0.1 * rng.standard_normal(u.size)
    return Recording({"pressure": u[500:], "displacement": y[500:]}, 0.5)


def test_a_run_that_starts_warm_gives_the_truth_within_its_errors() -> None:
    fit = load("estimators", "p2uz")().fit(warm(0))
    off = np.abs(fit.model_.pack() - WARM.pack())[:4]
    assert np.all(off < 3 * np.array(fit.diagnostics_.standard_errors)[:4])


@pytest.mark.parametrize("name", ["p1", "p2", "p2uz", "oe"])
def test_a_run_that_begins_elsewhere_is_fitted_from_its_first_output(name: str) -> None:
    """Case 15: a pure lag whose recordings begin in motion."""
    truth = ProcessModel(3.0, (40.0,), output_offset=2.0)

    def moved(start: float, seed: int) -> Recording:
        rng = np.random.default_rng(seed)
        u = np.interp(np.arange(1000), np.arange(0, 1040, 40), rng.uniform(1, 5, 26))
        before = Recording({"pressure": u, "displacement": np.full(1000, start)}, 0.5)
        y = truth.simulate(before)["displacement"] + 0.02 * rng.standard_normal(1000)
        return Recording({"pressure": u, "displacement": y}, 0.5)

    train, test = moved(8.0, 1), moved(16.0, 2)
    fit = load("estimators", name)().fit(train)
    assert fit.diagnostics_.rmse < 0.06
    error = fit.model_.simulate(test)["displacement"] - test["displacement"]
    assert np.sqrt(np.mean(error**2)) < 0.06


def test_poles_that_oscillate_are_found_beside_lags() -> None:
    lags, found = (load("estimators", "oe")(n_poles=n).fit(runs("muscle")) for n in (3, 4))
    assert found.diagnostics_.rmse < 0.95 * lags.diagnostics_.rmse
    assert np.abs(found.model_.poles.imag).max() > 0.1
