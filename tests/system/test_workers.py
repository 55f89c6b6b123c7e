"""Processes that work for this one."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import time
from typing import Any

import pytest

from mckibben.errors import DataError
from mckibben.system.workers import WorkerError, Workers, all_of, in_turn
from tests.refusals import refused


def square(common: int, item: int, tell: Any) -> int:
    tell("at it", item)
    if item < 0:
        raise DataError("too small", remedy="give more", channel="pressure")
    if item == 13:
        os.kill(os.getpid(), signal.SIGKILL)
    if item > 100:
        time.sleep(60)
    return common + item**2


class OddError(Exception):
    """It can be pickled, but not made again."""

    def __init__(self, a: int, *, b: int) -> None:
        super().__init__(f"{a} {b}")


def raise_odd(common: int, item: int, tell: Any) -> None:
    raise OddError(item, b=2)


@pytest.mark.long
def test_everything_comes_back_and_is_told() -> None:
    told: list[Any] = []
    with Workers(2, 1) as workers:
        found = {
            o.index: o.result()
            for o in workers.results(square, [3, 4, 5], lambda *a: told.append(a))
        }
    assert found == {0: 10, 1: 17, 2: 26}
    assert {item for item in told if len(item) > 1} == {(k, "at it", k + 3) for k in range(3)}
    assert [item for item in told if len(item) == 1] == [(0,), (1,), (2,)]
    assert found == {o.index: o.result() for o in in_turn(square, 1, [3, 4, 5])}


def square_of(common: None, item: int, tell: Any) -> int:
    return item**2


def test_errors_arrive_whole_and_a_process_that_dies_takes_its_own_work_only() -> None:
    with Workers(2, 0) as workers:
        found = {o.index: o for o in workers.results(square, [1, 13, 2, -1, 4])}
        (odd,) = workers.results(raise_odd, [1])
    assert isinstance(found[1].error, WorkerError)
    assert [found[k].value for k in (0, 2, 4)] == [1, 4, 16]
    with pytest.raises(DataError) as error:
        found[3].result()
    assert (error.value.channel, error.value.remedy) == ("pressure", "give more")
    with refused(WorkerError, remedy=False, names=("OddError", 1, 2)):
        odd.result()
    whole = DataError("odd", remedy="even", file="a.csv", row=3)
    assert str(pickle.loads(pickle.dumps(whole))) == str(whole)


@pytest.mark.long
def test_leaving_ends_them_at_once() -> None:
    before = set(multiprocessing.active_children())  # joblib's, of other tests
    with Workers(2, 0) as workers:
        results = workers.results(square, [2, 200, 300])
        assert next(results).value == 4
        started = time.monotonic()
    assert time.monotonic() - started < 2
    assert set(multiprocessing.active_children()) <= before


def square_after(common: None, item: float, tell: Any) -> float:
    time.sleep(item)
    return item**2


def test_results_of_all_are_in_the_order_of_the_items() -> None:
    items = [0.5, 0.0, 0.01, 0.02]  # the first is finished last
    assert all_of(square_after, items, 2) == [item**2 for item in items]


def test_numbers_of_processes_are_checked() -> None:
    with refused(DataError, parameter="jobs"):
        all_of(square_of, [1], 0)
