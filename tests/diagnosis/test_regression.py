"""Tests of columns hold their level, and find what is there, where residuals remember."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from mckibben.arrays import Array
from mckibben.diagnosis.regression import FTest, Regression

SEEDS = 150
LEVEL = 0.05


def f_test(e: Array, chosen: Array, beside: Array) -> FTest:
    places = tuple(range(chosen.shape[1]))
    both = np.column_stack([chosen, beside])
    return Regression([e], [both]).test(places, tuple(range(len(places), both.shape[1])))


def columns(n: int) -> Array:
    t = np.arange(n)
    waves = [np.sin(2 * np.pi * k * t / 100 + k) for k in range(1, 7)]
    return np.column_stack([np.ones(n), *waves, t / n])


def noise(kind: str, n: int, seed: int) -> Array:
    white = np.random.default_rng(seed).standard_normal(2 * n)
    size = 1 + 0.9 * columns(n)[:, 2]
    found = {
        "white": white[n:],
        "slow": np.asarray(lfilter([1.0], [1.0, -0.97], white))[n:],
        "unequal": white[n:] * size,
    }
    return found[kind]


@pytest.mark.parametrize("kind", ["white", "slow", "unequal"])
@pytest.mark.parametrize("lengths", [(500,), (120,) * 4])
def test_noise_is_rejected_as_often_as_the_level_says(kind: str, lengths: tuple[int, ...]) -> None:
    x = [columns(n) for n in lengths]
    hits = np.zeros(3)
    for seed in range(SEEDS):
        e = [noise(kind, n, 1000 * seed + place) for place, n in enumerate(lengths)]
        found = Regression(e, x)
        tests = ((1, 2), (3, 4, 5, 6), (7,))
        hits += [found.test(one, (0,)).p_value <= LEVEL for one in tests]
    # the larger of two p-values rejects less often than either
    assert (hits <= stats.binom.ppf(0.999, SEEDS, LEVEL)).all()
    assert hits.sum() >= stats.binom.ppf(1e-3, SEEDS, LEVEL)


@pytest.mark.parametrize("kind", ["white", "slow", "unequal"])
def test_what_is_there_is_found_and_what_is_beside_is_not(kind: str) -> None:
    x = columns(600)
    e = noise(kind, 600, 7) + 3.0 * x[:, 3]
    found = Regression([e], [x])
    assert found.test((3,), (0,)).p_value < 1e-6
    assert found.test((5, 6), (0,)).p_value > 1e-3
    assert f_test(e, x[:, [3]], x[:, [0]]).p_value < 1e-6
    assert found.coefficient(3) == pytest.approx(3.0, abs=0.7)


def test_of_white_noise_it_is_no_smaller_than_the_usual_f_test() -> None:
    x = columns(400)[:, :7]
    y = np.random.default_rng(4).standard_normal(400) + 0.2 * x[:, 2]
    found = Regression([y], [x])
    assert found.noise.coefficients.size == 0

    def left(some: list[int]) -> float:
        return float(np.sum((y - x[:, some] @ np.linalg.lstsq(x[:, some], y)[0]) ** 2))

    ratio = (left([0, 1]) - left([0, 1, 2, 3])) / 2 / (left(list(range(7))) / (400 - 7))
    usual = stats.f.sf(ratio, 2, 400 - 7)
    test = found.test((2, 3), (0, 1))
    assert usual * (1 - 1e-9) <= test.p_value < 10 * usual
    assert test.explained == pytest.approx(left([0, 1]) - left([0, 1, 2, 3]))


def test_units_and_dependent_columns_change_nothing() -> None:
    x, e = columns(500), noise("slow", 500, 3)
    expected = f_test(e, x[:, 1:4], x[:, [0]])
    twice = np.column_stack([x[:, 1:4] * 1e-5, x[:, 1] + x[:, 2]])
    found = f_test(1e-6 * e, twice, 1e3 * x[:, [0]])
    assert found.p_value == pytest.approx(expected.p_value, rel=1e-4)
    assert f_test(0 * e, x[:, 1:], x[:, [0]]).p_value == 1.0


def test_the_deviation_of_a_mean_is_that_of_slow_noise() -> None:
    n = 800
    x = np.ones((n, 1))
    means = [noise("slow", n, seed).mean() for seed in range(60)]
    told = np.median(
        [
            Regression([noise("slow", n, seed)], [x]).deviation([np.ones(n) / n])
            for seed in range(30)
        ]
    )
    assert told == pytest.approx(np.std(means), rel=0.35)
