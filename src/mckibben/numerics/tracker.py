"""Progress and best point of a search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mckibben.arrays import Array
from mckibben.numerics.descent import Errors
from mckibben.numerics.statistics import rms

Progress = Callable[[float, float], None]
"""Called with the share of the work done, 0 to 1, and the best RMSE so far."""


@dataclass
class Tracker:
    """Stores the best point of a search, and reports progress."""

    progress: Progress | None = None
    budget: int = 1
    """Expected number of evaluations, for the progress."""

    evaluations: int = 0
    best_cost: float = np.inf
    best: Array | None = None
    near: Array | None = None
    """Result of a search on nearly the same data, from which the next one goes on."""

    whole: Tracker | None = None
    """That of which this one is a part."""

    notes: list[str] = field(default_factory=list)
    """Notes for the user on the result."""

    @property
    def found(self) -> Array:
        """The best point; there has been one."""
        assert self.best is not None
        return self.best

    def reached(self, share: float) -> None:
        """Report the share of the work done."""
        if self.progress is not None:
            self.progress(share, self.best_cost)

    def part(self, first: float, last: float) -> Tracker:
        """Return a tracker of a part of the work, between two shares of it.

        It keeps a best of its own; its evaluations are those of the whole, too.
        """

        def report(share: float, best: float) -> None:
            if self.progress is not None:
                self.progress(first + (last - first) * share, best)

        return Tracker(progress=report, budget=self.budget, whole=self)

    def watched(self, errors: Errors, unit: float = 1.0) -> Errors:
        """Return the same function, which registers every evaluation, its errors in a unit."""

        def watched(point: Array) -> tuple[Array, Callable[[], Array]]:
            result = errors(point)
            self.update(point, unit * rms(result[0]))
            return result

        return watched

    def update(self, point: Array, cost: float) -> None:
        """Register one evaluation."""
        one: Tracker | None = self
        while one is not None:
            one.evaluations, one = one.evaluations + 1, one.whole
        if cost < self.best_cost:
            self.best_cost, self.best = cost, np.array(point)
        if self.progress is not None and self.evaluations % 16 == 0:
            self.progress(min(self.evaluations / self.budget, 0.99), self.best_cost)
