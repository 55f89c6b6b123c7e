"""Deadlines are counted from the start, and missed ones are skipped and told."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import ModelError
from mckibben.registry import load
from mckibben.stream import FixedRate, run


class Clock:
    """A clock that moves when it is told to, or a hair when it is read."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        self.now += 1e-6
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def taken(works: dict[int, float], duration: float = 1.0) -> tuple[list[int], FixedRate]:
    clock = Clock()
    rate = FixedRate(0.1, duration, clock=clock, sleep=clock.sleep)
    numbers = []
    for k in rate:
        numbers.append(k)
        clock.sleep(works.get(k, 0.01))
    return numbers, rate


def test_every_deadline_is_met_when_there_is_time_and_lateness_does_not_add_up() -> None:
    numbers, rate = taken({2: 0.12})
    assert numbers == list(range(10))
    assert rate.deadlines.missed == 0
    assert rate.deadlines.work[[0, 1, 3, 4]] == pytest.approx(np.full(4, 0.01), abs=1e-5)
    assert rate.deadlines.lateness[:3].max() < 1e-5
    assert rate.deadlines.lateness[3] == pytest.approx(0.02, abs=1e-4)
    assert rate.deadlines.lateness[4:].max() < 1e-5


def test_deadlines_passed_at_work_are_skipped_and_counted() -> None:
    numbers, rate = taken({2: 0.35})
    assert numbers == [0, 1, 2, 5, 6, 7, 8, 9]
    assert rate.deadlines.missed == 2


def test_steps_and_missed_deadlines_add_up_to_the_duration() -> None:
    rng = np.random.default_rng(0)
    works = dict(enumerate(rng.exponential(0.1, 50).tolist()))
    numbers, rate = taken(works, 5.0)
    assert len(numbers) + rate.deadlines.missed == 50


@pytest.mark.parametrize(("period", "duration"), [(0.0, 1.0), (-1.0, 1.0), (0.1, 0.0)])
def test_times_must_be_positive(period: float, duration: float) -> None:
    with pytest.raises(ModelError):
        FixedRate(period, duration)


def test_run_reads_steps_and_writes_until_time_is_up() -> None:
    block, written = load("blocks", "pi").example(), []
    inputs = iter(np.linspace(0.0, 5.0, 1000))
    kept = run(
        block, lambda: [next(inputs)], lambda y: written.append(y[0]), period=0.001, duration=0.05
    )
    assert kept.work.size + kept.missed == 50
    expected = block.simulate(np.linspace(0.0, 5.0, 1000)[: len(written)])
    np.testing.assert_array_equal(written, expected)


def test_ctrl_c_ends_the_loop_and_keeps_its_statistics() -> None:
    def read() -> list[float]:
        raise KeyboardInterrupt

    kept = run(load("blocks", "pi").example(), read, lambda y: None, period=0.001)
    assert kept.work.size == 1
