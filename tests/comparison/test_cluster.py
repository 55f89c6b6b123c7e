"""A Dask cluster gives what a serial run gives, to the bit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from mckibben import DataError, Recording, compare
from mckibben.comparison.cluster import on_cluster
from mckibben.comparison.results import Leaderboard

distributed = pytest.importorskip("distributed")

pytestmark = [pytest.mark.filterwarnings("ignore"), pytest.mark.long]

MODELS = ["pi", "eupi", "arx"]


def recordings(n: int) -> list[Recording]:
    """Return noisy loops, each of its own."""
    found = []
    for seed in range(n):
        rng = np.random.default_rng(seed)
        t = np.arange(400) * 0.05
        u = 2.5 - 2.5 * np.cos(2 * np.pi * t / 5) * np.exp(-t / 40)
        y = np.zeros_like(u)
        state = 0.0
        for k, value in enumerate(u):
            state = min(max(state, value - 0.3), value + 0.3)
            y[k] = 5 * value + 2 * state + rng.normal(0, 0.01)
        found.append(
            Recording({"pressure": u, "displacement": y}, 0.05, meta={"name": f"run {seed}"})
        )
    return found


TRAIN_AND_TEST = recordings(4), recordings(5)[4]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Start a cluster of two processes on this machine."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as found:
        yield found


def same(one: Leaderboard, other: Leaderboard) -> None:
    assert [row.model for row in one.rows] == [row.model for row in other.rows]
    for a, b in zip(one.rows, other.rows, strict=True):
        assert a.reason == b.reason
        assert a.test == b.test
        assert a.rmse_interval == b.rmse_interval
        assert a.memory == b.memory
        assert a.block is not None
        assert b.block is not None
        np.testing.assert_array_equal(a.block.pack(), b.block.pack())


@pytest.fixture(scope="module")
def serial() -> Leaderboard:
    """What one process gives."""
    return compare(*TRAIN_AND_TEST, models=MODELS, jobs=1)


def test_a_cluster_gives_the_serial_result_to_the_bit(cluster: Any, serial: Leaderboard) -> None:
    with on_cluster(cluster.scheduler_address):
        same(compare(*TRAIN_AND_TEST, models=MODELS), serial)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x", ""])
def test_a_scheduler_that_does_not_answer_is_named(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mckibben.comparison.cluster.PATIENCE", 1)
    with pytest.raises(DataError, match="Dask"), on_cluster(address):
        pass
