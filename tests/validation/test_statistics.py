"""Tests of whiteness and of columns: their levels, and what they are there to find."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from mckibben.validation.regression import Regression
from mckibben.validation.whiteness import whiteness

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
