"""Models fitted by any executor: the same leaderboard, with progress, and ended by an interrupt."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, Recording, registry
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.comparison.ranking import Standing, compare
from mckibben.signals import irregular_triangle, triangle

TIME = np.arange(0, 12, 0.02)
MODELS = {"few": "pi", "many": registry.load("estimators", "pi")(n_operators=20), "map": "mpi"}


def recorded(u: np.ndarray, seed: int) -> Recording:
    y = GPI.example().simulate(u) + 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    return Recording({"pressure": u, "displacement": y}, 0.02, meta={"name": f"run {seed}"})


TRAIN = recorded(triangle(TIME, 4.0, [5.0, 4.2, 3.4]), 0)
TEST = recorded(irregular_triangle(TIME, 12, 5.0, seed=3), 1)


@contextmanager
def dask() -> Iterator[Executor]:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=None, silence_logs=logging.ERROR
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client.get_executor()


@contextmanager
def processes() -> Iterator[Executor]:
    with ProcessPoolExecutor(2, mp_context=get_context("forkserver")) as executor:
        yield executor


def comparable(board: Leaderboard) -> Any:
    rows = board.to_dict()["rows"]
    return [{k: v for k, v in row.items() if k not in ("fit_seconds", "step_ns")} for row in rows]


@pytest.mark.parametrize("started", [processes, dask])
def test_an_executor_gives_the_same_leaderboard(started: Any) -> None:
    told: list[Standing] = []
    with started() as executor:
        board = compare(TRAIN, TEST, models=MODELS, executor=executor, progress=told.append)
    assert comparable(board) == comparable(compare(TRAIN, TEST, models=MODELS, jobs=1))
    assert {row.model for row in board.rows} == set(MODELS)
    assert {one.done for one in told} == {0, 1, 2, 3}


def test_an_interrupt_leaves_what_was_finished_and_starts_nothing_more() -> None:
    def impatient(board: Leaderboard) -> None:
        raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as executor:
        board = compare(TRAIN, TEST, models=MODELS, executor=executor, found=impatient)
    assert board.stopped
    assert len(board.rows) == 1
    assert len(board.pending) == 2


def test_labels_have_their_own_settings() -> None:
    board = compare(
        TRAIN, TEST, models={"a": "pi", "b": "pi"}, settings={"b": {"n_operators": 3}}, jobs=1
    )
    counts = {row.model: row.n_parameters for row in board.rows}
    assert counts["b"] < counts["a"]
