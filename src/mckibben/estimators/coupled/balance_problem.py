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

LEAST_AT_REST, PASSES = 0.1, 3
"""Smallest area at rest, relative to the mean over samples; number of reweightings of forces."""

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
        shape = tuple(values[structure.at["filling"][0] :].tolist())
        if not (shape[0] or shape[2] or shape[3]):
            return run.driven
        key = (run.place, *shape)
        if key not in self._fronts:
            if len(self._fronts) > 4 * len(self.data.runs):
                self._fronts.clear()
            driven = run.driven
            for block in front(structure, values, Channel("pressure", "bar")):
                columns = np.ascontiguousarray(driven.T)[..., np.newaxis]
                acting = [run_many([block], p, sample_time=run.sample_time) for p in columns]
                driven = np.column_stack([one[0] for one in acting])
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
            found, slopes = simulate(
                c, driven, run.outputs, run.scheduled, by_air,
                held=run.place in held, every=self.every, sloped=sloped,
            )  # fmt: skip
            yield run, found, slopes

    def errors(
        self, structure: Structure, z: Array, wanted: Mask | None = None
    ) -> tuple[list[Array], Array]:
        """Return the errors of every run, and derivatives by all unknowns, shape (errors, unknowns).

        Errors are relative to ranges; of a run in which nothing moves, they are the forces that are
        lacking, over that of the highest pressure at rest. Derivatives are computed only if some are
        ``wanted``. Those by parameters of the front are finite differences of the acting pressures.
        """
        errors, slopes, bench = list[Array](), [np.zeros((0, z.size))], structure.bench
        sloped = wanted is not None
        first, last = structure.positions("filling").start, len(structure.terms)
        air = [place for place in range(first, last) if wanted is not None and wanted[place]]
        shape = [*range(structure.mix.shape[1], first), *air]
        for run, found, by in self.simulated(structure, z, self.still, sloped=sloped, air=air):
            still, counts = run.place in self.still, self.counting(run)[:, np.newaxis]
            scale = counts / (bench.highest * bench.unit if still else bench.travel)
            target = 0.0 if still else run.outputs[self.places(run)]
            errors.append(((found - target) * scale).ravel())
            if sloped:
                by = by * scale[..., np.newaxis]
                slopes.append(self._by_unknowns(structure, run, by))
                slopes[-1][:, shape] = by.reshape(-1, by.shape[2])[:, structure.n_linear :]
        return errors, np.concatenate(slopes)

    def _by_unknowns(self, structure: Structure, run: Run, slopes: Array) -> Array:
        """Return derivatives by all unknowns, shape (k m, unknowns), from those by coefficients.

        Those by nonlinear parameters are 0.
        """
        loads, flat = self.loads_at(structure, run), slopes.reshape(-1, slopes.shape[-1])
        found = np.zeros((len(flat), self.size(structure)))
        found[:, : structure.mix.shape[1]] = flat[:, : structure.n_linear] @ structure.mix
        found[:, loads] = flat[:, structure.springs[: loads.stop - loads.start, 0, 0]]
        return found

    def _by_air(self, structure: Structure, z: Array, run: Run, places: Sequence[int]) -> Array:
        """Return derivatives of acting pressures by front parameters, shape (t, muscles, places)."""
        n, last = structure.mix.shape[1], len(structure.terms)
        _, high, scales = structure.nonlinear_ranges
        steps = np.zeros(z.size)
        steps[n:last] = np.where(z[n:last] + STEP * scales <= high, STEP, -STEP) * scales
        return differences(
            lambda moved: self.acting(run, structure, structure.expanded(moved)), z, steps, places
        )

    @property
    def all_at_rest(self) -> bool:
        """Whether all runs with motion begin near the lowest pressures, and without earlier memory."""
        low, most = self.data.lowest, RESTING * (self.data.highest - self.data.lowest)
        begun = (run.driven[0] for run in self.data.runs if run.place not in self.still)
        return all(bool((p - np.minimum(low, 0.0) <= most).all()) for p in begun)

    def resisted(self, structure: Structure, z: Array) -> tuple[float, float]:
        """Return the least and largest resistance of any muscle at measured positions."""
        values, found = structure.expanded(z), list[Array]()
        springs, shares = values[structure.springs], values[structure.at["loads"]]
        for run in self.data.runs:
            x, loads = np.split(run.scheduled, [len(structure.bench.scheduled)], axis=1)
            around = np.column_stack([np.ones(len(x)), run.outputs])
            pulled = np.einsum("tji,ti->tj", springs_at(springs, x.T, structure.degree), around)
            found.append(-(pulled + loads @ shares.T))
        whole = np.concatenate(found)
        return float(whole.min()), float(whole.max())

    # -- the linear stage ------------------------------------------------------------------------

    def balanced(self, structure: Structure, z: Array, active: Mask) -> Array:
        """Return the linear parameters of the force balance at measured positions.

        Forces are weighed by stiffness, so that errors are of displacement. Sizes of areas
        at rest are not determined: those of muscles with a coordinate each are 1 at the mean of samples.
        """
        n, n_terms = structure.mix.shape[1], len(structure.terms)
        terms, of_force = structure.terms[:n], structure.bench.of_force
        fixed = [not of_force and term[:2] == ("areas", 0) for term in terms]
        chosen = np.flatnonzero(active[:n] & ~np.array(fixed))
        narrowing = np.flatnonzero([terms[i].kind == "areas" and not of_force for i in chosen])
        start = z.copy()
        start[:n] = 0.0
        whole, target = self._forces(structure, start, chosen)
        bounded = np.append(structure.bounded[chosen], np.zeros(z.size - n_terms, dtype=bool))
        means = np.einsum("tjc,tj->c", whole[..., narrowing], target) / float((target**2).sum())
        whole[..., narrowing] -= means * target[..., np.newaxis]
        table = np.concatenate([whole, target[..., np.newaxis]], axis=2)
        weight = np.ones_like(target)

        def put(least: Array) -> Array:
            """Set the parameters in the unit in which the area is 1; return the coefficients."""
            at_rest = max(1.0 + float(means @ least[narrowing]), LEAST_AT_REST)
            start[chosen] = least[: chosen.size] / at_rest
            start[n_terms:] = least[chosen.size :] / at_rest
            return structure.base + structure.mix @ start[:n]

        for _ in range(PASSES):
            flat = (table * weight[..., np.newaxis]).reshape(-1, table.shape[2])
            products = (flat.T @ flat)[np.newaxis]
            put(solve_products(products, bounded.size, RIDGE, bounded=bounded)[0, :, 0])
            if not of_force:
                weight = 1.0 / (self.stiffness(structure, start) * structure.bench.travel)
        # the same within physics, in the unit in which the area is 1 on average
        flat = (table * weight[..., np.newaxis]).reshape(-1, table.shape[2])
        triangle: Array = np.linalg.qr(flat, mode="r")  # type: ignore[assignment]
        scaling = np.zeros(chosen.size)
        scaling[narrowing] = means
        mix = structure.mix[:, chosen] + np.outer(structure.base, scaling)

        def asked(sides: Array, bounds: Array) -> tuple[Array, Array]:
            on = np.zeros((len(sides), bounded.size))
            on[:, : chosen.size] = sides @ mix - np.outer(bounds, scaling)
            return on, bounds - sides @ structure.base

        solve = partial(solve_constrained, triangle[:, :-1], triangle[:, -1], ridge=RIDGE)
        physics = asked(*structure.constraints(structure.expanded(start)))
        solve_stiff(structure, solve, physics, asked, put)
        return start

    def _forces(self, structure: Structure, start: Array, chosen: Indices) -> tuple[Array, Array]:
        """Return derivatives of forces by linear terms and recordings' loads, and their target."""
        rows, targets = [], []
        linear = np.append(chosen, np.arange(len(structure.terms), self.size(structure)))
        for run, lacking, slopes in self.simulated(
            structure, start, [run.place for run in self.data.runs]
        ):
            counts = self.counting(run)[:, np.newaxis]
            targets.append(-lacking * counts)
            found = self._by_unknowns(structure, run, slopes * counts[..., np.newaxis])[:, linear]
            rows.append(found.reshape(*lacking.shape, -1))
        return np.concatenate(rows), np.concatenate(targets)

    def stiffness(self, structure: Structure, z: Array) -> Array:
        """Return the stiffness of every coordinate with stops mostly sliding, shape (k, m)."""
        values, found = structure.expanded(z), []
        for run in self.data.runs:
            places = self.places(run)
            q, p = run.outputs[places], self.acting(run, structure, values)[places]
            x = run.scheduled[places, : len(structure.bench.scheduled)].T
            springs = springs_at(values[structure.springs], x, structure.degree)
            own, scale = springs[..., 1:].diagonal(axis1=1, axis2=2).copy(), structure.bench.scale
            for k, way in enumerate(structure.bench.directions):
                u = q @ way / scale
                elastic = polynomial.polyder([0.0, 0.0, *values[structure.at["elasticity"][k]]])
                narrowing = polynomial.polyder(values[structure.at["areas"][k]])
                stiff = polynomial.polyval(u, elastic) / scale
                stiff -= p[:, k] * polynomial.polyval(u, narrowing) / scale
                stiff += float(values[structure.at["bladders"][k]].sum())
                stiff += 0.3 * float(values[structure.at["friction"][k]].sum())
                own += np.outer(stiff, way**2)
            found.append(own)
        whole = np.concatenate(found)
        return np.maximum(whole, 0.1 * np.median(np.abs(whole), axis=0))


def solve_stiff(
    structure: Structure,
    solve: Callable[[Array, Array], Array],
    physics: tuple[Array, Array],
    asked: Callable[[Array, Array], tuple[Array, Array]],
    put: Callable[[Array], Array],
) -> None:
    """Solve least squares within physics; springs are made stiff where they were found soft.

    Parameters
    ----------
    solve : callable
        Returns the solution within constraints, ``sides @ solution >= bounds``.
    physics : (array, array)
        Constraints to begin with.
    asked : callable
        Returns those of linear coefficients as such.
    put : callable
        Sets the solution, and returns the linear coefficients.
    """
    sides, bounds = physics
    for _ in range(MOST_CUTS):
        side, softest = structure.softest(put(solve(sides, bounds)))
        if softest >= 0.5 * structure.least_stiffness:
            break
        more = asked(side[np.newaxis], np.array([structure.least_stiffness]))
        sides, bounds = np.vstack([sides, more[0]]), np.append(bounds, more[1])


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
    chosen = np.unique(np.linspace(0, len(data.runs) - 1, count).round().astype(int))
    return replace(data, runs=tuple(data.runs[i].thinned(every) for i in chosen))


def _straight(data: TrainingData, every: int) -> bool:
    """Return whether inputs go straight between every n-th sample."""
    tables, missed = [np.hstack([run.driven, run.scheduled]) for run in data.runs], list[Array]()
    spans = np.maximum(np.ptp(np.concatenate(tables), axis=0), 1e-300)
    for table in tables:
        t = np.arange(len(table))
        missed += [np.interp(t, t[::every], u[::every]) - u for u in (table / spans).T]
    return float(np.std(np.concatenate(missed))) <= STRAIGHT
