"""Identification of a balance of forces.

First the forces that the muscles lack where they were measured, linear in almost all coefficients, by
least squares weighted by stiffness; then the displacements of the free run, by Gauss-Newton steps with
exact derivatives. Both keep to what physics asks (`mckibben.estimators.coupled.balance_structure`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Interval

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.errors import ModelError
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.coupled.balance_slopes import run as follow
from mckibben.estimators.coupled.balance_structure import Structure
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.estimators.optimisers.constrained import constrained_least_squares
from mckibben.estimators.optimisers.tracker import Tracker

LOADS = ("N",)
"""Units of what loads a muscle, instead of scheduling its springs."""

LIMITED = ("bar", "V")
"""Units of what the hardware limits."""

MOST_ROWS = 12_000
"""Errors to learn from; more are thinned evenly."""

GRIPS = (0.05, 0.2, 0.8)
"""Where to begin, relative to the highest pressure."""

LIGHTEST = 1e-13
"""Damping of a Gauss-Newton step."""

MOST_TRIES = 9
"""Dampings tried for a step, each ten times the last."""

MOST_CUTS = 8
"""Times that springs are made stiff where they were found soft."""

HELD = 0.02
"""A muscle is held where it moves less than this share of what it moves in all runs."""

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
        Time constants of what relaxes [s]; default ``n_lags`` from half a second to a third of the
        longest recording.
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
    ridge : float
        Damping of the coefficients.
    steps : int
        Most Gauss-Newton steps.
    """

    effort: ClassVar[float] = 1.0

    n_stops: Annotated[int, Interval(ge=0, le=30)] = 6
    finest: Annotated[float, Gt(0)] = 0.003
    lags: tuple[Annotated[float, Gt(0)], ...] | None = None
    n_lags: Annotated[int, Interval(ge=0, le=10)] = 2
    elasticity: Annotated[int, Interval(ge=1, le=9)] = 6
    area: Annotated[int, Interval(ge=0, le=6)] = 2
    degree: Annotated[int, Interval(ge=1, le=4)] = 2
    tare: bool | None = None
    ridge: Annotated[float, Ge(0)] = 1e-6
    steps: Annotated[int, Interval(ge=0, le=1000)] = 25

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the balance, solved for displacements."""
        search = Search(data, self.structure(data, tracker), self.ridge)
        with tracker.searching():
            starts = []
            for grip in GRIPS if self.n_stops else GRIPS[:1]:
                values = search.begun(grip * search.structure.highest)
                cost = search.cost(values)
                tracker.saw(values, cost)
                starts.append((cost, values))
            cost, values = min(starts, key=lambda start: start[0])
            for number, (found, cost) in enumerate(search.descend(values, self.steps)):
                tracker.saw(found, cost)
                tracker.reached(min(0.95, (number + 1) / (self.steps + 1)))
        if tracker.best is None or not np.isfinite(tracker.best_cost):
            raise ModelError(
                "no balance of forces runs free over these recordings. Remedy: check that displacements "
                "count as shortening and loads as pulling the muscle longer"
            )
        low, high = float(data.lowest.min()), float(data.highest.max())
        limited = data.inputs[0].unit in LIMITED
        bounds = (min(low, 0.0), high) if limited else None
        return search.structure.block(tracker.best, bounds).inverse()

    def structure(self, data: TrainingData, tracker: Tracker) -> Structure:
        """Return sizes and settings that suit the recordings.

        Raises
        ------
        ModelError
            If nothing ever moves.
        """
        y = data.stacked("outputs")
        span = np.ptp(y, axis=0)
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
        timed = data.sample_time is not None
        return Structure(
            driven=data.outputs,
            scheduled=tuple(data.scheduled[i] for i in scheduled),
            loaded=tuple(c for c, load in zip(data.scheduled, loaded, strict=True) if load),
            given=data.inputs,
            degree=degree,
            n_elastic=self.elasticity - 1,
            n_area=self.area + 1,
            limits=np.geomspace(self.finest, 0.5, self.n_stops) * float(span.max()) / highest,
            lags=self._lags(data) if timed else np.zeros(0),
            lag_range=(2.0 * (data.sample_time or 1.0), max(self._longest(data), 1.0)),
            hull=np.column_stack([y.min(axis=0) - margin, y.max(axis=0) + margin]),
            scheduled_hull=np.column_stack([x.min(axis=0), x.max(axis=0)]),
            highest=highest,
            tare=tare,
        )

    def _lags(self, data: TrainingData) -> Array:
        """Return time constants [s] that the recordings can tell."""
        if self.lags is not None:
            return np.array(self.lags)
        last = min(max(self._longest(data) / 3.0, 1.0), 60.0)
        return np.geomspace(min(0.5, last / 4.0), last, self.n_lags) if self.n_lags else np.zeros(0)

    def _longest(self, data: TrainingData) -> float:
        """Return the duration of the longest run [s]."""
        return max(len(run.outputs) * (run.sample_time or 0.0) for run in data.runs)


class Search:
    """Coefficients that make the free run follow the recordings.

    Parameters
    ----------
    data : TrainingData
    structure : Structure
    ridge : float
        Damping.
    """

    def __init__(self, data: TrainingData, structure: Structure, ridge: float) -> None:
        self.data, self.structure, self.ridge = data, structure, ridge
        loads = {channel.name for channel in structure.loaded}
        order = [i for i, c in enumerate(data.scheduled) if c.name not in loads]
        order += [i for i, c in enumerate(data.scheduled) if c.name in loads]
        self.runs = [replace(run, scheduled=run.scheduled[:, order]) for run in data.runs]
        self.span = np.ptp(data.stacked("outputs"), axis=0)
        n_rows = sum(len(run.outputs) for run in self.runs) * structure.n
        self.every = max(1, n_rows // MOST_ROWS)
        self.cuts: list[tuple[Array, Array]] = []

    def held(self, run: Run) -> bool:
        """Tell whether nothing moves in a run, so that its forces are what is compared."""
        return bool((np.ptp(run.outputs, axis=0) < HELD * self.span).all()) and bool(
            self.structure.loaded
        )

    def followed(self, values: Array, run: Run, *, held: bool) -> tuple[Array, Array]:
        """Return displacements, or forces that are lacking, and their slopes."""
        block = self.structure.block(values)
        return follow(
            block.coefficients(run.sample_time or 1.0),
            np.ascontiguousarray(run.driven),
            np.ascontiguousarray(run.outputs),
            np.ascontiguousarray(run.scheduled),
            held=held,
            every=self.every,
        )

    def measured(self, run: Run) -> Array:
        """Return the displacements that are compared."""
        kept = np.arange(-(-len(run.outputs) // self.every)) * self.every + self.every - 1
        return run.outputs[np.minimum(kept, len(run.outputs) - 1)]

    def begun(self, grip: float) -> Array:
        """Return coefficients that balance the forces where the muscles were."""
        structure = self.structure
        values = structure.start
        values[structure.grip] = grip
        found = [self.followed(values, run, held=True)[1] for run in self.runs]
        slopes = np.concatenate(found)
        slopes[:, :, structure.grip :] = 0.0
        for k in range(structure.n):
            slopes[:, :, structure.places("wall", k)] = 0.0
        mix = structure.free(moving=False)
        base = values.copy()
        if structure.loaded:  # areas are found in newtons by what the loads pull
            for k in range(structure.n):
                base[structure.places("areas", k)[0]] = 0.0
        weights = np.ones((1, structure.n))
        for _ in range(2):
            rows = slopes * weights[..., np.newaxis]
            flat = rows.reshape(-1, rows.shape[2])
            values = self.solved(
                flat @ mix, -(flat @ base), base, mix, np.zeros(mix.shape[1]), self.ridge
            )
            weights = 1.0 / self.stiffness(values)
        return values

    def stiffness(self, values: Array) -> Array:
        """Return how stiff every muscle is at every sample kept, shape (samples, n)."""
        structure, found = self.structure, []
        for run in self.runs:
            y = self.measured(run)
            columns = []
            for k in range(structure.n):
                u = y[:, k] / structure.scale
                own = np.zeros(len(u))
                springs = values[structure.places("springs", k)].reshape(-1, 1 + structure.n)
                x = run.scheduled[:: self.every][: len(u)]
                for i in range(len(u)):
                    own[i] = structure.powers(x[i, : len(structure.scheduled)]) @ springs[:, 1 + k]
                elastic = values[structure.places("elasticity", k)]
                for i, e in enumerate(elastic, start=2):
                    own += e * i * u ** (i - 1) / structure.scale
                area = values[structure.places("areas", k)]
                p = run.driven[:: self.every][: len(u), k]
                for i, a in enumerate(area[1:], start=1):
                    own -= p * a * i * u ** (i - 1) / structure.scale
                columns.append(own + 0.3 * values[structure.places("friction", k)].sum())
            found.append(np.column_stack(columns))
        table = np.concatenate(found)
        return np.maximum(table, 0.1 * np.median(np.abs(table), axis=0))

    def solved(
        self, slopes: Array, target: Array, base: Array, mix: Array, prior: Array, damping: float
    ) -> Array:
        """Return coefficients base + mix free with the least |slopes free - target| that physics allows.

        Damped towards ``prior``; springs are made stiff where they were found soft.
        """
        structure = self.structure
        sides, least = structure.conditions(base + mix @ prior)
        n_free = mix.shape[1]
        whole = np.zeros((len(base) + structure.n, n_free + structure.n))
        whole[: len(base), :n_free] = mix
        whole[len(base) :, n_free:] = np.eye(structure.n)
        size = np.maximum(np.sqrt((slopes**2).sum(axis=0)), 1e-12)
        triangle: Array = np.linalg.qr(np.column_stack([slopes, target]), mode="r")  # type: ignore[assignment]
        for x, direction in self.cuts:
            row, bound = structure.spring_condition(x, direction, float(least[-1]))
            sides, least = np.vstack([sides, row]), np.append(least, bound)
        # by the coefficient's own effect, so that units do not matter
        held = np.sqrt(damping) * size
        small = 1e-6 * float(size.max())
        system = np.zeros((len(triangle) + n_free + structure.n, n_free + structure.n))
        system[: len(triangle), :n_free] = triangle[:, :-1]
        system[len(triangle) :, :] = np.diag(
            [*np.maximum(held, 1e-10 * size.max()), *[small] * structure.n]
        )
        right = np.concatenate([triangle[:, -1], held * prior, np.zeros(structure.n)])
        origin = np.append(base, np.zeros(structure.n))
        stiff = float(least[-1])
        for _ in range(MOST_CUTS):
            free, _ = constrained_least_squares(
                system, right, sides @ whole, least - sides @ origin
            )
            found = origin + whole @ free
            values, made_up = found[: len(base)], found[len(base) :]
            x, direction, softest = structure.softest(values, made_up)
            if softest >= 0.5 * stiff:
                break
            self.cuts.append((x, direction))
            row, bound = structure.spring_condition(x, direction, stiff)
            sides, least = np.vstack([sides, row]), np.append(least, bound)
        return values

    def errors(self, values: Array) -> tuple[Array, Array]:
        """Return errors of the free run relative to the ranges, and their slopes by coefficients."""
        errors, slopes = [], []
        for run in self.runs:
            if self.held(run):
                lacking, by = self.followed(values, run, held=True)
                block_area = values[self.structure.places("areas", 0)[0]] * self.structure.highest
                scale = np.full(self.structure.n, 1.0 / block_area)
                errors.append((lacking * scale).ravel())
            else:
                found, by = self.followed(values, run, held=False)
                scale = 1.0 / self.span
                errors.append(((found - self.measured(run)) * scale).ravel())
            slopes.append((by * scale[:, np.newaxis]).reshape(-1, by.shape[2]))
        return np.concatenate(errors), np.concatenate(slopes)

    def cost(self, values: Array) -> float:
        """Return the root mean square of the errors."""
        errors = self.errors(values)[0]
        return float(np.sqrt(np.mean(errors**2))) if np.isfinite(errors).all() else np.inf

    def descend(self, values: Array, steps: int) -> Iterator[tuple[Array, float]]:
        """Yield ever better coefficients, and the root mean square of their errors."""
        mix = self.structure.free(moving=True)
        damping = 1e-3
        errors, slopes = self.errors(values)
        cost = float(np.sqrt(np.mean(errors**2)))
        slow = 0
        for _ in range(steps):
            moving = slopes @ mix
            usable = np.isfinite(moving).all(axis=1)
            now: Array = np.asarray(np.linalg.lstsq(mix, values, rcond=None)[0], np.float64)
            base = values - mix @ now
            target = moving[usable] @ now - errors[usable]
            for _ in range(MOST_TRIES):
                try:
                    tried = self.solved(moving[usable], target, base, mix, now, damping)
                except ModelError:
                    damping = max(10.0 * damping, 1e-9)
                    continue
                tried_errors, tried_slopes = self.errors(tried)
                found = float(np.sqrt(np.mean(tried_errors**2)))
                if found < cost:
                    break
                damping = max(10.0 * damping, 1e-9)
            else:
                return
            gained = (cost - found) / cost
            values, errors, slopes, cost = tried, tried_errors, tried_slopes, found
            yield values, cost
            damping = max(damping / 5.0, LIGHTEST)
            slow = slow + 1 if gained < 1e-3 else 0
            if slow >= 3:
                return
