"""Residuals of a force balance along runs: force residuals, and free-running errors.

Unknowns are the terms of `mckibben.estimators.coupled.balance_structure`, then, for every recording
under an unmeasured load, a constant force on every coordinate.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial

import numpy as np
from numpy.polynomial import polynomial

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block, run_many
from mckibben.blocks.coupled.balance_bounds import springs_at
from mckibben.blocks.coupled.balance_law import coordinate_at
from mckibben.blocks.coupled.balance_terms import Indices
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.fields import Channel
from mckibben.blocks.memoryless import Contact, PiecewiseLinear
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.balance_slopes import run as simulate
from mckibben.estimators.coupled.balance_structure import Structure
from mckibben.numerics.descent import differences
from mckibben.numerics.least_squares import solve_constrained, solve_products

STEP = 1e-4
"""Relative step for finite differences of parameters of the air."""

RESTING = 0.1
"""Share of the pressure range up to which a run starts at rest."""

FILLS = 0.02
"""Share of a pressure that acts inside the dead zone, so that an inverse exists."""

STRAIGHT = 0.01
"""Deviation of inputs from straight lines, relative to their ranges, that is ignored."""

RIDGE = 1e-7
"""Ridge of least squares, relative to each coefficient's own effect."""

LEAST_AT_REST = 0.1
"""Smallest area at rest, relative to the mean over samples."""

PASSES = 3
"""Number of reweightings of forces."""

STICKING = 0.3
"""Share of the stiffness of stops that counts while they mostly slide."""

LEAST_SHARE = 0.1
"""Smallest stiffness by which forces are weighed, relative to the median over samples."""

MOST_CUTS = 8
"""Maximum number of added stiffness constraints."""

HELD = 0.02
"""Share of its motion in all runs below which a muscle counts as held."""


def held(data: TrainingData, run: Run) -> bool:
    """Return whether a run has no motion, so that its forces are compared."""
    return bool((np.ptp(run.outputs, axis=0) < HELD * data.travel).all())


def front(structure: Structure, values: Array, channel: Channel) -> list[Block]:
    """Return the front between measured pressure and muscle: air lag, then dead zone."""
    filling, ratio, dead, contact = (
        float(structure.nonlinear_values(values, name)[0])
        for name in ("filling", "venting", "dead", "contact")
    )
    blocks: list[Block] = []
    if filling > 0.0:
        times = filling, filling * ratio
        blocks.append(Air(1.0, 0.0, 0.0, *times, ambient=None, input=channel, output=channel))
    if dead > 0.0:
        knots, acting = (0.0, dead, 2.0 * dead), (0.0, FILLS * dead, (1.0 + FILLS) * dead)
        blocks.append(PiecewiseLinear(knots, acting, channel, channel))
    if contact > 0.0:
        blocks.append(Contact(contact, channel, channel))
    return blocks


@dataclass(frozen=True, eq=False)
class Problem:
    """Runs to fit.

    Parameters
    ----------
    data : TrainingData
        Whose last scheduling channels are the loads; outputs are coordinates.
    every : int
        One sample of so many is compared; all are run through.
    of_force : bool
        Whether forces count in all runs.
    """

    data: TrainingData
    every: int = 1
    of_force: bool = False
    _fronts: dict[tuple[object, ...], Array] = field(default_factory=dict, repr=False)

    @cached_property
    def still(self) -> frozenset[int]:
        """Places of the runs whose forces are compared, not their displacements."""
        runs = self.data.runs
        return frozenset(run.place for run in runs if self.of_force or held(self.data, run))

    def counting(self, run: Run) -> Mask:
        """Return which of the compared samples are scored."""
        return run.counts[self.places(run)]

    def places(self, run: Run) -> Indices:
        """Return the indices of the compared samples."""
        n = len(run.outputs)
        return np.minimum(np.arange(self.every - 1, n + self.every - 1, self.every), n - 1)

    def acting(self, run: Run, structure: Structure, values: Array) -> Array:
        """Return the pressures acting on muscles, shape (n, muscles)."""
        filling, ratio, dead, contact = values[structure.at["filling"][0] :].tolist()
        if not (filling or dead or contact):
            return run.driven
        key = (run.place, filling, ratio, dead, contact)
        if key not in self._fronts:
            if len(self._fronts) > 4 * len(self.data.runs):
                self._fronts.clear()
            driven = run.driven
            for block in front(structure, values, Channel("pressure", "bar")):
                columns = np.ascontiguousarray(driven.T)[..., np.newaxis]
                answers = [run_many([block], p, sample_time=run.sample_time) for p in columns]
                driven = np.column_stack([answer[0] for answer in answers])
            self._fronts[key] = driven
        return self._fronts[key]

    # -- loads of recordings ---------------------------------------------------------------------

    def loads_at(self, structure: Structure, run: Run) -> slice:
        """Return the indices of a recording's own load, after the terms."""
        first, unmeasured = len(structure.terms), structure.bench.unmeasured
        if run.index not in unmeasured:
            return slice(first, first)
        first += unmeasured.index(run.index) * structure.m
        return slice(first, first + structure.m)

    def size(self, structure: Structure) -> int:
        """Return the total number of unknowns."""
        return len(structure.terms) + len(structure.bench.unmeasured) * structure.m

    # -- following -------------------------------------------------------------------------------

    def simulated(
        self,
        structure: Structure,
        z: Array,
        held: Collection[int],
        *,
        sloped: bool = True,
        air: Sequence[int] = (),
    ) -> Iterator[tuple[Run, Array, Array]]:
        """Yield every run, its coordinates, or lacking forces if it is ``held``, and derivatives.

        These are by linear coefficients and shape as `balance_slopes` has it, the last by the terms of
        the ``air``. Runs are held by their places.
        """
        values = structure.expanded(z)
        coefficients = cache(structure.block(values).coefficients)
        for run in self.data.runs:
            c = coefficients(run.sample_time).copy()
            for j, load in enumerate(z[self.loads_at(structure, run)].tolist()):
                c[coordinate_at(c, j)] += load
            driven = self.acting(run, structure, values)
            by_air = self._by_air(structure, z, run, air) if air else None
            results, slopes = simulate(
                c, driven, run.outputs, run.scheduled, by_air,
                held=run.place in held, every=self.every, sloped=sloped,
            )  # fmt: skip
            yield run, results, slopes

    def errors(
        self, structure: Structure, z: Array, wanted: Mask | None = None
    ) -> tuple[list[Array], Array]:
        """Return the errors of every run, and derivatives by all unknowns, shape (errors, unknowns).

        Errors are relative to ranges; of a run in which nothing moves, they are the forces that are
        lacking, over that of the highest pressure at rest. Derivatives are computed only if some are
        ``wanted``. Those by parameters of the front are finite differences of the acting pressures.
        """
        errors, table, bench = list[Array](), [np.zeros((0, z.size))], structure.bench
        sloped = wanted is not None
        first, last = structure.positions("filling").start, len(structure.terms)
        air = [row for row in range(first, last) if wanted is not None and wanted[row]]
        nonlinear = [*range(structure.mix.shape[1], first), *air]

        for run, result, slopes in self.simulated(structure, z, self.still, sloped=sloped, air=air):
            still, counts = run.place in self.still, self.counting(run)[:, np.newaxis]
            scale = counts / (bench.highest * bench.unit if still else bench.travel)
            target = 0.0 if still else run.outputs[self.places(run)]
            errors.append(((result - target) * scale).ravel())
            if sloped:
                scaled = slopes * scale[..., np.newaxis]
                table.append(self._by_unknowns(structure, run, scaled))
                flat = scaled.reshape(-1, scaled.shape[2])
                table[-1][:, nonlinear] = flat[:, structure.n_linear :]
        return errors, np.concatenate(table)

    def _by_unknowns(self, structure: Structure, run: Run, slopes: Array) -> Array:
        """Return derivatives by all unknowns, shape (k m, unknowns), from those by coefficients.

        Those by nonlinear parameters are 0.
        """
        loads, flat = self.loads_at(structure, run), slopes.reshape(-1, slopes.shape[-1])
        table = np.zeros((len(flat), self.size(structure)))
        table[:, : structure.mix.shape[1]] = flat[:, : structure.n_linear] @ structure.mix
        table[:, loads] = flat[:, structure.springs[: loads.stop - loads.start, 0, 0]]
        return table

    def _by_air(self, structure: Structure, z: Array, run: Run, places: Sequence[int]) -> Array:
        """Return derivatives of acting pressures by front parameters, shape (t, muscles, places)."""
        n, last = structure.mix.shape[1], len(structure.terms)
        _, high, scales = structure.nonlinear_ranges
        steps = np.zeros(z.size)
        steps[n:last] = np.where(z[n:last] + STEP * scales <= high, STEP, -STEP) * scales
        return differences(
            lambda moved: self.acting(run, structure, structure.expanded(moved)),
            z,
            steps,
            places,
        )

    @property
    def all_at_rest(self) -> bool:
        """Whether all runs with motion begin near the lowest pressures, and without earlier memory."""
        low, most = self.data.lowest, RESTING * (self.data.highest - self.data.lowest)
        first = (run.driven[0] for run in self.data.runs if run.place not in self.still)
        return all(bool((p - np.minimum(low, 0.0) <= most).all()) for p in first)

    def resisted(self, structure: Structure, z: Array) -> tuple[float, float]:
        """Return the least and largest resistance of any muscle at measured positions."""
        values, resistances = structure.expanded(z), list[Array]()
        springs, shares = values[structure.springs], values[structure.at["loads"]]
        for run in self.data.runs:
            x, loads = np.split(run.scheduled, [len(structure.bench.scheduled)], axis=1)
            positions = np.column_stack([np.ones(len(x)), run.outputs])
            stiffness = springs_at(springs, x.T, structure.degree)
            spring_force = np.einsum("tji,ti->tj", stiffness, positions)
            resistances.append(-(spring_force + loads @ shares.T))
        table_of_runs = np.concatenate(resistances)
        return float(table_of_runs.min()), float(table_of_runs.max())

    # -- the linear stage ------------------------------------------------------------------------

    def balanced(self, structure: Structure, z: Array, active: Mask) -> Array:
        """Return the linear parameters of the force balance at measured positions.

        Forces are weighed by stiffness, so that errors are of displacement: least squares of growing
        stiffness, then once more within physics.
        """
        stage = self._linear_stage(structure, z, active)
        weights = np.ones(stage.table.shape[:2])
        for _ in range(PASSES):
            rows = stage.weighted(weights)
            products = (rows.T @ rows)[np.newaxis]
            bounded = stage.bounded
            stage.set(solve_products(products, bounded.size, RIDGE, bounded=bounded)[0, :, 0])
            if not structure.bench.of_force:
                weights = 1.0 / (self.stiffness(structure, stage.z) * structure.bench.travel)

        triangle: Array = np.linalg.qr(stage.weighted(weights), mode="r")  # type: ignore[assignment]
        solve = partial(solve_constrained, triangle[:, :-1], triangle[:, -1], ridge=RIDGE)
        physics = stage.constraints(*structure.constraints(structure.expanded(stage.z)))
        solve_stiff(structure, solve, physics, stage.constraints, stage.set)
        return stage.z

    def _linear_stage(self, structure: Structure, z: Array, active: Mask) -> LinearStage:
        """Return the least-squares problem of the active linear terms, and of recordings' loads.

        Sizes of areas at rest are not determined: those of muscles with a coordinate each are fixed.
        """
        n, of_force = structure.mix.shape[1], structure.bench.of_force
        linear = structure.terms[:n]
        fixed = np.array([not of_force and term[:2] == ("areas", 0) for term in linear])
        chosen = np.flatnonzero(active[:n] & ~fixed)
        narrowing = np.flatnonzero([linear[i].kind == "areas" and not of_force for i in chosen])
        start = z.copy()
        start[:n] = 0.0

        columns, target = self._forces(structure, start, chosen)
        means = np.einsum("tjc,tj->c", columns[..., narrowing], target)
        means = means / float((target**2).sum())
        columns[..., narrowing] -= means * target[..., np.newaxis]
        table = np.concatenate([columns, target[..., np.newaxis]], axis=2)
        return LinearStage(structure, chosen, narrowing, means, table, start)

    def _forces(self, structure: Structure, start: Array, chosen: Indices) -> tuple[Array, Array]:
        """Return derivatives of forces by linear terms and recordings' loads, and the lacking forces.

        Shapes (k, m, unknowns) and (k, m).
        """
        columns, targets = [], []
        linear = np.append(chosen, np.arange(len(structure.terms), self.size(structure)))
        every_run = [run.place for run in self.data.runs]
        for run, lacking, slopes in self.simulated(structure, start, every_run):
            counts = self.counting(run)[:, np.newaxis]
            targets.append(-lacking * counts)
            by_unknowns = self._by_unknowns(structure, run, slopes * counts[..., np.newaxis])
            columns.append(by_unknowns[:, linear].reshape(*lacking.shape, -1))
        return np.concatenate(columns), np.concatenate(targets)

    def stiffness(self, structure: Structure, z: Array) -> Array:
        """Return the stiffness of every coordinate with stops mostly sliding, shape (k, m)."""
        values, scale = structure.expanded(z), structure.bench.scale
        table = []
        for run in self.data.runs:
            places = self.places(run)
            q, p = run.outputs[places], self.acting(run, structure, values)[places]
            x = run.scheduled[places, : len(structure.bench.scheduled)].T
            springs = springs_at(values[structure.springs], x, structure.degree)
            stiffness = springs[..., 1:].diagonal(axis1=1, axis2=2).copy()
            for k, direction in enumerate(structure.bench.directions):
                u = q @ direction / scale
                elastic = polynomial.polyder([0.0, 0.0, *values[structure.at["elasticity"][k]]])
                narrowing = polynomial.polyder(values[structure.at["areas"][k]])
                of_muscle = polynomial.polyval(u, elastic) / scale
                of_muscle -= p[:, k] * polynomial.polyval(u, narrowing) / scale
                of_muscle += float(values[structure.at["bladders"][k]].sum())
                of_muscle += STICKING * float(values[structure.at["friction"][k]].sum())
                stiffness += np.outer(of_muscle, direction**2)
            table.append(stiffness)
        rows = np.concatenate(table)
        return np.maximum(rows, LEAST_SHARE * np.median(np.abs(rows), axis=0))


@dataclass(frozen=True, eq=False)
class LinearStage:
    """Least squares of the force balance by linear terms, in the unit in which the mean area is 1.

    In that unit, the constant area of 1 at rest is replaced by one over all samples, so that no fit can
    make forces small by small areas. `set` returns to the unit in which the area at rest is 1.

    Parameters
    ----------
    structure : Structure
    chosen : array of int
        Linear terms that are found; loads of recordings follow.
    narrowing : array of int
        Which of these are of the area.
    means : array
        Projection of their columns on the target.
    table : array, shape (k, m, unknowns + 1)
        Forces by the unknowns at every sample and coordinate, and in the last column their target.
    z : array
        All free parameters, as last `set`.
    """

    structure: Structure
    chosen: Indices
    narrowing: Indices
    means: Array
    table: Array
    z: Array

    @property
    def bounded(self) -> Mask:
        """Which of the unknowns are not negative."""
        n_loads = self.table.shape[2] - 1 - self.chosen.size
        return np.append(self.structure.bounded[self.chosen], np.zeros(n_loads, dtype=bool))

    def weighted(self, weights: Array) -> Array:
        """Return the table with weighted rows, shape (k m, unknowns + 1)."""
        return (self.table * weights[..., np.newaxis]).reshape(-1, self.table.shape[2])

    def set(self, solution: Array) -> Array:
        """Set the parameters to a solution; return the linear coefficients."""
        structure, count = self.structure, self.chosen.size
        at_rest = max(1.0 + float(self.means @ solution[self.narrowing]), LEAST_AT_REST)
        self.z[self.chosen] = solution[:count] / at_rest
        self.z[len(structure.terms) :] = solution[count:] / at_rest
        return structure.base + structure.mix @ self.z[: structure.mix.shape[1]]

    def constraints(self, sides: Array, bounds: Array) -> tuple[Array, Array]:
        """Return constraints of the unknowns from those of coefficients, ``sides @ c >= bounds``."""
        structure, count = self.structure, self.chosen.size
        scaling = np.zeros(count)
        scaling[self.narrowing] = self.means
        mix = structure.mix[:, self.chosen] + np.outer(structure.base, scaling)
        of_unknowns = np.zeros((len(sides), self.table.shape[2] - 1))
        of_unknowns[:, :count] = sides @ mix - np.outer(bounds, scaling)
        return of_unknowns, bounds - sides @ structure.base


def solve_stiff(
    structure: Structure,
    solve: Callable[[Array, Array], Array],
    physics: tuple[Array, Array],
    constraints: Callable[[Array, Array], tuple[Array, Array]],
    update: Callable[[Array], Array],
) -> None:
    """Solve least squares within physics; where springs are soft, constrain them and solve again.

    Parameters
    ----------
    solve : callable
        Returns the solution within constraints, ``sides @ solution >= bounds``.
    physics : (array, array)
        Constraints to begin with.
    constraints : callable
        Returns constraints of the solution from those of linear coefficients.
    update : callable
        Sets the parameters to a solution, and returns the linear coefficients.
    """
    sides, bounds = physics
    for _ in range(MOST_CUTS):
        side, stiffness = structure.softest(update(solve(sides, bounds)))
        if stiffness >= 0.5 * structure.least_stiffness:
            break
        cut, bound = constraints(side[np.newaxis], np.array([structure.least_stiffness]))
        sides, bounds = np.vstack([sides, cut]), np.append(bounds, bound)


def problem_of(data: TrainingData, samples: int, most: int, *, of_force: bool) -> Problem:
    """Return the problem of about so many samples at most, and so many compared numbers."""
    data = coarser(data, samples)
    total = sum(len(run.outputs) for run in data.runs) * len(data.outputs)
    return Problem(data, max(1, total // most), of_force=of_force)


def coarser(data: TrainingData, most: int) -> TrainingData:
    """Return data with at most about so many samples.

    Runs are thinned where inputs go straight between samples, and then chosen evenly.
    """
    total = sum(len(run.outputs) for run in data.runs)
    every = max(1, -(-total // most))
    while every > 1 and not _straight(data, every):
        every -= 1
    count = max(min(len(data.runs) * most * every // total, len(data.runs)), 1)
    indices = np.unique(np.linspace(0, len(data.runs) - 1, count).round().astype(int))
    return replace(data, runs=tuple(data.runs[i].thinned(every) for i in indices))


def _straight(data: TrainingData, every: int) -> bool:
    """Return whether inputs go straight between every n-th sample."""
    tables, missed = [np.hstack([run.driven, run.scheduled]) for run in data.runs], list[Array]()
    spans = np.maximum(np.ptp(np.concatenate(tables), axis=0), 1e-300)
    for table in tables:
        t = np.arange(len(table))
        missed += [np.interp(t, t[::every], u[::every]) - u for u in (table / spans).T]
    return float(np.std(np.concatenate(missed))) <= STRAIGHT
