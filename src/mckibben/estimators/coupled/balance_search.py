"""The search for a balance of forces: least squares of its forces, then descent of its free run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.uncertainty import inverted
from mckibben.estimators.coupled.balance_checks import at_rest, held
from mckibben.estimators.coupled.balance_slopes import run as follow
from mckibben.estimators.coupled.balance_structure import LEAST_PULL, Structure
from mckibben.estimators.optimisers.constrained import constrained_least_squares
from mckibben.estimators.optimisers.tracker import Tracker

MOST_ROWS = 12_000
"""Errors to learn from; more are thinned evenly."""

MOST_SAMPLES = 30_000
"""To find the way by; the last steps look at all."""

WARMING = 0.2
"""Share of a run that does not begin at rest before which its errors do not count."""

UNLIKELY = 0.03
"""Error, relative to the range, as bad as a start with all friction loaded, or a range behind."""

MOST_TRIES = 9
"""Dampings tried for a step, each ten times the last."""

MOST_CUTS = 8
"""Times that springs are made stiff where they were found soft."""

LIGHTEST = 1e-7
"""Root of the damping of a step that is hardly damped."""

UNKNOWN = 1e-10
"""Effect, relative to the largest of any number, that is none."""


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
        self.n_rows = n_rows
        self.every = max(1, n_rows // MOST_ROWS)
        self.cuts: list[tuple[Array, Array]] = []

    def of_few(self, most: int = MOST_SAMPLES) -> Search:
        """Return the same search over evenly chosen recordings, where there are very many samples."""
        total = sum(len(run.outputs) for run in self.runs)
        if total <= most:
            return self
        count = max(most * len(self.runs) // total, 1)
        chosen = np.unique(np.linspace(0, len(self.runs) - 1, count).round().astype(int))
        few = replace(self.data, runs=tuple(self.data.runs[i] for i in chosen.tolist()))
        found = Search(few, self.structure, self.ridge)
        found.span, found.cuts = self.span, self.cuts
        return found

    def held(self, run: Run) -> bool:
        """Tell whether nothing moves in a run, so that its forces are what is compared."""
        return bool(self.structure.loaded) and held(self.data, run)

    def followed(self, values: Array, run: Run, *, held: bool) -> tuple[Array, Array]:
        """Return displacements, or forces that are lacking, and their slopes."""
        structure, own = self.structure, self.structure.own_loads(run.recording)
        if own.size:
            values = values.copy()
            values[structure.constants] += values[own]
        block = structure.block(values)
        begun, by_values = structure.begun(values, run.place, run.driven[0])
        if held:
            begun = begun[:0]
        found, slopes = follow(
            block.coefficients(run.sample_time or 1.0),
            np.ascontiguousarray(run.driven),
            np.ascontiguousarray(run.outputs),
            np.ascontiguousarray(run.scheduled),
            held=held,
            every=self.every,
            settled=self.held(run) or (held and not structure.tare and at_rest(self.data, run)),
            begun=begun,
        )
        if structure.size == structure.timing.stop:
            return found, slopes
        whole = np.zeros((*slopes.shape[:2], structure.size))
        whole[..., : structure.timing.stop] = slopes[..., : structure.timing.stop]
        whole[..., own] = slopes[..., structure.constants[: own.size]]
        if begun.size:
            whole += slopes[..., structure.timing.stop :] @ by_values
        return found, whole

    def measured(self, run: Run) -> Array:
        """Return the displacements that are compared."""
        kept = np.arange(-(-len(run.outputs) // self.every)) * self.every + self.every - 1
        return run.outputs[np.minimum(kept, len(run.outputs) - 1)]

    def begun(self, grip: float, *, plain: bool = False) -> Array:
        """Return coefficients that balance the forces where the muscles were.

        ``plain``: by areas that do not change.
        """
        structure = self.structure
        values = structure.start
        values[structure.grip] = grip
        found = [self.followed(values, run, held=True)[1] for run in self.runs]
        for run, of_run in zip(self.runs, found, strict=True):
            if not (self.held(run) or at_rest(self.data, run)):
                of_run[: round(WARMING * len(of_run))] = 0.0
        slopes = np.concatenate(found)
        slopes[:, :, structure.grip : structure.timing.stop] = 0.0
        for k in range(structure.n):
            slopes[:, :, structure.places("wall", k)] = 0.0
        mix = structure.free(moving=False, plain=plain)
        base = values.copy()
        for k in range(structure.n):  # on areas at rest of 1, loads are found instead
            base[structure.places("loads", k)] = 0.0
        weights = np.ones((1, structure.n))
        for _ in range(2):
            rows = slopes * weights[..., np.newaxis]
            flat = rows.reshape(-1, rows.shape[2])
            values = self.solved(
                flat @ mix, -(flat @ base), base, mix, np.zeros(mix.shape[1]), self.ridge
            )
            weights = 1.0 / self.stiffness(values)
        if structure.in_newtons:
            forces = slice(structure.slices["damping"].start, structure.slices["loads"].stop)
            load = values[structure.places("loads", 0)[0]]
            values[forces] /= load
            values[structure.timing.stop : structure.starts] /= load
        return values

    def loads_told(self, values: Array) -> bool:
        """Tell whether the linear stage found that a load pulls, and how much."""
        structure = self.structure
        area = float(values[structure.places("areas", 0)[0]])
        return not structure.in_newtons or area < 0.99 * structure.highest / LEAST_PULL

    def check_loads(self, values: Array, tracker: Tracker) -> None:
        """Refuse loads that seem to push where they should pull; note one that tells nothing.

        Raises
        ------
        DataError
            Naming the recording, or that it is all of them.
        """
        if self.loads_told(values):
            return
        channel = self.structure.loaded[0].name
        suspects = [tuple(range(len(self.runs))), *((place,) for place in range(len(self.runs)))]
        costs = []
        for suspect in suspects:
            turned = self.turned(suspect)
            found = turned.begun(float(values[self.structure.grip]))
            costs.append(turned.cost(found) if turned.loads_told(found) else np.inf)
        best = int(np.argmin(costs))
        if costs[best] < self.cost(values):
            names = [self.runs[place].name for place in suspects[best]]
            raise DataError(
                "the more it pulls, the shorter the muscle, as if its sign were wrong",
                file=names[0] if len(set(names)) == 1 else f"all {len(names)} recordings",
                channel=channel,
                remedy="give forces that pull the muscle longer as positive",
            )
        tracker.notes.append(
            f"{channel} hardly tells area from springs: all forces may be wrong by a factor. Remedy: "
            "record under loads that change while the pressure does not"
        )

    def turned(self, places: Sequence[int]) -> Search:
        """Return the same search with the loads of some runs turned round."""
        runs = list(self.runs)
        for place in places:
            scheduled = runs[place].scheduled.copy()
            scheduled[:, -1] *= -1.0
            runs[place] = replace(runs[place], scheduled=scheduled)
        other = Search(replace(self.data, runs=tuple(runs)), self.structure, self.ridge)
        other.span = self.span
        return other

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
        self,
        slopes: Array,
        target: Array,
        base: Array,
        mix: Array,
        prior: Array,
        damping: float,
    ) -> Array:
        """Return coefficients base + mix free with the least |slopes free - target| physics allows.

        Damped towards ``prior``, by every number's own effect, so that units do not matter; where it
        has none it stays. Springs are made stiff where they were found soft.
        """
        structure = self.structure
        size = np.sqrt((slopes**2).sum(axis=0))
        known = size > UNKNOWN * size.max()
        base = base + mix[:, ~known] @ prior[~known]
        slopes, mix, prior, size = slopes[:, known], mix[:, known], prior[known], size[known]
        triangle: Array = np.linalg.qr(np.column_stack([slopes, target]), mode="r")  # type: ignore[assignment]
        n_free, n = len(prior), structure.n
        held = np.maximum(np.sqrt(damping), LIGHTEST) * size
        system = np.zeros((len(triangle) + n_free + n, n_free + n))
        system[: len(triangle), :n_free] = triangle[:, :-1]
        system[len(triangle) :, :] = np.diag([*held, *np.full(n, 1e-6 * float(size.max()))])
        right = np.concatenate([triangle[:, -1], held * prior, np.zeros(n)])
        whole = np.zeros((len(base) + n, n_free + n))
        whole[: len(base), :n_free] = mix
        whole[len(base) :, n_free:] = np.eye(n)
        origin = np.append(base, np.zeros(n))
        sides, least = structure.conditions(base + mix @ prior)
        stiff = float(least[-1])
        for _ in range(MOST_CUTS):
            softened = [structure.spring_condition(x, way, stiff) for x, way in self.cuts]
            all_sides = np.vstack([sides, *(row for row, _ in softened)])
            all_least = np.append(least, [bound for _, bound in softened])
            on_free, missing = all_sides @ whole, all_least - all_sides @ origin
            asks = (on_free != 0).any(axis=1)  # not only of what stays
            free, _ = constrained_least_squares(system, right, on_free[asks], missing[asks])
            found = origin + whole @ free
            values, made_up = found[: len(base)], found[len(base) :]
            x, way, softest = structure.softest(values, made_up)
            if softest >= 0.5 * stiff:
                break
            self.cuts.append((x, way))
        return values

    def missed(self, values: Array, run: Run, *, whole: bool = False) -> tuple[Array, Array]:
        """Return the errors over a run relative to the ranges, and their slopes by coefficients.

        Of a run that does not begin at rest, and whose start is not found, the first part does not
        count, until it has forgotten, but where the ``whole`` is asked for.
        """
        if self.held(run):
            found, by = self.followed(values, run, held=True)
            areas = [values[self.structure.places("areas", k)[0]] for k in range(self.structure.n)]
            scale = 1.0 / (np.array(areas) * self.structure.highest)
        else:
            found, by = self.followed(values, run, held=False)
            found = found - self.measured(run)
            scale = 1.0 / self.span
        unsure = 0.0 if whole else self.unsure(run)
        counts = (np.arange(len(found)) >= unsure * len(found))[:, np.newaxis]
        by = by * (scale * counts)[..., np.newaxis]
        return (found * scale * counts).ravel(), by.reshape(-1, by.shape[2])

    def unlikely(self, values: Array) -> tuple[Array, Array]:
        """Return how far from rest the starts of runs are, as errors and slopes."""
        structure = self.structure
        places = np.arange(structure.starts, structure.size)
        scale = np.full((structure.n_starts, structure.n, 1 + structure.lags.size), UNLIKELY)
        scale[:, :, 1:] /= self.span[:, np.newaxis]
        slopes = np.zeros((places.size, structure.size))
        slopes[np.arange(places.size), places] = scale.ravel()
        return scale.ravel() * values[places], slopes

    def unsure(self, run: Run) -> float:
        """Return the share of a run in which it still remembers what came before it, unknown."""
        known = self.structure.n_starts or self.held(run) or at_rest(self.data, run)
        return 0.0 if known else WARMING

    def errors(self, values: Array, *, whole: bool = False) -> tuple[Array, Array]:
        """Return the errors over all runs, and their slopes."""
        missed = (self.missed(values, run, whole=whole) for run in self.runs)
        errors, slopes = zip(*missed, self.unlikely(values), strict=True)
        return np.concatenate(errors), np.concatenate(slopes)

    def covariance(self, values: Array) -> tuple[float, Array]:
        """Return the condition of what is free, and the covariance of all coefficients.

        As if errors were independent; NaN of what is fixed, or what the runs do not determine.
        """
        mix = self.structure.free(moving=True)
        errors, slopes = self.errors(values)
        moving = slopes @ mix
        size = np.maximum(np.sqrt((moving**2).sum(axis=0)), 1e-12)
        condition, own = inverted(moving / size)
        n_free = errors.size * self.every - mix.shape[1]
        variance = float(errors @ errors) / max(
            n_free, 1
        )  # of all samples, of which some are looked at
        scaled = mix / size
        told = np.isfinite(np.diag(own))
        covariance = variance * scaled[:, told] @ own[np.ix_(told, told)] @ scaled[:, told].T
        lost = ~mix.any(axis=1) | mix[:, ~told].any(axis=1)
        covariance[lost] = covariance[:, lost] = np.nan
        return condition, covariance

    def gain_of_loads(self, values: Array) -> float:
        """Return by how much loads, found last, would lessen the errors, were these straight."""
        structure = self.structure
        errors, slopes = self.errors(values)
        usable = np.isfinite(slopes).all(axis=1)
        own = slopes[usable][:, structure.timing.stop :]
        others = slopes[usable] @ structure.free(moving=True)[:, : -own.shape[1]]
        left = []
        for columns in (others, np.hstack([others, own])):
            size = np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-300)
            found = np.linalg.lstsq(columns / size, errors[usable], rcond=1e-6)[0]
            left.append(_size(errors[usable] - columns / size @ found))
        return 1.0 - left[1] / left[0]

    def cost(self, values: Array, *, whole: bool = False) -> float:
        """Return the root mean square of the errors, or of those over ``whole`` runs."""
        found = _size(self.errors(values, whole=whole)[0])
        return found if np.isfinite(found) else np.inf

    def descend(self, values: Array, steps: int, tracker: Tracker) -> None:
        """Show a tracker ever better coefficients."""
        mix = self.structure.free(moving=True)
        damping = 1e-3
        errors, slopes = self.errors(values)
        cost = _size(errors)
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
                found = _size(tried_errors)
                if found < cost:
                    break
                damping = max(10.0 * damping, 1e-9)
            else:
                return
            gained = (cost - found) / cost
            values, errors, slopes, cost = tried, tried_errors, tried_slopes, found
            tracker.saw(values, cost)
            damping = max(damping / 5.0, LIGHTEST**2)
            slow = slow + 1 if gained < 1e-3 else 0
            if slow >= 3:
                return


def _size(errors: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(errors**2)))
