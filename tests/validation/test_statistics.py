"""Tests of whiteness and of columns: their levels, and what they are there to find."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from mckibben.validation.regression import Regression
from mckibben.validation.whiteness import whiteness
from tests.validation.runs import noise

KINDS: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "normal": lambda rng, n: rng.standard_normal(n),
    "heavy tails": lambda rng, n: rng.standard_t(4, n),
    "louder by turns": lambda rng, n: rng.standard_normal(n) * (1 + np.sin(np.arange(n) / 20)),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lengths", [(80,), (60,) * 8])
def test_white_noise_is_rejected_as_often_as_is_said(kind: str, lengths: tuple[int, ...]) -> None:
    hits = 0
    for seed in range(400):
        rng = np.random.default_rng(seed)
        p = whiteness([3 + KINDS[kind](rng, n) for n in lengths]).p_value
        assert p is not None
        hits += p <= 0.05
    low, high = stats.binom.interval(0.999, 400, 0.05)
    assert low <= hits <= high


def test_autocorrelation_is_that_of_numpy() -> None:
    e = noise(500, 0.6, 1)
    found = whiteness([e])
    centred = e - e.mean()
    known = np.correlate(centred, centred, "full")[500:] / (centred @ centred)
    assert found.autocorrelation == pytest.approx(known[: len(found.lags)], abs=3 / 500)
    assert found.p_value is not None
    assert found.p_value < 1e-6


def test_nothing_crosses_from_one_recording_into_the_next() -> None:
    # every recording begins as the one before ends
    pieces = [np.random.default_rng(k).standard_normal(100) for k in range(50)]
    for one, other in pairwise(pieces):
        other[:10] = one[-10:]
    apart, joined = whiteness(pieces), whiteness([np.concatenate(pieces)])
    assert joined.autocorrelation[9] > 0.07
    assert abs(apart.autocorrelation[9]) < 0.05
    assert apart.p_value is not None
    assert apart.p_value > 0.001


def columns(n: int) -> np.ndarray:
    t = np.arange(n)
    waves = [np.sin(2 * np.pi * k * t / 100 + k) for k in range(1, 7)]
    return np.column_stack([np.ones(n), *waves])


def test_of_white_noise_the_test_of_columns_is_the_usual_f_test() -> None:
    x = columns(400)
    y = np.random.default_rng(4).standard_normal(400) + 0.1 * x[:, 2]
    found = Regression([(y, x)])
    # the first samples are left to the noise model
    x, y = x[400 - found.rows :], y[400 - found.rows :]

    def left(some: list[int]) -> float:
        return float(np.sum((y - x[:, some] @ np.linalg.lstsq(x[:, some], y)[0]) ** 2))

    ratio = (left([0, 1]) - left([0, 1, 2, 3])) / 2 / (left(list(range(7))) / (found.rows - 7))
    expected = stats.f.sf(ratio, 2, found.rows - 7)
    assert found.test([2, 3], [0, 1]).p_value == pytest.approx(expected, rel=1e-9)


def test_noise_is_found_beside_what_it_is_hidden_by() -> None:
    n, x = 5000, columns(5000)
    found = Regression([(noise(n, 0.8, 3) + 5 * x[:, 1] - 2 * x[:, 4], x)])
    assert found.noise[1] == pytest.approx(-0.8, abs=0.05)
    assert found.coefficients(range(7))[[1, 4]] == pytest.approx([5, -2], abs=0.3)
    # of an autoregression of first order (1 - 0.8) / (1 + 0.8) of the samples are independent
    assert found.independent == pytest.approx(n / 9, rel=0.2)


def test_units_do_not_matter_and_a_column_twice_is_once() -> None:
    x, y = columns(500), noise(500, 0.6, 2)
    one = Regression([(y, x)]).test([1, 2], [0]).p_value
    assert Regression([(1e-6 * y, 1e5 * x)]).test([1, 2], [0]).p_value == pytest.approx(
        one, rel=1e-6
    )
    twice = Regression([(y, np.column_stack([x, x[:, 2]]))]).test([1, 2, 7], [0])
    assert twice.freedom == 2
    assert twice.p_value == pytest.approx(one, rel=1e-6)
