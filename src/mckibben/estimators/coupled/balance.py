"""Identification of a balance of forces.

First the forces that the muscles lack where they were measured, linear in almost all coefficients, by
least squares weighted by stiffness; then the displacements of the free run, by Gauss-Newton steps with
exact derivatives. Both keep to what physics asks (`mckibben.estimators.coupled.balance_structure`).
Muscles may be more than the coordinates (`mckibben.estimators.coupled.balance_coordinates`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Gt, Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.coupled.load_estimate import parts_of
from mckibben.blocks.fields import rows
from mckibben.blocks.memoryless import LOST, Affine, Contact
from mckibben.errors import ModelError
from mckibben.estimators.core.data import Mask, TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.core.uncertainty import unknown
from mckibben.estimators.coupled.balance_checks import (
    check_directions,
    moving,
    not_at_rest,
    one_speed,
    other_zeros,
    telling,
    turned,
)
from mckibben.estimators.coupled.balance_coordinates import (
    directions_of,
    in_words,
    shortened,
    together,
)
from mckibben.estimators.coupled.balance_loads import (
    held_told,
    loads_told,
    varying,
    with_loads,
    without_held,
    without_load,
)
from mckibben.estimators.coupled.balance_prior import Told, believed, refined, told_by
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_stages import Stages, acted, acting
from mckibben.estimators.coupled.balance_starts import simulate_started
from mckibben.estimators.coupled.balance_structure import APART, Structure
from mckibben.estimators.coupled.balance_words import held_back, missed, sentences
from mckibben.estimators.coupled.base import LOADS, CoupledEstimator, of_channels, schedules
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.recording import Recording, listed

LIMITED = ("bar", "V")
"""Units of what the hardware limits."""

FAR = 0.5
"""Displacements that all are further from zero than this share of their range count from elsewhere."""

FIRST_SAMPLES, MORE_SAMPLES, MOST_SAMPLES = 8_000, 15_000, 60_000
"""By which starts, slack and dead zones are compared; to find the way by; and for the last steps."""

LAST_STEPS = 10
"""On all recordings, after those on a few of them."""

AT_START = 0.02
"""Displacement at the start of a run that is none, relative to the range."""


PRESSURES = ("bar", "V", "")
"""Units of what drives a muscle; where none is said, whoever names it is believed."""


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
    unknown_load : bool, optional
        Whether every recording but the first hung under a constant load of its own, which is found.
        Default: recordings without the force that others have did; of a muscle alone, where none has
        any, if this makes the model much better.
    contact : bool
        Whether a dead zone of small pressures is looked for; default so.
    slack : bool, optional
        Whether it is looked for forces at which muscles go slack; default of several muscles, and of
        recordings in which a muscle is held.
    mass : bool
        Whether what hangs at the muscles is so heavy that its acceleration matters; then they are not
        found to go slack.
    ridge : float
        Damping of the coefficients.
    steps : int
        Most Gauss-Newton steps.
    prior : str, Path, Sheet or Prior, optional
        What is likely before, weighed against the recordings by their noise: a muscle of the library, or
        a data sheet or its file (`mckibben.muscles.prior_of`). Of one muscle.

    Attributes
    ----------
    loads_ : array, shape (recordings, n)
        Constant loads that were found, of every muscle in every recording: beyond that of the first or,
        where others have a force, beyond their average. In N or, without a measured force, in bar on
        muscle 1's area at rest.
    """

    title = "Balance of forces"
    can = (
        "Springs, areas, friction and relaxation of one muscle or several in parallel, under "
        "load, stiffness and rate included; holds off the patterns of its training."
    )
    cannot = (
        "Friction is the same in contraction and extension; one set of lags serves all "
        "muscles; air's delay between command and pressure is not in it: put air in front."
    )
    inverse_kind = "exact"
    quick = True
    default_for = "plan of displacement"
    param_grid: ClassVar[Grid] = {
        "n_lags": (1, 2, 3),
        "n_stops": (4, 6, 8),
        "area": (2, 3),
    }
    makes = ("balance", "balance-inverse", "contact balance-inverse")
    effort: ClassVar[float] = 1.0
    alone: ClassVar[bool] = True
    unmeasured: ClassVar[bool] = True
    fewer_outputs: ClassVar[bool] = True
    through: ClassVar[bool] = True

    n_stops: Annotated[int, Interval(ge=0, le=30)] = 6
    finest: Annotated[float, Interval(gt=0, lt=0.5)] = 0.003
    lags: tuple[Annotated[float, Gt(0)], ...] | None = None
    n_lags: Annotated[int, Interval(ge=0, le=10)] = 2
    elasticity: Annotated[int, Interval(ge=1, le=9)] = 9
    area: Annotated[int, Interval(ge=0, le=6)] = 2
    degree: Annotated[int, Interval(ge=1, le=4)] = 2
    tare: bool | None = None
    unknown_load: bool | None = None
    contact: bool = True
    slack: bool | None = None
    mass: bool = False
    ridge: Annotated[float, Interval(ge=0, le=1)] = 1e-6
    steps: Annotated[int, Interval(ge=0, le=1000)] = 25
    prior: Told = None

    @classmethod
    def objection(
        cls,
        recordings: Sequence[Recording],
        inputs: Sequence[str],
        outputs: Sequence[str],
        scheduling: Sequence[str] | None = None,
    ) -> str | None:
        known = super().objection(recordings, inputs, outputs, scheduling)
        for name in inputs if known is None else ():
            unit = next((one.units[name] for one in recordings if name in one), "")
            if unit not in PRESSURES:
                return (
                    f"{name} is in {unit}, which is no pressure of a muscle, nor a valve's voltage"
                )
        return known

    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        """Return what is learned from recordings, of which some may lack a load that others have."""
        every = listed(recordings)
        if self.unknown_load is False:
            return super().data(every, rows)
        scheduling = schedules(every) if self.scheduling is None else self.scheduling
        filled, lacking = with_loads(every, scheduling)
        data = super().data(filled, rows)
        runs = [replace(run, unmeasured=lacking[run.recording]) for run in data.runs]
        return replace(data, runs=tuple(runs))

    @property
    def spans(self) -> tuple[float, ...] | None:
        """The stroke of the data sheet, if there is one."""
        return None if self.prior is None else (told_by(self.prior).sheet.stroke,)

    def find(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data without what tells nothing."""
        data, notes = without_held(data)
        tracker.notes += notes
        return super().find(data, tracker)

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the balance, solved for displacements."""
        data, notes = telling(data)
        tracker.notes += notes
        recorded, behind = data, None
        if len(data.inputs) > len(data.outputs):
            along = directions_of(data)
            tracker.notes.append(in_words(data, along))
            coordinates, data = data.outputs, shortened(data, along)
            behind = together(data, along, coordinates)
        check_directions(data)
        ways = directions(data)
        data = turned(data, ways)
        structure, belief = self.structure(data, tracker), None
        if self.prior is not None:
            structure, belief = believed(structure, self.prior)
        few = Search(data, structure, self.ridge, belief).of_few(FIRST_SAMPLES)
        pushed = len(data.inputs) > 1 or any(few.still)  # by other muscles, or what holds it
        slack = pushed if self.slack is None else self.slack
        none = np.zeros((1 + data.runs[-1].recording, len(data.inputs)))
        same = not other_zeros(recorded, none)
        stages = Stages(few, tracker, self.steps, slack and not self.mass, same_zeros=same)
        search = None
        with tracker.searching():
            alone = len(data.inputs) == 1  # of several, what drifts would be taken for loads
            loads = self.unknown_load is None and alone
            stages.run(data, loads=loads, contact=self.contact)
            search = stages.few.having(acting(data, stages.dead)).of_few(MOST_SAMPLES)
            few = search.of_few(MORE_SAMPLES)
            assert tracker.best is not None
            tracker.best_cost = few.cost(tracker.best)
            few.descend(tracker.best, self.steps, tracker)
            tracker.reached(0.7)
            if few.belief is not None:
                few = refined(few, tracker, self.steps)
                search.belief = few.belief
            if len(few.runs) < len(search.runs) or few.n_rows < search.n_rows:
                tracker.best_cost = search.cost(tracker.best)
                search.descend(tracker.best, min(self.steps, LAST_STEPS), tracker)
        if tracker.best is None or not np.isfinite(tracker.best_cost):
            raise ModelError(
                "no balance of forces runs free over these recordings. Remedy: check that displacements "
                "count as shortening and loads as pulling the muscle longer"
            )
        search, structure, dead = search or stages.few, stages.few.structure, stages.dead
        limited = data.inputs[0].unit in LIMITED
        ends = np.array([min(float(data.lowest.min()), 0.0), float(data.highest.max())])
        low, high = acted(ends, dead).tolist()
        balance = structure.block(tracker.best, (low, high) if limited else None)
        x = of_channels(data, balance.scheduling).stacked("scheduled")
        balance = replace(balance, known=rows(np.column_stack([x.min(axis=0), x.max(axis=0)])))
        self._found = structure, tracker.best
        self.loads_ = structure.own.table_of_loads(tracker.best, 1 + data.runs[-1].recording)
        tracker.notes += not_at_rest(data, settled=structure.settled, found=structure.n_starts > 0)
        tracker.notes += other_zeros(recorded, self.loads_)
        tracker.notes += loads_told(data, self.loads_, balance, newtons=structure.in_newtons)
        tracker.notes += [*varying(search, tracker.best), *held_told(search, tracker.best)]
        tracker.notes += [*missed(tracker.best_cost), *held_back(balance, structure)]
        tracker.notes += sentences(balance, structure)
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

    def free_runs(self, blocks: Sequence[Block], data: TrainingData) -> Array:
        """Return the free-running outputs of blocks, each run under its own load from its own start."""
        structure, values = self._found
        if structure.size == structure.own.first:
            return super().free_runs(blocks, data)
        return np.array([simulate_started(block, data, structure, values) for block in blocks])

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return condition and covariance of what is free, from the exact slopes of the free run."""
        if len(data.inputs) > len(data.outputs):
            return np.nan, unknown(block)  # directions are not among what is free
        balance, contacts, _ = parts_of(block)
        dead = 0.0 if contacts is None else float(contacts.pack()[0])
        structure, values = self._found
        search = Search(acting(turned(data, directions(data)), dead), structure, self.ridge)
        condition, found = search.covariance(
            structure.values(balance, values[structure.own.first :])
        )
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
            If there never is pressure.
        """
        y = data.stacked("outputs")
        span = data.travel
        if not data.highest.max() > 0:
            raise ModelError(
                f"{data.inputs[0].name} never exceeds 0. Remedy: give pressures above the atmosphere's"
            )
        loaded = [channel.unit in LOADS for channel in data.scheduled]
        scheduled = [i for i, load in enumerate(loaded) if not load]
        x = data.stacked("scheduled")[:, scheduled]
        levels = [np.unique(np.round(v / (0.1 * (float(np.ptp(v)) or 1.0)))).size for v in x.T]
        degree = max(min([self.degree, *(n - 1 for n in levels)]), 1)
        highest = float(data.highest.max())
        margin = 0.02 * span
        tare = self.tare
        if tare is None:
            first = np.array([run.outputs[0] for run in data.runs])
            tare = bool(scheduled) and bool((np.abs(first) <= AT_START * span).all())
        if tare:
            margin = 0.15 * span
        still = self.prior is None and one_speed(data)
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
            heaviest=float(np.abs(data.stacked("scheduled")[:, loaded]).max(initial=0.0)) or 1.0,
            tare=tare,
            slack=False,
            mass=self.mass,
            unmeasured=() if tare else without_load(data, every=bool(self.unknown_load)),
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
    for column, span in zip((gain * y).T, data.travel.tolist(), strict=True):
        far = FAR * (np.ptp(column) if data.spans is None else span)
        away = column.min() > far or column.max() < 0.0
        found.append((gain, gain * float(column.min()) if away else 0.0))
    return found


def _side_by_side(parts: Sequence[Block]) -> list[Block]:
    """Return one block a channel as a part of a series, or none."""
    if len(parts) < 2:
        return list(parts)
    return [PerChannel(tuple(parts))]
