"""Statistics of series whose correlation is known, and of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from mckibben.numerics.statistics import (
    autoregression,
    correlation_length,
    dependence,
    half_interval,
    hats,
)

SHARE = 0.8
"""Of the last sample in the next one."""


def series(n: int = 40_000, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(n)
    return np.asarray(lfilter([1.0], [1.0, -SHARE], noise))


def test_correlation_length_of_an_autoregression() -> None:
    assert correlation_length([series()]) == pytest.approx((1 + SHARE) / (1 - SHARE), rel=0.1)
    white = np.random.default_rng(1).standard_normal(40_000)
    assert correlation_length([white, white + 5.0]) == pytest.approx(1.0, abs=0.1)


def test_burgs_method_finds_an_autoregression_and_its_effective_size() -> None:
    model = autoregression([series(20_000, 1), series(20_000, 2)])
    assert model.coefficients[0] == pytest.approx(SHARE, abs=0.02)
    assert np.abs(model.coefficients[1:]).max(initial=0.0) < 0.03
    assert model.innovation == pytest.approx(1.0, rel=0.02)
    assert model.variance == pytest.approx(1 / (1 - SHARE**2), rel=0.05)
    assert model.long_run_variance == pytest.approx(1 / (1 - SHARE) ** 2, rel=0.1)
    share = model.effective_sample_size(1000) / 1000
    assert share == pytest.approx((1 - SHARE) / (1 + SHARE), rel=0.1)


def test_colouring_and_whitening_undo_each_other() -> None:
    model, slopes = autoregression([series()]), np.random.default_rng(3).standard_normal((50, 2))
    lags = np.arange(50)[:, np.newaxis] - np.arange(50)
    impulse = np.zeros(50)
    impulse[0] = model.innovation
    response = lfilter([1.0], [1.0, *-model.coefficients], impulse)
    colour = np.where(lags >= 0, response[np.abs(lags)], 0.0)
    np.testing.assert_allclose(model.coloured(slopes), colour.T @ slopes, atol=1e-12)
    np.testing.assert_allclose(
        model.whitened(colour @ slopes), model.innovation * slopes, atol=1e-12
    )


def test_half_an_interval_is_that_of_students_t() -> None:
    values = np.random.default_rng(4).standard_normal(7)
    low, high = stats.t.interval(0.9, 6, values.mean(), stats.sem(values))
    assert half_interval(values, 0.9) == pytest.approx(0.5 * (high - low))


def test_hats_interpolate() -> None:
    x = np.random.default_rng(5).uniform(0, 3, 500)
    found = hats(x, 5)
    np.testing.assert_allclose(found.sum(axis=1), 1.0)
    np.testing.assert_allclose(found @ np.quantile(x, np.linspace(0, 1, 5)), x)


def test_dependence_is_the_r2_of_a_column_on_the_others() -> None:
    columns = np.random.default_rng(6).standard_normal((300, 3))
    columns[:, 2] += 2 * columns[:, 0]
    for place, share in enumerate(dependence(columns)):
        others, own = np.delete(columns, place, axis=1), columns[:, place]
        left = own - others @ np.linalg.lstsq(others, own, rcond=None)[0]
        assert share == pytest.approx(1 - left @ left / (own @ own), abs=1e-6)
