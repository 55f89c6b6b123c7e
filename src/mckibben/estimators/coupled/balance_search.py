"""The search for a balance of forces: least squares of its forces, then descent of its free run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import polynomial

from mckibben.arrays import Array
from mckibben.errors import ModelError
from mckibben.estimators.core.data import Mask, Run, TrainingData
from mckibben.estimators.core.uncertainty import inverted
from mckibben.estimators.coupled.balance_checks import at_rest, held
from mckibben.estimators.coupled.balance_slopes import run as follow
from mckibben.estimators.coupled.balance_structure import Structure
from mckibben.estimators.optimisers.constrained import constrained_least_squares
from mckibben.estimators.optimisers.tracker import Tracker

if TYPE_CHECKING:
    from mckibben.estimators.coupled.balance_prior import Belief

MOST_ROWS = 12_000
"""Errors to learn from; more are thinned evenly."""

STRAIGHT = 0.01
"""What pressures may be off a straight line, relative to the highest."""

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
"""Effect of a number's size, relative to the largest of any, that is none."""


class Search:
    """Coefficients that make the free run follow the recordings.

    Parameters
    ----------
    data : TrainingData
    structure : Structure
    ridge : float
        Damping.
    belief : Belief, optional
        What is likely before.
    """

    def __init__(
        self,
        data: TrainingData,
        structure: Structure,
        ridge: float,
        belief: Belief | None = None,
    ) -> None:
        self.data, self.structure, self.ridge, self.belief = data, structure, ridge, belief
        loads = {channel.name for channel in structure.loaded}
        order = [i for i, c in enumerate(data.scheduled) if c.name not in loads]
        order += [i for i, c in enumerate(data.scheduled) if c.name in loads]
        self.runs = [replace(run, scheduled=run.scheduled[:, order]) for run in data.runs]
        self.span = data.travel
        n_rows = sum(len(run.outputs) for run in self.runs) * structure.n
        self.n_rows = n_rows
        self.every = max(1, n_rows // MOST_ROWS)
        self.cuts: list[tuple[Array, Array]] = []
        self.still = [bool(structure.loaded) and held(data, run) for run in self.runs]
        self.resting = [at_rest(data, run) for run in self.runs]
        self.warming = [
            0.0 if still or resting else WARMING
            for still, resting in zip(self.still, self.resting, strict=True)
        ]

    def having(self, data: TrainingData | None = None, **changed: Any) -> Search:
        """Return the same search over other data of the same ranges, or with a changed structure."""
        structure = replace(self.structure, **changed) if changed else self.structure
        found = Search(data or self.data, structure, self.ridge, self.belief)
        found.span = self.span
        return found

    def of_few(self, most: int) -> Search:
        """Return the same search over fewer samples, where there are very many.

        Those are thinned where inputs go straight between them; else recordings are chosen evenly.
        """
        total = sum(len(run.outputs) for run in self.runs)
        if total <= most:
            return self
        every = -(-total // most)
        while not self._straight(every):
            every //= 2
        count = max(min(most * every * len(self.runs) // total, len(self.runs)), 1)
        chosen = np.unique(np.linspace(0, len(self.runs) - 1, count).round().astype(int))
        runs = tuple(self.data.runs[i].thinned(every) for i in chosen.tolist())
        found = self.having(replace(self.data, runs=runs))
        found.cuts = self.cuts
        return found

    def _straight(self, every: int) -> bool:
        """Tell whether pressures go straight between every so many samples."""
        missed = []
        for run in self.runs:
            t = np.arange(len(run.driven))
            for column in run.driven.T:
                missed.append(np.interp(t, t[::every], column[::every]) - column)
        return _size(np.concatenate(missed)) <= STRAIGHT * self.structure.highest

    def followed(
        self, values: Array, place: int, *, held: bool, sloped: bool = True
    ) -> tuple[Array, Array]:
        """Return displacements of a run, or forces that are lacking, and their slopes."""
        structure, run, own = self.structure, self.runs[place], self.structure.own
        load = own.load(run.recording)
        if load.size:
            values = values.copy()
            values[structure.constants] += values[load]
        begun, by = own.begun(values, run.place, structure.grip, run.driven[0])
        if held:
            begun = begun[:0]
        found, slopes = follow(
            structure.block(values).coefficients(run.sample_time or 1.0),
            np.ascontiguousarray(run.driven),
            np.ascontiguousarray(run.outputs),
            np.ascontiguousarray(run.scheduled),
            held=held,
            every=self.every,
            settled=self.still[place] or (held and self.resting[place] and not structure.tare),
            sloped=sloped,
            begun=begun,
        )
        if structure.size == own.first or not sloped:
            return found, slopes
        whole = np.zeros((*slopes.shape[:2], structure.size))
        whole[..., : own.first] = slopes[..., : own.first]
        whole[..., load] = slopes[..., structure.constants[: load.size]]
        if begun.size:
            whole += slopes[..., own.first :] @ by
        return found, whole

    def compared(self, run: Run) -> tuple[Array, Mask]:
        """Return the displacements that are compared, and which of them count."""
        n = len(run.outputs)
        kept = np.arange(-(-n // self.every)) * self.every + self.every - 1
        kept = np.minimum(kept, n - 1)
        return run.outputs[kept], run.counts[kept]

    def begun(self, grip: float, *, plain: bool = False) -> Array:
        """Return coefficients that balance the forces where the muscles were.

        ``plain``: by areas that do not change.
        """
        structure = self.structure
        values = structure.start
        values[structure.grip] = grip
        found = [self.followed(values, place, held=True)[1] for place in range(len(self.runs))]
        for run, unsure, of_run in zip(self.runs, self.warming, found, strict=True):
            of_run[: round(unsure * len(of_run))] = 0.0
            of_run[~self.compared(run)[1]] = 0.0
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
            triangle = _triangle(flat @ mix, -(flat @ base))
            values = self.solved(triangle, base, mix, np.zeros(mix.shape[1]), self.ridge)
            weights = 1.0 / self.stiffness(values)
        if structure.in_newtons:
            forces = slice(structure.slices["damping"].start, structure.slices["loads"].stop)
            load = values[structure.places("loads", 0)[0]]
            values[forces] /= load
            values[structure.own.first : structure.own.starts] /= load
        return values

    def slackened(self, values: Array, share: float) -> Array:
        """Return coefficients by which muscles go slack at a share of the most they resist with."""
        structure, values = self.structure, values.copy()
        for k in range(structure.n):
            springs = values[structure.places("springs", k)].reshape(-1, 1 + structure.n)
            most = 0.0
            for run in self.runs:
                x, loads = np.split(run.scheduled, [len(structure.scheduled)], axis=1)
                around = np.column_stack([np.ones(len(x)), run.outputs])
                pulled = ((structure.powers(x.T).T @ springs) * around).sum(axis=1)
                pulled += loads @ values[structure.places("loads", k)]
                most = max(most, -float(pulled.min()))
            values[structure.places("push", k)] = share * most
        return values

    def stiffness(self, values: Array) -> Array:
        """Return how stiff every muscle is at every sample kept, shape (samples, n)."""
        structure, found = self.structure, []
        for run in self.runs:
            y = self.compared(run)[0]
            u = y / structure.scale
            x = run.scheduled[:: self.every, : len(structure.scheduled)]
            p = run.driven[:: self.every]
            powers = structure.powers(x.T)
            own = np.empty_like(u)
            for k in range(structure.n):
                springs = values[structure.places("springs", k)].reshape(-1, 1 + structure.n)
                elastic = values[structure.places("elasticity", k)]
                areas = values[structure.places("areas", k)]
                slope = polynomial.polyder([0.0, 0.0, *elastic]) / structure.scale
                narrowing = polynomial.polyder(areas) / structure.scale
                own[:, k] = springs[:, 1 + k] @ powers + polynomial.polyval(u[:, k], slope)
                own[:, k] -= p[:, k] * polynomial.polyval(u[:, k], narrowing)
                own[:, k] += values[structure.places("bladder", k)[0]]
                own[:, k] += 0.3 * values[structure.places("friction", k)].sum()
            found.append(own)
        table = np.concatenate(found)
        return np.maximum(table, 0.1 * np.median(np.abs(table), axis=0))

    def solved(
        self, triangle: Array, base: Array, mix: Array, prior: Array, damping: float
    ) -> Array:
        """Return coefficients base + mix free with the least |slopes free - target| physics allows.

        ``triangle`` is that of slopes and target. Damped towards ``prior``, by every number's own
        effect, so that units do not matter; where it has none it stays. Springs are made stiff where
        they were found soft.
        """
        structure = self.structure
        size = np.sqrt((triangle[:, :-1] ** 2).sum(axis=0))
        effect = size * (mix.T @ structure.sizes(base + mix @ prior)) / mix.sum(axis=0)
        known = effect > UNKNOWN * effect.max()
        base = base + mix[:, ~known] @ prior[~known]
        triangle = triangle[:, np.append(known, True)]
        mix, prior, size = mix[:, known], prior[known], size[known]
        held = np.maximum(np.sqrt(damping), LIGHTEST) * size
        system = np.vstack([triangle[:, :-1], np.diag(held)])
        right = np.concatenate([triangle[:, -1], held * prior])
        sides, least = structure.conditions(base + mix @ prior)
        stiff = float(least[-1])
        for _ in range(MOST_CUTS):
            softened = [structure.spring_condition(x, way, stiff) for x, way in self.cuts]
            all_sides = np.vstack([sides, *(row for row, _ in softened)])
            all_least = np.append(least, [bound for _, bound in softened])
            on_free, missing = all_sides @ mix, all_least - all_sides @ base
            asks = (on_free != 0).any(axis=1)  # not only of what stays
            free, _ = constrained_least_squares(system, right, on_free[asks], missing[asks])
            values = base + mix @ free
            x, way, softest = structure.softest(values)
            if softest >= 0.5 * stiff:
                break
            self.cuts.append((x, way))
        return values

    def missed(
        self, values: Array, place: int, *, sloped: bool = True, whole: bool = False
    ) -> tuple[Array, Array]:
        """Return the errors over a run relative to the ranges, and their slopes by coefficients.

        Of a run that begins in an unknown state, that is not found, the first part does not count, until
        it has forgotten, but where the ``whole`` is asked for.
        """
        still, (measured, counts) = self.still[place], self.compared(self.runs[place])
        found, by = self.followed(values, place, held=still, sloped=sloped)
        if still:
            areas = [values[self.structure.places("areas", k)[0]] for k in range(self.structure.n)]
            scale = 1.0 / (np.array(areas) * self.structure.highest)
        else:
            found = found - measured
            scale = 1.0 / self.span
        known = whole or self.structure.settled or self.structure.n_starts
        unsure = 0.0 if known else self.warming[place]
        counts &= np.arange(len(found)) >= unsure * len(found)
        weights = scale * counts[:, np.newaxis]
        by *= weights[..., np.newaxis]
        return (found * weights).ravel(), by.reshape(found.size, by.shape[2])

    def unlikely(self, values: Array) -> tuple[Array, Array]:
        """Return how far from rest the starts of runs are, as errors and slopes."""
        structure = self.structure
        places = np.arange(structure.own.starts, structure.size)
        scale = np.full((structure.n_starts, structure.n, 1 + structure.lags.size), UNLIKELY)
        scale[:, :, 1:] /= self.span[:, np.newaxis]
        slopes = np.zeros((places.size, structure.size))
        slopes[np.arange(places.size), places] = scale.ravel()
        return scale.ravel() * values[places], slopes

    def errors(
        self, values: Array, *, sloped: bool = True, whole: bool = False
    ) -> tuple[Array, Array]:
        """Return the errors over all runs, and their slopes, of no columns if not wanted."""
        of_runs = [
            self.missed(values, place, sloped=sloped, whole=whole)
            for place in range(len(self.runs))
        ]
        if self.structure.n_starts:
            far, by = self.unlikely(values)
            of_runs.append((far, by if sloped else by[:, :0]))
        if self.belief is not None:
            far, by = self.belief.errors(self.structure, values)
            of_runs.append((far, by if sloped else by[:, :0]))
        errors, slopes = zip(*of_runs, strict=True)
        return np.concatenate(errors), np.concatenate(slopes)

    def covariance(self, values: Array) -> tuple[float, Array]:
        """Return the condition of what is free, and the covariance of all coefficients.

        As if errors were independent; NaN of what is fixed, or what the runs do not determine.
        """
        mix = self.structure.free(moving=True)
        if not self.structure.slack:  # bladders cannot be told from springs
            bladders = [
                int(self.structure.places("bladder", k)[0]) for k in range(self.structure.n)
            ]
            mix = mix[:, ~mix[bladders].any(axis=0)]
        errors, slopes = self.errors(values)
        moving = slopes @ mix
        size = np.maximum(np.sqrt((moving**2).sum(axis=0)), 1e-300)
        condition, own = inverted(moving / size)
        n_free = errors.size * self.every - mix.shape[1]
        # of all samples, of which some are looked at
        variance = float(errors @ errors) / max(n_free, 1)
        scaled = mix / size
        told = np.isfinite(np.diag(own))
        covariance = variance * scaled[:, told] @ own[np.ix_(told, told)] @ scaled[:, told].T
        lost = ~mix.any(axis=1) | mix[:, ~told].any(axis=1)
        covariance[lost] = covariance[:, lost] = np.nan
        return condition, covariance

    def cost(self, values: Array, *, whole: bool = False) -> float:
        """Return the root mean square of the errors, or of those over ``whole`` runs."""
        found = _size(self.errors(values, sloped=False, whole=whole)[0])
        return found if np.isfinite(found) else np.inf

    def descend(self, values: Array, steps: int, tracker: Tracker, *, first: bool = False) -> None:
        """Show a tracker ever better coefficients; at ``first`` walls and lags stay what they are."""
        mix = self.structure.free(moving=True, first=first)
        damping = 1e-3
        errors, slopes = self.errors(values)
        cost = _size(errors)
        slow = 0
        for _ in range(steps):
            moving = slopes @ mix
            usable = np.isfinite(moving).all(axis=1)
            now = mix.T @ values / mix.sum(axis=0)
            base = values - mix @ now
            moving, errors = moving[usable], errors[usable]
            triangle = _triangle(moving, moving @ now - errors)
            for number in range(MOST_TRIES):
                try:
                    tried = self.solved(triangle, base, mix, now, damping)
                except ModelError:
                    damping = max(10.0 * damping, 1e-9)
                    continue
                # most first tries are good, so that slopes are found at once
                errors, slopes = self.errors(tried, sloped=number == 0)
                found = _size(errors)
                if found < cost:
                    if number:
                        errors, slopes = self.errors(tried)
                    break
                damping = max(10.0 * damping, 1e-9)
            else:
                return
            gained = (cost - found) / cost
            values, cost = tried, found
            tracker.saw(values, cost)
            damping = max(damping / 5.0, LIGHTEST**2)
            slow = slow + 1 if gained < 1e-3 else 0
            if slow >= 3:
                return


def _triangle(slopes: Array, target: Array) -> Array:
    """Return the triangle that has all that least squares of slopes and target ask of both."""
    return np.linalg.qr(np.column_stack([slopes, target]), mode="r")  # type: ignore[return-value]


def _size(errors: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(errors**2)))
