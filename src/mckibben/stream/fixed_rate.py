"""A loop at a fixed rate, with deadline statistics.

Deadlines are counted from the start, so that lateness does not add up: after a late step the next
ones catch up, and deadlines that passed while a step took too long are skipped and counted as missed.
Python on a desktop system gives no guarantee; the statistics have what was achieved.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import require

MOST_STORED = 1_000_000
"""Largest number of steps in the statistics: the latest."""

SPIN = 0.0005
"""Before a deadline, how long to watch the clock instead of sleeping [s]: sleep is never exact."""


@dataclass(frozen=True)
class Deadlines:
    """Deadline statistics of a loop.

    Parameters
    ----------
    period : float
        Time from deadline to deadline [s].
    lateness : array, shape (n,)
        How long after its deadline every step started [s].
    work : array, shape (n,)
        How long every step took [s].
    missed : int
        Deadlines that passed while a step was still at work.
    """

    period: float
    lateness: Array
    work: Array
    missed: int

    def __str__(self) -> str:
        """Return one sentence."""
        if not self.work.size:
            return "no step was taken"
        late, work = 1e6 * np.quantile(self.lateness, [0.5, 0.999]), 1e6 * self.work
        return (
            f"{self.work.size} steps every {1e3 * self.period:g} ms, {self.missed} deadlines missed; "
            f"late by {late[0]:.0f} us, 99.9 % within {late[1]:.0f} us, at most "
            f"{1e6 * self.lateness.max():.0f} us; work {np.median(work):.0f} us, at most "
            f"{work.max():.0f} us"
        )


@dataclass
class FixedRate:
    """Iterable of deadlines: each iteration starts at the next one.

    Parameters
    ----------
    period : float
        Time from deadline to deadline [s], positive.
    duration : float, optional
        When to end [s]; default never.
    clock, sleep : callable
        Time in seconds, and waiting; other than real for tests.

    Examples
    --------
    >>> from mckibben.stream import FixedRate
    >>> rate = FixedRate(0.001, duration=0.01)
    >>> [k for k in rate][-1] <= 9
    True
    >>> rate.deadlines.work.size + rate.deadlines.missed
    10
    """

    period: float
    duration: float = math.inf
    clock: Callable[[], float] = time.perf_counter
    sleep: Callable[[float], None] = time.sleep
    _lateness: deque[float] = field(default_factory=deque, init=False, repr=False)
    _work: deque[float] = field(default_factory=deque, init=False, repr=False)
    _missed: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        require(0 < self.period < math.inf, "period", self.period, "a positive time [s]")
        require(self.duration > 0, "duration", self.duration, "a positive time [s]")

    @property
    def deadlines(self) -> Deadlines:
        """Deadline statistics so far."""
        return Deadlines(self.period, np.array(self._lateness), np.array(self._work), self._missed)

    def __iter__(self) -> Iterator[int]:
        """Yield the number of every deadline, from 0, at its time."""
        self._lateness, self._work = deque(maxlen=MOST_STORED), deque(maxlen=MOST_STORED)
        self._missed = 0
        n = math.inf if math.isinf(self.duration) else round(self.duration / self.period)
        start, number = self.clock(), 0
        while number < n:
            deadline = start + number * self.period
            self._wait(deadline)
            began = self.clock()
            try:
                yield number
            finally:
                ended = self.clock()
                self._lateness.append(began - deadline)
                self._work.append(ended - began)
            following = max(number + 1, math.floor((ended - start) / self.period))
            self._missed += int(min(following, n)) - number - 1
            number = following

    def _wait(self, deadline: float) -> None:
        while True:
            left = deadline - self.clock()
            if left <= 0.0:
                return
            if left > SPIN:
                self.sleep(left - SPIN)
