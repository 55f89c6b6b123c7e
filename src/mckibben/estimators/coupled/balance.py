"""Identification of a force balance.

Forces are made to balance where the muscles were measured, by least squares within what physics asks;
from there the free run is followed by Gauss-Newton steps (`mckibben.estimators.coupled.balance_search`).
In between are chosen the terms that data demand (`mckibben.estimators.coupled.balance_choice`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import compress, product
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Gt, Interval, MinLen

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.coupled.balance import Balance, balance_in
from mckibben.blocks.coupled.balance_terms import TABLE, Kind
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.fields import rows, vector
from mckibben.blocks.free_runs import FreeRuns
from mckibben.blocks.runs import Run
from mckibben.channels import Channels, Names, by_name
from mckibben.errors import ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.coupled.balance_bench import (
    check_numbers,
    in_one_order,
    of_coordinates,
    one_speed,
    recorded_drive,
    scheduled_by,
    set_up,
    unmeasured_in,
    varying,
    with_loads,
    without_held,
)
from mckibben.estimators.coupled.balance_choice import choose, is_demanded, prune
from mckibben.estimators.coupled.balance_errors import covariance_of_balance
from mckibben.estimators.coupled.balance_prior import (
    PriorErrors,
    PriorLike,
    as_prior,
    check_single_muscle,
    with_prior,
)
from mckibben.estimators.coupled.balance_problem import front, problem_of
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_structure import Bench, Structure, Term
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.muscles.scaling import resized
from mckibben.muscles.sheet import Sheet
from mckibben.muscles.traits import TRAVELS
from mckibben.numerics.tracker import Tracker
from mckibben.recording import Recording, listed

PRESSURES = ("bar", "V", "")
"""Units of driving channels; a channel without unit is accepted if the user names it."""

LIMITED = ("bar", "V")
"""Units of channels with hardware limits."""

SELECTION_ERRORS, FINAL_ERRORS, MOST_SAMPLES = 4_000, 12_000, 60_000
"""Number of errors used to select terms, and for the final fit; number of samples simulated there.
"""

GROWTHS = {"pressure": (0.95, 0.77, 0.5, 0.2), "constant": (0.0,)}
"""Initial shares of friction that grow with pressure."""

FILLED = 2.0
"""Time constant of filling to begin with, in samples."""

STRETCHES = (0.0, 1.0)
"""Initial stretch of the wall, relative to the largest, of models of force."""

STEPS_BETWEEN, LAST_STEPS = 12, 8
"""Steps before and between choices, and final steps on all samples."""

LIKE_FRICTION = tuple(kind.name for kind in TABLE.values() if kind.like_friction)
"""Kinds of terms that may take the place of friction."""

DRY_DISTANCE, SHORTEST_YIELD, LONGEST_YIELD = 0.0003, 0.003, 0.5
"""Break-away distances of stops, by the stroke: of dry friction, and the shortest and longest of
those that yield before they slide.
"""

FIRST_GROWTH, TOWARDS, REFINED = 0.9, 60, 3
"""First share of friction that grows with pressure, of the prior; maximum number of steps from there;
number of reweightings of the prior.
"""

FIXED = ("gain", "offset", "hysteresis", "dead_time")
"""Parameters of the front and of sensors that are not found."""

TERMS = (*dict.fromkeys(kind.option for kind in TABLE.values() if kind.option), "muscles")
"""Kinds of candidate terms."""


class BalanceEstimator(CoupledEstimator):
    """Force balance of muscles in parallel, with friction, relaxation, loads and scheduling inputs.

    Parameters
    ----------
    terms : sequence of str, optional
        Kinds of terms that may be added to springs, area, friction, relaxation and damping: more
        degrees of ``elasticity`` and ``areas``, more lags (``relaxation``), the ``line``, ``mass``, an
        ``obstacle`` either way, springs by squares of what schedules (``springs``), friction that grows
        with scheduling inputs (``friction_slopes``) or differs by direction (``asymmetry``), stretch of
        the wall (``walls``), air's lag in front (``filling``, ``venting``), a ``dead`` zone, or one that
        fades (``contact``), ``muscles`` that differ, and that go ``slack``. Those that act smoothly are
        free from the start, and left out where they lessen the squared errors by less than 0.05 %; an
        obstacle, dead zone, mass, slackening and asymmetry are there only if they take away a fifth of
        them, beyond their noise (`mckibben.estimators.coupled.balance_choice`). Default all.
    friction : {"pressure", "constant"}
        Whether the forces at which stops break away grow with pressure.
    n_stops : int
        Stops, which break away after travels from 0.3 to 50 % of the stroke at the highest pressure,
        beside one for dry friction, at 0.03 %.
    n_lags : int
        Time constants that may be, each within its part of what the recordings can tell; 0 for muscles
        without time.
    lags : sequence of float, optional
        Time constants to begin with instead [s]: in order, each twice the last or more.
    elasticity, area : int
        Highest degrees.
    degree : int
        Highest power of what schedules the springs.
    tare : bool, optional
        Whether displacements count from rest at the start of every recording. Default: where all of
        several scheduled muscles' recordings start there.
    unknown_load : bool, optional
        Whether every recording but the first hung under a constant load of its own, which is found.
        Default: recordings without the force that others have did; of a muscle alone, where none has
        any, if this makes the model much better.
    of_force : bool
        Whether errors of the one load are made least, not those of displacements: so they are where
        nothing moves in any recording.
    drive : {"recorded", "any"}
        Pressures that the compensator combines, of muscles that are more than coordinates: along the
        directions in which they were recorded, so that a differential drive stays on its line, or any
        in their range.
    steps : int
        Most Gauss-Newton steps of a descent; the trials of phenomena take their own.
    prior : str, Path, Sheet or Prior, optional
        What is likely before, weighed against the recordings by their noise: a muscle of the library, or
        a data sheet or its file (`mckibben.muscles.prior_of`). Of one muscle.

    Attributes
    ----------
    loads_ : array, shape (recordings, m)
        Constant loads that were found, on every coordinate in every recording: beyond that of the first
        or, where others have a force, beyond their average. In the unit of the model's forces.
    terms_ : tuple of str
        What there is of `terms`.
    """

    title = "Balance of forces"
    can = (
        "Springs, areas, friction and relaxation of one muscle or several, on separate coordinates "
        "or a joint, under loads and torques, with what else the data demand."
    )
    cannot = "All muscles share one set of lags; areas and springs depend on shortening only."
    inverse_kind = "exact"
    quick = True
    targets: ClassVar[dict[str, dict[str, Any]]] = {
        "mjcf": {
            "of_force": True,
            "friction": "constant",
            "elasticity": 3,
            "area": 1,
            "n_lags": 0,
            "terms": ("elasticity", "areas", "obstacle"),
        }
    }
    param_grid: ClassVar[Grid] = {"n_lags": (3, 6), "n_stops": (5, 8), "area": (2, 4)}
    makes = (
        "balance",
        "balance-inverse",
        "air balance-inverse",
        "piecewise-linear balance-inverse",
    )
    effort: ClassVar[float] = 6.0
    errors_known: ClassVar[bool] = True
    alone: ClassVar[bool] = True
    unmeasured: ClassVar[bool] = True
    fewer_outputs: ClassVar[bool] = True
    through: ClassVar[bool] = True

    terms: tuple[str, ...] | None = None
    friction: Literal["pressure", "constant"] = "pressure"
    n_stops: Annotated[int, Interval(ge=0, le=30)] = 8
    n_lags: Annotated[int, Interval(ge=0, le=10)] = 6
    lags: Annotated[tuple[Annotated[float, Gt(0)], ...], MinLen(1)] | None = None
    elasticity: Annotated[int, Interval(ge=1, le=9)] = 9
    area: Annotated[int, Interval(ge=0, le=6)] = 4
    degree: Annotated[int, Interval(ge=1, le=2)] = 2
    tare: bool | None = None
    unknown_load: bool | None = None
    of_force: bool = False
    drive: Literal["recorded", "any"] = "recorded"
    steps: Annotated[int, Interval(ge=0, le=1000)] = 25
    prior: PriorLike = None

    @classmethod
    def resolved(
        cls,
        recordings: Sequence[Recording],
        inputs: Names = None,
        outputs: Names = None,
        scheduling: Names = None,
    ) -> Channels:
        """Return the channels to fit: of motion, also where that is held and a force varies."""
        outputs_found = by_name(recordings)[1] if outputs is None else outputs
        return super().resolved(recordings, inputs, outputs_found or None, scheduling)

    @classmethod
    def objection(cls, recordings: Sequence[Recording], channels: Channels) -> str | None:
        inherited = super().objection(recordings, channels)
        for name in channels.inputs if inherited is None else ():
            unit = next((run.units[name] for run in recordings if name in run), "")
            if unit not in PRESSURES:
                return (
                    f"{name} is in {unit}, which is no pressure of a muscle, nor a valve's voltage"
                )
        return inherited

    def completed(
        self, recordings: Sequence[Recording], rows: Sequence[Mask] | None, names: Sequence[str]
    ) -> list[Recording]:
        """Return recordings with the loads that others have, unless all are to have one."""
        runs = listed(recordings)
        return runs if self.unknown_load is False else with_loads(runs, names, rows)

    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        """Return the training data; recordings may lack a load that others have."""
        runs = listed(recordings)
        names = self.taken(self.resolved(runs, self.input, self.output, self.scheduling))
        data = super().data(self.completed(runs, rows, names), rows)

        def unmeasured(run: Run) -> tuple[str, ...]:
            return tuple(name for name in names if name not in runs[run.index])

        return data.changed(lambda run: replace(run, unmeasured=unmeasured(run)))

    @property
    def spans(self) -> tuple[float, ...] | None:
        """The stroke of the data sheet, if there is one."""
        return None if self.prior is None else (as_prior(self.prior).sheet.stroke,)

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the balance, solved for coordinates, after the air and dead zone."""
        if unknown := {*(self.terms or ())} - {*TERMS}:
            raise ModelError(
                f"there are none named {', '.join(sorted(unknown))}",
                parameter="terms",
                remedy=f"choose from {', '.join(TERMS)}",
            )
        if self.tare and self.unknown_load:
            raise ModelError(
                "displacements from rest under the load do not show a constant load",
                parameter="unknown_load",
                remedy="give one of tare and unknown_load",
            )
        data, held_runs = without_held(data)
        data, constant = varying(in_one_order(data))
        tracker.notes += [
            f"in {name} nothing moves and no force was measured: it is left out: record the force"
            for name in held_runs
        ]
        tracker.notes += [
            f"{name} is about the same in all recordings, and is left out: record at other "
            "values too"
            for name in constant
        ]
        check_numbers(data)
        if self.prior is not None:
            check_single_muscle(data)
        data, bench = set_up(
            data, of_force=self.of_force, tare=self.tare, unknown_load=self.unknown_load
        )
        prior_errors = None
        if self.prior is not None:
            bench, prior_errors = with_prior(bench, self.prior)
        timed = self.lags is not None or self.prior is not None or not one_speed(data)
        if not timed and self.n_lags:
            tracker.notes.append(
                "all motion is at about one speed: relaxation and friction cannot be distinguished, and "
                "relaxation is left out: record at other speeds too, or give lags"
            )
        search = self._found(data, self.widest(bench, timed=timed), prior_errors, tracker)
        return self._model(search, data, tracker)

    def find_again(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the block with the same terms, from where they were."""
        bench = self._search.structure.bench
        data = scheduled_by(in_one_order(without_held(data)[0]), [*bench.scheduled, *bench.loaded])
        return self._model(self._search, of_coordinates(data, bench.sensors), tracker)

    def _fit(self, *arguments: Any) -> TrainingData:
        data = super()._fit(*arguments)
        del self._search  # needed for `find_again` only
        return data

    def _model(self, search: Search, data: TrainingData, tracker: Tracker) -> Block:
        """Return the model after a last descent on all samples."""
        of_force = search.structure.bench.of_force
        problem = problem_of(data, MOST_SAMPLES, FINAL_ERRORS, of_force=of_force)
        search = replace(search, problem=problem)
        for _ in range(1 if search.prior is None else REFINED):
            search = search.weighed()
            search = search.descend(min(self.steps, LAST_STEPS), tracker.part(0.7, 0.9))
        self._search, structure = search, search.structure
        balance = in_newtons(structure.block(search.values, final=True))
        self.loads_ = np.zeros((data.n_recordings, structure.m))
        loads = search.z[len(structure.terms) :].reshape(-1, structure.m)
        self.loads_[list(structure.bench.unmeasured)] = loads * balance.areas[0][0]
        fronts = [front(structure, search.values, channel) for channel in data.inputs]
        balance, before = self._limited(balance, fronts, data)
        sensors, behind = structure.bench.sensors, list[Block]()
        if any(sensor.offset or sensor.gain != 1.0 for sensor in sensors):
            behind.append(sensors[0] if len(sensors) == 1 else PerChannel(sensors))
        parts = [*before, balance.inverse(), *behind]
        return parts[0] if len(parts) == 1 else Series(tuple(parts))

    def _limited(
        self, balance: Balance, fronts: list[list[Block]], data: TrainingData
    ) -> tuple[Balance, list[Block]]:
        """Return a balance within the recorded ranges, and the blocks before it."""
        static = [block for block in fronts[0] if not block.rate_dependent]

        def acting_in_muscles(pressures_: Array) -> Array:
            for block in static:
                pressures_ = block.simulate(pressures_)
            return pressures_

        given_range = None
        if data.inputs[0].unit in LIMITED:
            given_range = float(data.lowest.min()), float(data.highest.max())
            low, high = acting_in_muscles(np.array(given_range)).tolist()
            balance = replace(balance, pressure_range=(low, high))
        n, m = balance.moves.shape
        if n > m and self.drive == "recorded":
            pressures = [acting_in_muscles(pressures_) for pressures_ in data.stacked("driven").T]
            drive = recorded_drive(np.column_stack(pressures))
            if m < drive.shape[1] <= n:  # not any, and enough to balance along
                balance = replace(balance, drive=rows(drive))
        names = [channel.name for channel in data.scheduled]
        x = data.stacked("scheduled")[:, [names.index(name) for name in balance.scheduling]]
        balance = replace(balance, known=rows(np.column_stack([x.min(axis=0), x.max(axis=0)])))
        stages = (
            tuple(
                replace(block, input_range=given_range) if isinstance(block, Air) else block
                for block in stage
            )
            for stage in zip(*fronts, strict=True)
        )
        return balance, [stage[0] if len(stage) == 1 else PerChannel(stage) for stage in stages]

    def widest(self, bench: Bench, *, timed: bool) -> Structure:
        """Return the structure with all candidate terms."""
        longest = LONGEST_YIELD if self.prior is None else TRAVELS[-1]
        yielding = np.geomspace(SHORTEST_YIELD, longest, self.n_stops)
        travels = bench.stroke * (np.append(DRY_DISTANCE, yielding) if self.n_stops else yielding)
        shortest, longest = bench.lag_range
        lags = np.geomspace(shortest, longest, self.n_lags + 1)[1:] if bench.step and timed else ()
        if self.lags is not None:
            lags = np.array(self.lags)
            if lags[0] < shortest or lags[-1] > longest or (np.diff(np.log(lags)) < 0.69).any():
                raise ModelError(
                    f"those of {np.array2string(lags, precision=3)} s cannot be identified "
                    "from these recordings",
                    parameter="lags",
                    remedy="give fewer lags, in order, each twice the last or more, from "
                    f"{shortest:.3g} to {longest:.3g} s",
                )
        places = TABLE["places"].begins
        sides = [(1, edge) for edge in places] + [(-1, 1.0 - edge) for edge in places]
        return Structure(
            bench,
            n_elastic=self.elasticity - 1,
            n_area=self.area + 1,
            limits=vector(travels),
            lags=vector(lags),
            obstacles=tuple(sides) if self.may("obstacle") else (),
            degree=self.degree if bench.curved else 1,
        )

    def may(self, kind: str) -> bool:
        """Return whether terms of a kind may be added."""
        return self.terms is None or kind in self.terms

    def _always(self, structure: Structure, term: Term) -> bool:
        """Return whether a balance has a term whatever may be added."""
        kind, number, muscle = term
        if muscle is not None:
            return False
        if kind == "springs":
            return number == 0 or (number - 1) % structure.degree == 0
        if kind in ("relaxation", "lags"):
            count = len(structure.lags)
            return count < 3 or self.lags is not None or number in (count // 3, 2 * count // 3)
        if kind in ("elasticity", "areas"):
            return number < 2
        return not TABLE[kind].option

    def _possible(self, structure: Structure, kind: Kind) -> bool:
        """Return whether what a kind of term acts on is there."""
        possible = {
            "time": structure.bench.step > 0.0,
            "stops": bool(structure.limits),
            "hold": structure.n > 1 or structure.bench.some_held,
        }
        grows = kind.name in ("friction_growth", "friction_slopes")
        return possible.get(kind.needs, True) and not (grows and self.friction == "constant")

    def _first(self, structure: Structure) -> Mask:
        """Return which terms are free from the start: all that act smoothly."""

        def there(term: Term) -> bool:
            kind = TABLE[term.kind]
            if kind.phenomenon or not self._possible(structure, kind):
                return False
            if term.muscle is not None:
                return not kind.alike and self.may("muscles")
            return self._always(structure, term) or self.may(kind.option)

        return np.array([there(term) for term in structure.terms])

    def _found(
        self,
        data: TrainingData,
        structure: Structure,
        prior_errors: PriorErrors | None,
        tracker: Tracker,
    ) -> Search:
        """Return the search with the selected terms."""
        of_force, first = structure.bench.of_force, self._first(structure)
        few = problem_of(data, SELECTION_ERRORS, SELECTION_ERRORS, of_force=of_force)
        start = np.append(structure.none, np.zeros(few.size(structure) - first.size))
        search = self._linear_start(Search(few, structure, first, start, prior_errors), tracker)
        if prior_errors is not None:
            starts = (search, self._from_prior(search, prior_errors.prior.sheet))
            search = min(
                (candidate.descend(TOWARDS) for candidate in starts),
                key=lambda candidate: candidate.cost,
            )
        steps = min(self.steps, STEPS_BETWEEN)
        may = {
            name
            for name, kind in TABLE.items()
            if self.may(kind.option) and self._possible(structure, kind)
        }
        search = self._with_friction_like(search, may, tracker.part(0.0, 0.1))
        if not search.problem.all_at_rest:
            search = self._settled_if_better(search)
        search = search.weighed().descend(steps, tracker.part(0.1, 0.2)).weighed()
        options_tried = {TABLE[name].option for name in may if TABLE[name].phenomenon}
        search = choose(search, options_tried, tracker.part(0.2, 0.4))
        if structure.n == 1 and self.unknown_load is None:
            search = self._with_own_loads(search, data)
        late = np.isin(structure.kinds, LIKE_FRICTION) & first
        search = replace(search, active=search.active | late)
        always = {
            key
            for key, term in zip(structure.keys, structure.terms, strict=True)
            if self._always(structure, term)
        }
        search = prune(search.descend(steps, tracker.part(0.4, 0.5))).narrowed()
        terms_in = [
            key for key in compress(search.structure.keys, search.active) if key not in always
        ]
        names = (
            "muscles" if muscle is not None else TABLE[kind].option for kind, _, muscle in terms_in
        )
        self.terms_ = tuple(dict.fromkeys(names))
        return search.descend(self.steps, tracker.part(0.5, 0.7))

    def _with_friction_like(self, search: Search, may: set[str], tracker: Tracker) -> Search:
        """Return the search after a descent, with what resembles friction if data demand it already.

        It may take the place of friction where that is not yet known.
        """
        steps, terms = min(self.steps, STEPS_BETWEEN), search.structure.kinds
        start = replace(search, active=search.active & ~np.isin(terms, LIKE_FRICTION))
        search = start.descend(steps, tracker)
        for kind in [kind for kind in LIKE_FRICTION if kind in may]:
            more = replace(start, active=search.active | (terms == kind)).descend(steps, tracker)
            search = more if is_demanded(search, more) else search
        return search

    def _settled_if_better(self, search: Search) -> Search:
        """Return the search with settled starts, if that explains the runs better."""
        settled = replace(search, structure=replace(search.structure, settled=True))
        searches = (candidate.descend(STEPS_BETWEEN) for candidate in (search, settled))
        return min(searches, key=lambda candidate: candidate.cost)

    def _linear_start(self, search: Search, tracker: Tracker) -> Search:
        """Return the best linear force balance at measured positions, over several starts.

        Where a muscle is held, stops move by the stretch of its wall alone: without it their friction is
        no different from a constant force, and no slope leads from there to a stretch.
        """
        structure, starts = search.structure, list[Search]()
        growths = GROWTHS[self.friction if structure.limits else "constant"]
        stretches = STRETCHES if structure.bench.of_force and self.may("walls") else (0.0,)
        filling = structure.positions("filling")
        for growth, stretch in product(growths, stretches):
            z = search.none.copy()
            z[: search.active.size] = structure.initial(growth, stretch)
            z[filling] = np.where(search.active[filling], FILLED * structure.bench.step, 0.0)
            z = search.problem.balanced(structure, z, search.active)
            starts.append(replace(search, z=z))
            tracker.update(z, starts[-1].cost)
        return min(starts, key=lambda candidate: candidate.cost)

    def _from_prior(self, search: Search, sheet: Sheet) -> Search:
        """Return the search from the most probable model of its prior."""
        structure, z = search.structure, search.none.copy()
        growing = search.active[structure.positions("friction_growth")].all()
        z[: search.active.size] = structure.initial(FIRST_GROWTH if growing else 0.0)
        for k, term in enumerate(structure.terms):
            if term.kind == "loads":
                z[k] = 1.0 / sheet.area
            elif term[:2] == ("areas", 0):
                z[k] = sheet.area
        none = replace(search.problem, data=replace(search.problem.data, runs=()))
        return replace(search, z=replace(search, problem=none, z=z).descend(TOWARDS).z)

    def _with_own_loads(self, search: Search, data: TrainingData) -> Search:
        """Return the search with constant loads per recording, if data demand them."""
        bench, all_unmeasured = search.structure.bench, unmeasured_in(data, every=True)
        if bench.loaded or bench.unmeasured or bench.tare or not all_unmeasured:
            return search
        structure = replace(search.structure, bench=replace(bench, unmeasured=all_unmeasured))
        z = np.append(search.z, np.zeros(len(all_unmeasured) * structure.m))
        with_loads_ = replace(search, structure=structure, z=z).descend(STEPS_BETWEEN)
        return with_loads_ if is_demanded(search, with_loads_) else search

    def fixed(self, block: Block) -> tuple[int, ...]:
        return fixed_in(block)

    def uncertainty(self, runs: FreeRuns, at_bounds: Sequence[int]) -> tuple[float, Array]:
        """Return condition and mean squares of the parameters; those at bounds are as unsure."""
        del at_bounds
        return covariance_of_balance(runs, self.fixed(runs.block))

    def free_runs(
        self,
        block: Block,
        recordings: Sequence[Recording],
        rows: Sequence[Mask] | None = None,
    ) -> FreeRuns:
        """Return the free runs of a block, each under its own load where one was found."""
        every = self.completed(recordings, rows, block.scheduling)
        runs = super().free_runs(block, every, rows)
        return (
            replace(runs, changed=partial(under_load, self.loads_)) if self.loads_.any() else runs
        )


def fixed_in(block: Block) -> tuple[int, ...]:
    """Return the indices of parameters that are not found, or set a side or the unit of force."""
    return tuple(
        k
        for k, (part, field, index) in enumerate(block.numbers())
        if (part.is_convention(field, index) if isinstance(part, Balance) else field in FIXED)
    )


def under_load(loads: Array, model: Block, index: int) -> Block:
    """Return a model of a balance under the constant load of a recording, in its unit of forces."""
    placed = balance_in(model)
    assert placed is not None
    springs = np.array(placed.balance.springs)
    springs[:, 0] += loads[index]
    balance = replace(placed.balance, springs=rows(springs))
    parts = (*placed.before, balance.inverse(), *placed.behind)
    return Series(parts) if len(parts) > 1 else parts[0]


def in_newtons(balance: Balance) -> Balance:
    """Return a balance with forces in the load's unit, if it has one load on one coordinate."""
    share = abs(balance.loads[0][0]) if np.shape(balance.loads) == (1, 1) else 0.0
    if not share > 0.0:
        return balance
    return replace(resized(balance, area=1.0 / share), loads=rows(np.array(balance.loads) / share))
