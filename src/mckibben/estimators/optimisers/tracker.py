"""What goes with every search: its progress, the best so far, and what an interrupt leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

import numpy as np

from mckibben.arrays import Array

Progress = Callable[[float, float], None]
"""Called with the share of the work done, 0 to 1, and the best RMSE so far."""


_whole: ContextVar[bool] = ContextVar("_whole", default=False)


@contextmanager
def whole_searches() -> Iterator[None]:
    """Let an interrupt end a fit within this context, instead of leaving the best found until then.

    A search cut short is no model to be ranked, or kept as finished.
    """
    before = _whole.set(True)
    try:
        yield
    finally:
        _whole.reset(before)


@dataclass
class Tracker:
    """Keeps the best point of a search, reports progress, and survives an interrupt."""

    progress: Progress | None = None
    budget: int = 1
    """Expected number of evaluations, for the progress."""

    evaluations: int = 0
    best_cost: float = np.inf
    best: Array | None = None
    interrupted: bool = False
    notes: list[str] = field(default_factory=list)
    """Notes for the user on the result."""

    def reached(self, share: float) -> None:
        """Report the share of the work that is done, unless it is broken off."""
        if self.progress is not None and not self.interrupted:
            self.progress(share, self.best_cost)

    def part(self, first: float, last: float) -> Tracker:
        """Return a tracker of a part of the work, which lies between two shares of it.

        It keeps a best of its own.
        """

        def told(share: float, best: float) -> None:
            if self.progress is not None:
                self.progress(first + (last - first) * share, best)

        return Tracker(progress=told, budget=self.budget)

    def saw_all(self, part: Tracker) -> None:
        """Take note of a part that is done, but for its best."""
        self.evaluations += part.evaluations
        self.interrupted = self.interrupted or part.interrupted

    def end(self) -> None:
        """Pass an interrupt on where only whole searches are wanted.

        Raises
        ------
        KeyboardInterrupt
            If the search was interrupted.
        """
        if self.interrupted and _whole.get():
            raise KeyboardInterrupt

    @contextmanager
    def searching(self) -> Iterator[None]:
        """Let an interrupt end the search done within this context, once there is something to keep.

        Raises
        ------
        KeyboardInterrupt
            If there is nothing yet.
        """
        try:
            yield
        except KeyboardInterrupt:
            if self.best is None:
                raise
            self.interrupted = True

    def saw(self, point: Array, cost: float) -> None:
        """Take note of one evaluation."""
        self.evaluations += 1
        if cost < self.best_cost:
            self.best_cost, self.best = cost, np.array(point)
        if self.progress is not None and self.evaluations % 16 == 0:
            self.progress(min(self.evaluations / self.budget, 0.99), self.best_cost)
