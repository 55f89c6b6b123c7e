"""Regression under noise with a memory: against least squares where there is none, and its levels."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mckibben.validation.regression import Regression
from tests.validation.runs import noise

SEEDS = 150


def columns(n: int) -> np.ndarray:
    t = np.arange(n)
    waves = [np.sin(2 * np.pi * k * t / 100 + k) for k in range(1, 7)]
    return np.column_stack([np.ones(n), *waves])


def test_of_white_noise_it_is_the_usual_f_test() -> None:
    x = columns(400)
    y = np.random.default_rng(4).standard_normal(400) + 0.1 * x[:, 2]
    found = Regression([(y, x)])
    assert found.noise.tolist() == [1.0]
    # the first samples are left to the noise model
    x, y = x[400 - found.rows :], y[400 - found.rows :]

    def left(some: list[int]) -> float:
        return float(np.sum((y - x[:, some] @ np.linalg.lstsq(x[:, some], y)[0]) ** 2))

    ratio = (left([0, 1]) - left([0, 1, 2, 3])) / 2 / (left(list(range(7))) / (found.rows - 7))
    expected = stats.f.sf(ratio, 2, found.rows - 7)
    assert found.test([2, 3], [0, 1]).p_value == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("alike", [0.0, 0.7, 0.95])
@pytest.mark.parametrize("lengths", [(600,), (150, 150, 150)])
def test_its_level_holds_whatever_the_noise_remembers(
    alike: float, lengths: tuple[int, ...]
) -> None:
    hits = 0
    for seed in range(SEEDS):
        pieces = [
            (noise(n, alike, 100 * k + 7919 * seed), columns(n)) for k, n in enumerate(lengths)
        ]
        hits += Regression(pieces).test([1, 2, 3], [0]).p_value <= 0.05
    low, high = stats.binom.interval(0.99, SEEDS, 0.05)
    assert low <= hits <= high


def test_noise_is_found_beside_what_it_is_hidden_by() -> None:
    x = columns(5000)
    found = Regression([(noise(5000, 0.8, 3) + 5 * x[:, 1] - 2 * x[:, 4], x)])
    assert found.noise[1] == pytest.approx(-0.8, abs=0.05)
    assert found.coefficients(range(7))[[1, 4]] == pytest.approx([5, -2], abs=0.3)


def test_independent_samples_are_those_that_know_a_mean_as_well() -> None:
    n, x = 20000, columns(20000)
    found = Regression([(noise(n, 0.8, 0), x)]).independent
    # of an autoregression of first order: (1 - 0.8) / (1 + 0.8) of them
    assert found == pytest.approx(n / 9, rel=0.1)
    assert Regression([(noise(n, 0.0, 0), x)]).independent == pytest.approx(n, rel=0.1)


def test_a_column_twice_is_once() -> None:
    x = columns(300)
    y = noise(300, 0.5, 1)
    once, twice = Regression([(y, x)]), Regression([(y, np.column_stack([x, x[:, 3]]))])
    assert twice.test([3, 7], [0]).freedom == 1
    assert twice.test([3, 7], [0]).p_value == pytest.approx(once.test([3], [0]).p_value, rel=1e-6)
    assert twice.test([7], [3]).p_value == 1.0


def test_units_do_not_matter() -> None:
    x, y = columns(500), noise(500, 0.6, 2)
    one = Regression([(y, x)]).test([1, 2], [0]).p_value
    other = Regression([(1e-6 * y, 1e5 * x)]).test([1, 2], [0]).p_value
    assert other == pytest.approx(one, rel=1e-6)


def test_spread_is_that_of_sums_over_many_drawings() -> None:
    n, x = 2000, columns(2000)
    weights = np.sin(np.arange(n) / 30)
    found = Regression([(noise(n, 0.8, 0), x)]).spread([weights])
    sums = [noise(n, 0.8, seed) @ weights for seed in range(400)]
    assert found == pytest.approx(np.std(sums), rel=0.15)
