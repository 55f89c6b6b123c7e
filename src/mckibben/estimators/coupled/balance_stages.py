"""What a balance of forces is tried with on few samples, and keeps if that explains much."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.memoryless import Contact
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.balance_loads import check_loads, with_own_loads
from mckibben.estimators.coupled.balance_prior import likely
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_starts import with_starts
from mckibben.estimators.optimisers.tracker import Tracker

GRIPS = (0.05, 0.2, 0.4, 0.8)
"""Where to begin, relative to the highest pressure."""

FOLLOWED, FIRST_STEPS, FEW_ROWS = 2, 5, 6_000
"""Starts that are followed for so many steps before the best of them is followed to its end; all are
where there are no more errors than that."""

DEAD_ZONES, DEAD_STEPS, HELPS = (0.01, 0.02, 0.035, 0.06), 10, 0.03
"""Pressures over which dead zones fade, relative to the highest; steps that each is followed for; and by
how much one has to help."""

FIRM = 0.8
"""Of the most that muscles seem to resist shortening with, share at which they go slack at first."""

EXPLAINED = 1.5
"""Times the error of all but first parts up to which that of all, settled before, is no more; it has to
help against that of all from rest, too."""

OWN_HELPS = 0.1
"""By how much what runs have of their own has to help."""


@dataclass
class Stages:
    """Trials in their order, the tracker's best being where the last one led, also if stopped between.

    Parameters
    ----------
    few : Search
        Of few samples, for what the recordings were found to ask for.
    tracker : Tracker
    steps : int
        Most steps of a descent.
    seeks_slack : bool
        Whether it is looked for slack; walls and lags then stay until it is found.
    same_zeros : bool
        Whether displacements count from the same in all recordings; else signs of loads are not told.
    dead : float
        Pressure over which a dead zone fades.
    """

    few: Search
    tracker: Tracker
    steps: int
    seeks_slack: bool
    same_zeros: bool = True
    dead: float = 0.0

    def run(self, data: TrainingData, *, loads: bool, contact: bool) -> None:
        """Make all trials.

        Parameters
        ----------
        data : TrainingData
            Of all.
        loads, contact : bool
            Whether loads of recordings' own and a dead zone are tried.
        """
        self.begin(self.few)
        self.long_held(self.few)
        self.of_runs(self.few, data, loads=loads)
        if self.seeks_slack or contact:
            self.descend(self.few, self.best, self.tracker)
        if self.seeks_slack:
            self.slack(self.few)
        if contact:
            self.dead_zone(self.few)

    @property
    def best(self) -> Array:
        """What the tracker has found."""
        assert self.tracker.best is not None
        return self.tracker.best

    def descend(
        self, search: Search, values: Array, tracker: Tracker, steps: int = DEAD_STEPS
    ) -> None:
        """Show a tracker where so many steps lead."""
        search.descend(values, min(self.steps, steps), tracker, first=self.seeks_slack)

    def begin(self, few: Search) -> None:
        """Show the tracker where the linear stage and first steps from several starts lead."""
        starts = []
        if few.belief is not None:
            values = likely(few)
            starts.append((few.cost(values), True, values))
            self.tracker.saw(values, starts[-1][0])
        grips = GRIPS if few.structure.limits.size else GRIPS[:1]
        told = few.belief is None or not all(few.still)  # of one length, forces tell of no other
        for grip, plain in product(grips if told else (), (False, True)):
            values = few.begun(grip * few.structure.highest, plain=plain)
            starts.append((few.cost(values), plain, values))
            self.tracker.saw(values, starts[-1][0])
        starts.sort(key=lambda start: start[0])
        if self.same_zeros and told:
            check_loads(few, next(values for _, plain, values in starts if not plain), self.tracker)
        for _, _, start in starts if few.n_rows <= FEW_ROWS else starts[:FOLLOWED]:
            self.descend(few, start, self.tracker, FIRST_STEPS)

    def long_held(self, few: Search) -> None:
        """Take muscles to have been settled when recordings began, if that explains these.

        Their first parts count then, which they do not where what came before is unknown.
        """
        if not any(few.warming):
            return
        settled, part = few.having(settled=True), self.tracker.part(0.3, 0.4)
        self.descend(settled, self.best, part)
        from_rest = (1.0 - OWN_HELPS) * few.cost(self.best, whole=True)
        if part.best is None or part.best_cost > min(EXPLAINED * self.tracker.best_cost, from_rest):
            return
        self.tracker.best, self.tracker.best_cost = part.best, part.best_cost
        self.few = settled

    def of_runs(self, few: Search, data: TrainingData, *, loads: bool) -> None:
        """Find what runs have of their own, too: loads and starts that help much."""
        for having in (with_own_loads, with_starts) if loads else (with_starts,):
            several = having(few, self.best, data)
            if several is None:
                continue
            part = self.tracker.part(0.4, 0.5)
            none = np.zeros(several.structure.size - few.structure.size)
            self.descend(several, np.append(self.best, none), part)
            least = (1.0 - OWN_HELPS) * few.cost(self.best, whole=True)
            if part.best is not None and part.best_cost < least:
                self.tracker.best, self.tracker.best_cost = part.best, part.best_cost
                self.few = few = several

    def slack(self, few: Search) -> None:
        """Find where muscles go slack, if that helps."""
        slack, part = few.having(slack=True), self.tracker.part(0.5, 0.6)
        self.descend(slack, slack.slackened(self.best, FIRM), part)
        if part.best is None or not part.best_cost < (1.0 - HELPS) * few.cost(self.best):
            return
        self.tracker.best = part.best
        self.few = slack

    def dead_zone(self, few: Search) -> None:
        """Find over which pressure a dead zone fades that helps most, if one does."""
        start = self.best
        cost = few.cost(start)
        least = (1.0 - HELPS) * cost
        for pressure in (np.array(DEAD_ZONES) * few.structure.highest).tolist():
            part = self.tracker.part(0.6, 0.65)
            self.descend(few.having(acting(few.data, pressure)), start, part)
            if part.best is None or not part.best_cost < cost:
                break
            cost = part.best_cost
            if cost < least:
                self.dead, start, self.tracker.best = pressure, part.best, part.best


def acted(pressure: Array, dead: float) -> Array:
    """Return what acts of pressures, of any shape, with a dead zone that fades over one."""
    if not dead:
        return pressure
    return Contact(dead).simulate(pressure.ravel()).reshape(pressure.shape)


def acting(data: TrainingData, dead: float) -> TrainingData:
    """Return data driven by what acts of the pressures."""
    runs = [replace(run, driven=acted(run.driven, dead)) for run in data.runs]
    return replace(data, runs=tuple(runs)) if dead else data
