"""Identification of a balance of forces.

First the forces that the muscles lack where they were measured, linear in almost all coefficients, by
least squares weighted by stiffness; then the displacements of the free run, by Gauss-Newton steps with
exact derivatives. Both keep to what physics asks (`mckibben.estimators.coupled.balance_structure`).
Muscles may be more than the coordinates (`mckibben.estimators.coupled.balance_coordinates`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Interval

from mckibben.arrays import Array
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.coupled.load_estimate import parts_of
from mckibben.blocks.memoryless.affine import Affine
from mckibben.blocks.memoryless.contact import LOST, Contact
from mckibben.errors import ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.uncertainty import unknown
from mckibben.estimators.coupled.balance_checks import (
    check_directions,
    moving,
    not_at_rest,
    one_speed,
    other_zeros,
    telling,
)
from mckibben.estimators.coupled.balance_coordinates import (
    directions_of,
    in_words,
    shortened,
    together,
)
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_structure import APART, Structure
from mckibben.estimators.coupled.balance_words import held_back, sentences
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.estimators.optimisers.tracker import Tracker

LOADS = ("N",)
"""Units of what loads a muscle, instead of scheduling its springs."""

LIMITED = ("bar", "V")
"""Units of what the hardware limits."""

GRIPS = (0.05, 0.2, 0.4, 0.8)
"""Where to begin, relative to the highest pressure."""

FOLLOWED, FIRST_STEPS, FEW_ROWS = 2, 5, 6_000
"""Starts that are followed for so many steps before the best of them is followed to its end; all are
where there are no more errors than that."""

FAR = 0.5
"""Displacements that all are further from zero than this share of their range count from elsewhere."""

DEAD_ZONES, DEAD_STEPS, HELPS = (0.01, 0.02, 0.035, 0.06), 10, 0.03
"""Pressures over which dead zones fade, relative to the highest; steps that each is followed for; and by
how much one has to help."""

FIRM = 0.8
"""Of the most that muscles seem to resist shortening with, share at which they go slack at first."""

FIRST_SAMPLES, MORE_SAMPLES, MOST_SAMPLES = 8_000, 15_000, 60_000
"""By which starts, slack and dead zones are compared; to find the way by; and for the last steps."""

EXPLAINED = 1.5
"""Times the error of all but first parts up to which that of all, settled before, is no more."""

LAST_STEPS = 10
"""On all recordings, after those on a few of them."""

AT_START = 0.02
"""Displacement at the start of a run that is none, relative to the range."""


@dataclass(kw_only=True, repr=False, eq=False)
class BalanceEstimator(CoupledEstimator):
    """Balance of forces with friction and relaxation of muscles in parallel, under load, scheduled.

    Parameters
    ----------
    n_stops : int
        Friction elements, which break away after travels from ``finest`` to half the stroke.
    finest : float
        Shortest such travel, relative to the stroke.
    lags : sequence of float, optional
        Time constants of what relaxes [s], where to begin: in order, each twice the last or more, from
        two samples to half the longest recording. Default ``n_lags`` from half a second to a third of
        that recording.
    n_lags : int
        How many; 0 for muscles without time.
    elasticity : int
        Degree of the elastic polynomial.
    area : int
        Degree of the area's.
    degree : int
        Highest power of what schedules the springs.
    tare : bool, optional
        Whether displacements count from rest at the start of every recording. Default: where all of
        several scheduled muscles' recordings start there.
    contact : bool
        Whether a dead zone of small pressures is looked for; default so.
    slack : bool, optional
        Whether it is looked for forces at which muscles go slack; default of several muscles.
    mass : bool
        Whether what hangs at the muscles is so heavy that its acceleration matters; then they are not
        found to go slack.
    ridge : float
        Damping of the coefficients.
    steps : int
        Most Gauss-Newton steps.
    """

    effort: ClassVar[float] = 1.0
    alone: ClassVar[bool] = True
    fewer_outputs: ClassVar[bool] = True

    n_stops: Annotated[int, Interval(ge=0, le=30)] = 6
    finest: Annotated[float, Interval(gt=0, lt=0.5)] = 0.003
    lags: tuple[Annotated[float, Gt(0)], ...] | None = None
    n_lags: Annotated[int, Interval(ge=0, le=10)] = 2
    elasticity: Annotated[int, Interval(ge=1, le=9)] = 9
    area: Annotated[int, Interval(ge=0, le=6)] = 2
    degree: Annotated[int, Interval(ge=1, le=4)] = 2
    tare: bool | None = None
    contact: bool = True
    slack: bool | None = None
    mass: bool = False
    ridge: Annotated[float, Ge(0)] = 1e-6
    steps: Annotated[int, Interval(ge=0, le=1000)] = 25

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the balance, solved for displacements."""
        data, notes = telling(data)
        tracker.notes += [*notes, *other_zeros(data)]
        behind = None
        if len(data.inputs) > len(data.outputs):
            along = directions_of(data)
            tracker.notes.append(in_words(data, along))
            coordinates, data = data.outputs, shortened(data, along)
            behind = together(data, along, coordinates)
        check_directions(data)
        ways = directions(data)
        data = turned(data, ways)
        structure = self.structure(data, tracker)
        dead = 0.0
        with tracker.searching():
            few = Search(data, structure, self.ridge).of_few(FIRST_SAMPLES)
            slack = len(data.inputs) > 1 if self.slack is None else self.slack
            slack = slack and not self.mass
            self._begin(few, tracker, slack)
            few = self._long_held(few, tracker, slack)
            structure = few.structure
            assert tracker.best is not None
            if slack or self.contact:
                few.descend(tracker.best, min(self.steps, DEAD_STEPS), tracker, first=slack)
            if slack:
                structure = self._slack(few, tracker)
            few = Search(few.data, structure, self.ridge)
            if self.contact:
                dead, tracker.best = self._dead_zone(few, tracker, slack)
            search = Search(acting(data, dead), structure, self.ridge).of_few(MOST_SAMPLES)
            few = search.of_few(MORE_SAMPLES)
            tracker.best_cost = few.cost(tracker.best)
            few.descend(tracker.best, self.steps, tracker)
            tracker.reached(0.7)
            if few is not search:
                tracker.best_cost = search.cost(tracker.best)
                search.descend(tracker.best, min(self.steps, LAST_STEPS), tracker)
        if tracker.best is None or not np.isfinite(tracker.best_cost):
            raise ModelError(
                "no balance of forces runs free over these recordings. Remedy: check that displacements "
                "count as shortening and loads as pulling the muscle longer"
            )
        limited = data.inputs[0].unit in LIMITED
        ends = np.array([min(float(data.lowest.min()), 0.0), float(data.highest.max())])
        low, high = acted(ends, dead).tolist()
        balance = structure.block(tracker.best, (low, high) if limited else None)
        tracker.notes += not_at_rest(data, settled=structure.settled)
        tracker.notes += [*held_back(balance, structure), *sentences(balance, structure)]
        if dead:
            tracker.notes.append(
                f"small pressures act little: as if {LOST * dead:.3g} {data.inputs[0].unit} were lost, "
                "fully from about four times that"
            )
        contacts = [Contact(dead, channel, channel) for channel in data.inputs] if dead else []
        sensors = [
            Affine(gain, offset, channel, channel)
            for (gain, offset), channel in zip(ways, data.outputs, strict=True)
            if any(way != (1.0, 0.0) for way in ways)
        ]
        parts = [*_side_by_side(contacts), balance.inverse(), *_side_by_side(sensors)]
        parts += [behind] if behind else []
        return parts[0] if len(parts) == 1 else Series(tuple(parts))

    def _begin(self, few: Search, tracker: Tracker, first: bool) -> None:
        """Show the tracker where the linear stage and first steps from several starts lead."""
        starts = []
        for grip, plain in product(GRIPS if self.n_stops else GRIPS[:1], (False, True)):
            values = few.begun(grip * few.structure.highest, plain=plain)
            starts.append((few.cost(values), plain, values))
            tracker.saw(values, starts[-1][0])
        starts.sort(key=lambda start: start[0])
        few.check_loads(next(values for _, plain, values in starts if not plain), tracker)
        for _, _, start in starts if few.n_rows <= FEW_ROWS else starts[:FOLLOWED]:
            few.descend(start, min(self.steps, FIRST_STEPS), tracker, first=first)

    def _long_held(self, few: Search, tracker: Tracker, first: bool) -> Search:
        """Return the search of muscles that were settled when recordings began, if that explains these.

        Their first parts count then, which they do not where what came before is unknown. The tracker's
        best is then where it leads.
        """
        if tracker.best is None or not any(few.unsure):
            return few
        settled = Search(few.data, replace(few.structure, settled=True), self.ridge)
        settled.span = few.span
        part = tracker.part(0.3, 0.5)
        settled.descend(tracker.best, min(self.steps, DEAD_STEPS), part, first=first)
        if part.best is None or part.best_cost > EXPLAINED * tracker.best_cost:
            return few
        tracker.best, tracker.best_cost = part.best, part.best_cost
        return settled

    def _slack(self, few: Search, tracker: Tracker) -> Structure:
        """Return the structure of muscles that go slack if that helps, and show it to the tracker."""
        assert tracker.best is not None
        slack = Search(few.data, replace(few.structure, slack=True), self.ridge)
        slack.span = few.span
        part = tracker.part(0.5, 0.6)
        start = slack.slackened(tracker.best, FIRM)
        slack.descend(start, min(self.steps, DEAD_STEPS), part, first=True)
        if part.best is None or not part.best_cost < (1.0 - HELPS) * few.cost(tracker.best):
            return few.structure
        tracker.best = part.best
        return slack.structure

    def _dead_zone(self, few: Search, tracker: Tracker, first: bool) -> tuple[float, Array]:
        """Return over which pressure a dead zone fades that helps most, 0 if none does, and where.

        Begins at what the tracker has found without one.
        """
        assert tracker.best is not None
        dead, best = 0.0, tracker.best
        cost = few.cost(best)
        least = (1.0 - HELPS) * cost
        for pressure in np.array(DEAD_ZONES) * few.structure.highest:
            part = tracker.part(0.6, 0.65)
            here = Search(acting(few.data, float(pressure)), few.structure, self.ridge)
            here.span = few.span
            here.descend(best, min(self.steps, DEAD_STEPS), part, first=first)
            if part.best is None or not part.best_cost < cost:
                break
            cost = part.best_cost
            if cost < least:
                dead, best = float(pressure), part.best
        return dead, best

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return condition and covariance of what is free, from the exact slopes of the free run."""
        if len(data.inputs) > len(data.outputs):
            return np.nan, unknown(block)  # directions are not among what is free
        balance, contacts, _ = parts_of(block)
        told, _ = telling(data)
        shortened = turned(told, directions(told))
        structure = replace(self.structure(shortened, Tracker()), settled=balance.settled)
        dead = 0.0 if contacts is None else float(contacts.pack()[0])
        search = Search(acting(shortened, dead), structure, self.ridge)
        condition, found = search.covariance(structure.values(balance))
        packed = structure.packed()
        covariance = unknown(block)
        # dead zones come before; a sensor's gain and offset follow, which are not fitted
        own = slice(0 if contacts is None else contacts.n_parameters, None)
        own = slice(own.start, own.start + len(packed))
        covariance[own, own] = found[np.ix_(packed, packed)]
        covariance[list(at_bounds)] = covariance[:, list(at_bounds)] = np.nan
        return condition, covariance

    def structure(self, data: TrainingData, tracker: Tracker) -> Structure:
        """Return sizes and settings that suit the recordings.

        Raises
        ------
        ModelError
            If nothing ever moves.
        """
        y = data.stacked("outputs")
        span = data.travel
        if not (span > 0).all():
            raise ModelError(
                f"{data.outputs[int(np.argmin(span))].name} never changes. Remedy: record muscles that "
                "move"
            )
        loaded = [channel.unit in LOADS for channel in data.scheduled]
        scheduled = [i for i, load in enumerate(loaded) if not load]
        x = data.stacked("scheduled")[:, scheduled]
        levels = [np.unique(np.round(v / (0.1 * max(float(np.ptp(v)), 1e-9)))).size for v in x.T]
        degree = max(min([self.degree, *(n - 1 for n in levels)]), 1)
        highest = float(data.highest.max())
        margin = 0.02 * span
        tare = self.tare
        if tare is None:
            first = np.array([run.outputs[0] for run in data.runs])
            tare = bool(scheduled) and bool((np.abs(first) <= AT_START * span).all())
        if tare:
            margin = 0.15 * span
        still = one_speed(data)
        if still and self.n_lags and self.lags is None:
            tracker.notes.append(
                "all moves at about one speed, so that relaxation cannot be told from friction, and is "
                "left out. Remedy: record at other speeds too, or give lags"
            )
        return Structure(
            driven=data.outputs,
            scheduled=tuple(data.scheduled[i] for i in scheduled),
            loaded=tuple(c for c, load in zip(data.scheduled, loaded, strict=True) if load),
            given=data.inputs,
            degree=degree,
            n_elastic=self.elasticity - 1,
            n_area=self.area + 1,
            limits=np.geomspace(self.finest, 0.5, self.n_stops) * float(span.max()) / highest,
            lags=self._lags(data) if self.lags or not still else np.zeros(0),
            lag_range=(2.0 * (data.sample_time or 1.0), max(0.5 * self._longest(data), 1.0)),
            hull=np.column_stack([y.min(axis=0) - margin, y.max(axis=0) + margin]),
            scheduled_hull=np.column_stack([x.min(axis=0), x.max(axis=0)]),
            highest=highest,
            tare=tare,
            slack=False,
            mass=self.mass,
        )

    def _lags(self, data: TrainingData) -> Array:
        """Return time constants [s] that the recordings can tell."""
        longest = self._longest(data)
        shortest, most = 2.0 * (data.sample_time or 1.0), max(0.5 * longest, 1.0)
        last = min(max(longest / 3.0, 1.0), max(60.0, 8.0 * shortest), most)
        first = max(min(0.5, last / 4.0), shortest)
        default = np.geomspace(first, last, self.n_lags) if self.n_lags else ()
        lags = np.array(default if self.lags is None else self.lags)
        if lags.size and (
            lags[0] < shortest or lags[-1] > most or (np.diff(np.log(lags)) < APART).any()
        ):
            raise ModelError(
                f"lags of {np.array2string(lags, precision=3)} s are not what recordings of "
                f"{longest:.3g} s tell. Remedy: give fewer lags, in order, each twice the last or more, "
                f"from {shortest:.3g} to {most:.3g} s"
            )
        return lags

    def _longest(self, data: TrainingData) -> float:
        """Return the duration of the longest run [s]."""
        return max(len(run.outputs) * (run.sample_time or 0.0) for run in data.runs)


def directions(data: TrainingData) -> list[tuple[float, float]]:
    """Return gain and offset of every measured output over a shortening from about zero."""
    y = data.stacked("outputs")
    free = moving(data)
    falls = len(data.outputs) == 1 and bool(free.runs) and free.falls
    gain = -1.0 if falls else 1.0
    found = []
    for column in (gain * y).T:
        away = column.min() > FAR * np.ptp(column) or column.max() < 0.0
        found.append((gain, gain * float(column.min()) if away else 0.0))
    return found


def acted(pressure: Array, dead: float) -> Array:
    """Return what acts of pressures, of any shape, with a dead zone that fades over one."""
    if not dead:
        return pressure
    return Contact(dead).simulate(pressure.ravel()).reshape(pressure.shape)


def acting(data: TrainingData, dead: float) -> TrainingData:
    """Return data driven by what acts of the pressures."""
    runs = [replace(run, driven=acted(run.driven, dead)) for run in data.runs]
    return replace(data, runs=tuple(runs)) if dead else data


def _side_by_side(parts: Sequence[Block]) -> list[Block]:
    """Return one block a channel as a part of a series, or none."""
    if len(parts) < 2:
        return list(parts)
    return [PerChannel(tuple(parts))]


def turned(data: TrainingData, ways: list[tuple[float, float]]) -> TrainingData:
    """Return data whose outputs are shortenings from about zero."""
    gains, offsets = np.array(ways).T
    runs = [replace(run, outputs=(run.outputs - offsets) / gains) for run in data.runs]
    return replace(data, runs=tuple(runs))
