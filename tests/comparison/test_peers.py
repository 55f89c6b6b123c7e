"""Other libraries are judged as our models are: by the same gaps, from the same starts."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import example
from mckibben.comparison.channels import Channels
from mckibben.comparison.free_run import run_free
from mckibben.comparison.memory_test import memory_test

ROOT = Path(__file__).parents[2]


@pytest.fixture
def peers(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return import_module("peers")


@pytest.fixture
def libraries(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return import_module("peers_libraries")


def test_gaps_between_branches_are_those_of_the_memory_test(peers: Any) -> None:
    train = mckibben.read(example.TRAIN)
    test = mckibben.read(example.TEST)
    block = mckibben.PIEstimator(n_operators=5).fit(train).model_
    channels = Channels(("pressure",), ("displacement",))
    found = run_free(block, test[0], channels.outputs)
    data = peers.data_of(train, test, channels)
    scaled = (found - data.offset) / data.scale
    expected = memory_test(block, test, [found], channels.pairs()).gap_ratio
    assert expected is not None
    assert peers.gap_ratio(data, [scaled]) == pytest.approx(expected, rel=1e-9)
    assert peers.gap_ratio(data, [data.tests[0].outputs]) == pytest.approx(1.0)


@pytest.mark.parametrize("count", [1, 3, 4, 9])
def test_what_is_held_back_is_not_fitted(peers: Any, count: int) -> None:
    runs = [(np.full((40, 1), float(k)), np.arange(40.0)[:, None] + 100 * k) for k in range(count)]
    fitted, held = peers.held_back(runs)
    known = {float(y) for _, outputs in fitted for y in outputs[:, 0]}
    tried = {float(y) for one in held for y in one.outputs[one.known :, 0]}
    assert not known & tried
    assert len(held) >= count // 4
    assert len(known) + len(tried) >= 40 * count - 20 * len(held)


def test_transfer_functions_run_free_from_measured_outputs(libraries: Any) -> None:
    rng = np.random.default_rng(0)
    u, known = rng.standard_normal((60, 2)), rng.standard_normal((20, 1))
    a, b = [1.0, -0.9, 0.2], [[0.3, 0.1], [0.0, -0.4]]
    model = SimpleNamespace(DENOMINATOR=[[a, a]], NUMERATOR=[b])
    expected = list(known[:, 0])
    for t in range(20, 60):
        driven = sum(b[k][lag] * u[t - 1 - lag, k] for k in range(2) for lag in range(2))
        expected.append(driven - a[1] * expected[t - 1] - a[2] * expected[t - 2])
    found = libraries._transfer(model, {})(u, known)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-12, atol=1e-12)
