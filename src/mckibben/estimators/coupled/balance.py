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
from mckibben.blocks.coupled.balance_terms import TABLE
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.fields import rows, vector
from mckibben.blocks.free_runs import FreeRuns
from mckibben.blocks.runs import Run
from mckibben.channels import Channels, Names, by_name
from mckibben.errors import ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.coupled.balance_bench import (
    bench_of,
    check_numbers,
    directions,
    drive_of,
    from_zero,
    in_one_order,
    one_speed,
    only_forces,
    varying,
    with_loads,
    without_held,
    without_load,
)
from mckibben.estimators.coupled.balance_choice import PHENOMENA, chosen, demanded, pruned
from mckibben.estimators.coupled.balance_prior import (
    PriorErrors,
    PriorLike,
    as_prior,
    check_single_muscle,
    with_prior,
)
from mckibben.estimators.coupled.balance_problem import coarser, compared, front, held
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_structure import Bench, Structure, Term
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.muscles.scaling import resized
from mckibben.muscles.traits import TRAVELS
from mckibben.numerics.tracker import Tracker
from mckibben.recording import Recording, listed

PRESSURES = ("bar", "V", "")
"""Units of driving channels; a channel without unit is accepted if the user names it."""

LIMITED = ("bar", "V")
"""Units of channels with hardware limits."""

FEW, MOST, MOST_SAMPLES = 4_000, 12_000, 60_000
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

RUBBING = ("asymmetry", "walls")
"""Terms that resemble friction."""

DIFFER = ("areas", "elasticity", "bladders", "friction", "relaxation", "damping")
"""Terms in which muscles may differ."""

FINEST, LONGEST = 0.003, 0.5
"""Shortest and longest break-away distances of stops, relative to the stroke."""

PLACES = (0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95)
"""Places where obstacles begin, as shares of the range; for lowering, from its end."""

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
        Stops, which break away after travels from 0.3 to 50 % of the stroke at the highest pressure.
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
        moved = by_name(recordings)[1] if outputs is None else outputs
        return super().resolved(recordings, inputs, moved or None, scheduling)

    @classmethod
    def objection(cls, recordings: Sequence[Recording], channels: Channels) -> str | None:
        known = super().objection(recordings, channels)
        for name in channels.inputs if known is None else ():
            unit = next((one.units[name] for one in recordings if name in one), "")
            if unit not in PRESSURES:
                return (
                    f"{name} is in {unit}, which is no pressure of a muscle, nor a valve's voltage"
                )
        return known

    def completed(self, recordings: list[Recording], scheduling: Sequence[str]) -> list[Recording]:
        """Return recordings with the loads that others have, unless all are to have one."""
        return recordings if self.unknown_load is False else with_loads(recordings, scheduling)

    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        """Return the training data; recordings may lack a load that others have."""
        every = listed(recordings)
        data = super().data(every, rows)
        scheduled = [channel.name for channel in data.scheduled]

        def unmeasured(run: Run) -> tuple[str, ...]:
            return tuple(name for name in scheduled if name not in every[run.index])

        runs = tuple(replace(run, unmeasured=unmeasured(run)) for run in data.runs)
        return replace(data, runs=runs)

    @property
    def spans(self) -> tuple[float, ...] | None:
        """The stroke of the data sheet, if there is one."""
        return None if self.prior is None else (as_prior(self.prior).sheet.stroke,)

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the block identified from all informative runs."""
        data, names = without_held(data)
        tracker.notes += [
            f"in {name} nothing moves and no force was measured: it is left out: record the force"
            for name in names
        ]
        return self.identify(data, tracker)

    def find_again(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the block with the same terms, from where they were."""
        return self.identify(without_held(data)[0], tracker, again=True)

    def _fit(self, *given: Any) -> None:
        super()._fit(*given)
        del self._last  # needed for `find_again` only

    def identify(self, data: TrainingData, tracker: Tracker, *, again: bool = False) -> Block:
        """Return the balance, solved for coordinates, after the air and dead zone."""
        if unknown := {*(self.terms or ())} - {*TERMS}:
            raise ModelError(
                f"terms names {', '.join(sorted(unknown))}",
                remedy=f"choose from {', '.join(TERMS)}",
            )
        data, names = varying(in_one_order(data))
        tracker.notes += [
            f"{name} is about the same in all recordings, and is left out: record at other "
            "values too"
            for name in names
        ]
        check_numbers(data)
        if self.prior is not None:
            check_single_muscle(data)
        of_force = self.of_force or only_forces(data)
        data, behind, ways = from_zero(data, np.eye(1) if of_force else directions(data))
        bench = replace(bench_of(data, ways, tare=self.tare), of_force=of_force)
        if not bench.tare:
            lacking = without_load(data, every=bool(self.unknown_load))
            bench = replace(bench, unmeasured=lacking)
        prior_errors = None
        if self.prior is not None:
            bench, prior_errors = with_prior(bench, self.prior)
        still = self.prior is None and one_speed(data)
        if still and self.n_lags and self.lags is None:
            tracker.notes.append(
                "all motion is at about one speed: relaxation and friction cannot be distinguished, and "
                "relaxation is left out: record at other speeds too, or give lags"
            )
        if again:
            search, z = self._refined(*self._last, data, tracker)
        else:
            structure = self.widest(bench, timed=not still or self.lags is not None)
            search, z = self._found(data, structure, prior_errors, tracker)
        structure = search.structure
        values = structure.expanded(z)
        balance = in_newtons(structure.block(values, final=True))
        self._keep_loads(search, z, data, balance.areas[0][0])
        fronts = [front(structure, values, channel) for channel in data.inputs]
        balance, before = self._limited(balance, fronts, data)
        parts = [*before, balance.inverse(), *behind]
        return parts[0] if len(parts) == 1 else Series(tuple(parts))

    def _keep_loads(self, search: Search, z: Array, data: TrainingData, area: float) -> None:
        """Set the constant loads of recordings, in the unit of forces that an area sets."""
        structure = search.structure
        self.loads_ = np.zeros((1 + max(run.index for run in data.runs), structure.m))
        for run in data.runs:
            place = search.problem.loads_at(structure, run)
            if place.stop > place.start:
                self.loads_[run.index] = z[place] * area

    def _limited(
        self, balance: Balance, fronts: list[list[Block]], data: TrainingData
    ) -> tuple[Balance, list[Block]]:
        """Return a balance within the recorded ranges, and the blocks before it."""
        static = [block for block in fronts[0] if not block.rate_dependent]

        def acting_in_muscles(given: Array) -> Array:
            for block in static:
                given = block.simulate(given)
            return given

        given_range = None
        if data.inputs[0].unit in LIMITED:
            given_range = float(data.lowest.min()), float(data.highest.max())
            low, high = acting_in_muscles(np.array(given_range)).tolist()
            balance = replace(balance, pressure_range=(low, high))
        n, m = balance.moves.shape
        if n > m and self.drive == "recorded":
            pressures = [acting_in_muscles(given) for given in data.stacked("driven").T]
            drive = drive_of(np.column_stack(pressures))
            if m < drive.shape[1] <= n:  # not any, and enough to balance along
                balance = replace(balance, drive=rows(drive))
        names = [channel.name for channel in data.scheduled]
        x = data.stacked("scheduled")[:, [names.index(name) for name in balance.scheduling]]
        balance = replace(balance, known=rows(np.column_stack([x.min(axis=0), x.max(axis=0)])))
        stages = (
            tuple(_within(given_range, b) for b in stage) for stage in zip(*fronts, strict=True)
        )
        return balance, [stage[0] if len(stage) == 1 else PerChannel(stage) for stage in stages]

    def widest(self, bench: Bench, *, timed: bool) -> Structure:
        """Return the structure with all candidate terms."""
        longest = LONGEST if self.prior is None else TRAVELS[-1]
        travels = np.geomspace(FINEST, longest, self.n_stops) * bench.stroke
        shortest, longest = bench.lag_range
        lags = np.geomspace(shortest, longest, self.n_lags + 1)[1:] if bench.step and timed else ()
        if self.lags is not None:
            lags = np.array(self.lags)
            if lags[0] < shortest or lags[-1] > longest or (np.diff(np.log(lags)) < 0.69).any():
                raise ModelError(
                    f"lags of {np.array2string(lags, precision=3)} s cannot be identified "
                    "from these recordings",
                    remedy="give fewer lags, in order, each twice the last or more, from "
                    f"{shortest:.3g} to {longest:.3g} s",
                )
        sides = [(1, place) for place in PLACES] + [(-1, 1.0 - place) for place in PLACES]
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
        kind, which, muscle = term
        if muscle is not None:
            return False
        if kind == "springs":
            return which == 0 or (which - 1) % structure.degree == 0
        if kind in ("relaxation", "lags"):
            count = len(structure.lags)
            return count < 3 or self.lags is not None or which in (count // 3, 2 * count // 3)
        if kind in ("elasticity", "areas"):
            return which < 2
        return not TABLE[kind].option

    def _first(self, structure: Structure) -> Mask:
        """Return which terms are free from the start: all that act smoothly."""
        lacking = {"friction_slopes"} if self.friction == "constant" else set()
        if self.friction == "constant" or not structure.limits:
            lacking |= {"friction_growth"}
        if not structure.bench.step:
            lacking |= {"filling", "venting", "lines", "damping"}

        def there(term: Term) -> bool:
            kind, option = term.kind, TABLE[term.kind].option
            if kind in lacking or kind == "places" or option in PHENOMENA:
                return False
            if term.muscle is not None:
                return kind in DIFFER and self.may("muscles")
            return self._always(structure, term) or self.may(option)

        return np.array([there(term) for term in structure.terms])

    def _found(
        self,
        data: TrainingData,
        structure: Structure,
        prior_errors: PriorErrors | None,
        tracker: Tracker,
    ) -> tuple[Search, Array]:
        """Return the search with the selected terms, and their values."""
        of_force, first = structure.bench.of_force, self._first(structure)
        few = compared(coarser(data, FEW), FEW, of_force=of_force)
        search = Search(few, structure, first, prior_errors)
        z = self._balanced(search, tracker)
        if prior_errors is not None:
            starts = (search.descend(one, TOWARDS, Tracker()) for one in (z, self._likely(search)))
            z = min(starts, key=search.cost)
        steps = min(self.steps, STEPS_BETWEEN)
        rubbing = {kind for kind in RUBBING if self.may(kind) and structure.limits}
        search, z = self._rubbing(search, z, rubbing, tracker.part(0.0, 0.1))
        if not search.problem.all_at_rest:
            search, z = self._long_held(search, z)
        search = search.weighed(z)
        z = search.descended(z, steps, tracker.part(0.1, 0.2))
        search = search.weighed(z)
        tried = {
            kind for kind in PHENOMENA if self.may(kind)
            and (kind != "slack" or structure.n > 1 or any(held(data, run) for run in data.runs))
            and (kind != "mass" or structure.bench.step)
            and (kind != "asymmetry" or structure.limits)
        }  # fmt: skip
        search, z = chosen(search, z, tried, tracker.part(0.2, 0.4))
        if structure.n == 1 and self.unknown_load is None:
            search, z = self._own_loads(search, z, data)
        walls = (structure.kinds == "walls") & first
        search = replace(search, active=search.active | walls)
        z = search.descended(z, steps, tracker.part(0.4, 0.5))
        search, z = pruned(search, z)
        there = compress(structure.terms, search.active)
        more = [term for term in there if not self._always(structure, term)]
        names = ("muscles" if term.muscle is not None else TABLE[term.kind].option for term in more)
        self.terms_ = tuple(dict.fromkeys(names))
        search, z = search.narrowed(z)
        z = search.descend(z, self.steps, tracker.part(0.5, 0.7))
        return self._refined(search, z, data, tracker)

    def _refined(
        self, search: Search, z: Array, data: TrainingData, tracker: Tracker
    ) -> tuple[Search, Array]:
        """Return the search on all samples, and its values after a descent."""
        whole = compared(
            coarser(data, MOST_SAMPLES), MOST, of_force=search.structure.bench.of_force
        )
        search = replace(search, problem=whole)
        for _ in range(1 if search.prior is None else REFINED):
            search = search.weighed(z)
            z = search.descend(z, min(self.steps, LAST_STEPS), tracker.part(0.7, 0.9))
        self._last = search, z
        return search, z

    def _rubbing(
        self, search: Search, z: Array, more: set[str], tracker: Tracker
    ) -> tuple[Search, Array]:
        """Return the search after a descent, with those of ``more`` terms that data demand already.

        Asymmetry and stretch resemble friction, and may take its place where that is not yet known.
        """
        kinds = search.structure.kinds
        steps, begun = min(self.steps, STEPS_BETWEEN), z
        search = replace(search, active=search.active & ~np.isin(kinds, RUBBING))
        z = search.descended(begun, steps, tracker)
        for kind in RUBBING:
            if kind in more:
                other = replace(search, active=search.active | (kinds == kind))
                after = other.descended(begun, steps, tracker)
                search, z = (other, after) if demanded(search, z, other, after) else (search, z)
        return search, z

    def _long_held(self, search: Search, z: Array) -> tuple[Search, Array]:
        """Return the search with settled starts, if that explains the runs better."""
        settled = replace(search, structure=replace(search.structure, settled=True))
        found = settled.descended(z, STEPS_BETWEEN, Tracker())
        return (settled, found) if settled.cost(found) < search.cost(z) else (search, z)

    def _balanced(self, search: Search, tracker: Tracker) -> Array:
        """Return the best linear force balance at measured positions, over several starts.

        Where a muscle is held, stops move by the stretch of its wall alone: without it their friction is
        no different from a constant force, and no slope leads from there to a stretch.
        """
        structure, problem, starts = search.structure, search.problem, []
        growths = GROWTHS[self.friction if structure.limits else "constant"]
        stretches = STRETCHES if structure.bench.of_force and self.may("walls") else (0.0,)
        for growth, stretch in product(growths, stretches):
            z = np.zeros(problem.size(structure))
            z[: len(structure.terms)] = structure.initial(growth, stretch)
            filling = structure.free("filling")
            z[filling] = np.where(search.active[filling], FILLED * structure.bench.step, 0.0)
            z = problem.balanced(structure, z, search.active)
            starts.append((search.cost(z), z))
            tracker.update(z, starts[-1][0])
        return min(starts, key=lambda start: start[0])[1]

    def _likely(self, search: Search) -> Array:
        """Return the most probable model of the prior."""
        structure, prior_errors, problem = search.structure, search.prior, search.problem
        assert prior_errors is not None
        z = np.zeros(problem.size(structure))
        growing = search.active[structure.free("friction_growth")].all()
        z[: len(structure.terms)] = structure.initial(FIRST_GROWTH if growing else 0.0)
        for place, term in enumerate(structure.terms):
            if term.kind == "loads":
                z[place] = 1.0 / prior_errors.prior.sheet.area
            elif term[:2] == ("areas", 0):
                z[place] = prior_errors.prior.sheet.area
        alone = replace(search, problem=replace(problem, data=replace(problem.data, runs=())))
        return alone.descend(z, TOWARDS, Tracker())

    def _own_loads(self, search: Search, z: Array, data: TrainingData) -> tuple[Search, Array]:
        """Return the search with constant loads per recording, if data demand them."""
        bench, every = search.structure.bench, without_load(data, every=True)
        if bench.loaded or bench.unmeasured or bench.tare or not every:
            return search, z
        own = replace(
            search, structure=replace(search.structure, bench=replace(bench, unmeasured=every))
        )
        started = np.append(z, np.zeros(own.problem.size(own.structure) - z.size))
        found = own.descended(started, STEPS_BETWEEN, Tracker())
        return (own, found) if demanded(search, z, own, found) else (search, z)

    def fixed(self, block: Block) -> tuple[int, ...]:
        return fixed_in(block)

    def free_runs(
        self,
        block: Block,
        recordings: Sequence[Recording],
        rows: Sequence[Mask] | None = None,
    ) -> FreeRuns:
        """Return the free runs of a block, each under its own load where one was found."""
        every = self.completed(listed(recordings), block.scheduling)
        runs = super().free_runs(block, every, rows)
        return replace(runs, changed=partial(_loaded, self.loads_)) if self.loads_.any() else runs


def _within(given_range: tuple[float, float] | None, block: Block) -> Block:
    """Return a front block whose inverse stays within a pressure range."""
    return replace(block, input_range=given_range) if isinstance(block, Air) else block


def fixed_in(block: Block) -> tuple[int, ...]:
    """Return the indices of parameters that are not found, or set a side or the unit of force."""
    return tuple(
        place
        for place, (part, field, index) in enumerate(block.numbers())
        if (part.is_convention(field, index) if isinstance(part, Balance) else field in FIXED)
    )


def _loaded(loads: Array, model: Block, place: int) -> Block:
    """Return a model under the load of a recording, by its index."""
    # a recording behind the last one that was fitted has none
    return under_load(model, loads[place]) if place < len(loads) else model


def under_load(model: Block, load: Array) -> Block:
    """Return a model of a balance under a constant load on every coordinate, in its unit of forces."""
    placed = balance_in(model)
    assert placed is not None
    springs = np.array(placed.balance.springs)
    springs[:, 0] += load
    balance = replace(placed.balance, springs=rows(springs))
    parts = (*placed.before, balance.inverse(), *placed.behind)
    return Series(parts) if len(parts) > 1 else parts[0]


def in_newtons(balance: Balance) -> Balance:
    """Return a balance with forces in the load's unit, if it has one load on one coordinate."""
    share = abs(balance.loads[0][0]) if np.shape(balance.loads) == (1, 1) else 0.0
    if not share > 0.0:
        return balance
    return replace(resized(balance, area=1.0 / share), loads=rows(np.array(balance.loads) / share))
