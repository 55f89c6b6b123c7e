"""The test of whiteness: its level on noise of any kind, and what it is there to find."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from mckibben.validation.whiteness import whiteness
from tests.validation.runs import noise

SEEDS = 1000

KINDS: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "normal": lambda rng, n: rng.standard_normal(n),
    "uniform": lambda rng, n: rng.uniform(-1, 1, n),
    "heavy tails": lambda rng, n: rng.standard_t(4, n),
    "louder by turns": lambda rng, n: rng.standard_normal(n) * (1 + np.sin(np.arange(n) / 20)),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lengths", [(80,), (800,), (60,) * 8])
def test_white_noise_is_rejected_as_often_as_is_said(kind: str, lengths: tuple[int, ...]) -> None:
    hits = 0
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        p = whiteness([3 + KINDS[kind](rng, n) for n in lengths]).p_value
        assert p is not None
        hits += p <= 0.01
    low, high = stats.binom.interval(0.999, SEEDS, 0.01)
    assert low <= hits <= high


def test_autocorrelation_is_that_of_numpy() -> None:
    e = noise(500, 0.6, 1)
    found = whiteness([e])
    centred = e - e.mean()
    usual = np.correlate(centred, centred, "full")[500:] / (centred @ centred)
    assert found.autocorrelation == pytest.approx(usual[: len(found.lags)], abs=3 / 500)
    assert found.p_value is not None
    assert found.p_value < 1e-6


def test_lags_reach_beyond_the_memory() -> None:
    e = noise(6000, 0.99, 1)
    found = whiteness([e], 300)
    assert found.lags[:50] == tuple(range(1, 51))
    assert found.lags[-1] == 300
    assert found.p_value == whiteness([e]).p_value


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
