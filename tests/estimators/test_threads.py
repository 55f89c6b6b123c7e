"""Linear algebra has one thread while fitting, here and in other processes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from joblib import Parallel, delayed
from threadpoolctl import threadpool_info, threadpool_limits

from mckibben import GPI, GPIEstimator, Recording
from mckibben.signals import triangle
from mckibben.system.workers import Workers


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def seen_while_fitting(recording: Recording) -> set[int]:
    found: set[int] = set()
    GPIEstimator(n_operators=3, n_starts=4).fit(
        recording, progress=lambda share, best: found.update(threads())
    )
    return found


def in_a_process(common: None, recording: Recording, tell: Any) -> set[int]:
    return threads()


@pytest.fixture(scope="module")
def recording() -> Recording:
    u = triangle(np.arange(0, 8, 0.02), 4.0, 5.0)
    return Recording({"pressure": u, "displacement": GPI.example().simulate(u)}, 0.02)


def test_one_thread_while_fitting_and_as_before_after(recording: Recording) -> None:
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        assert seen_while_fitting(recording) == {1}
        assert threads() == before


@pytest.mark.long
def test_one_thread_in_workers_and_in_a_users_own_jobs(recording: Recording) -> None:
    with Workers(1) as workers:
        (outcome,) = workers.results(in_a_process, [recording])
    assert outcome.result() == {1}
    (found,) = Parallel(n_jobs=2)([delayed(seen_while_fitting)(recording)])
    assert found == {1}
