"""Search of a force balance: term selection and descent on free-running errors.

Terms are found by a forward search on the free run made straight: its slopes by everything that may be
free, what is not yet included, give by least squares the errors that any choice of terms would leave. A
choice is judged by blocks of time that are left out: terms are added while the error there falls by more
than its standard error over blocks. Then Gauss-Newton steps bring the terms chosen to where errors are
least, within what physics asks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress, pairwise

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, Mask
from mckibben.blocks.coupled.balance_terms import NONLINEAR, TABLE, Indices
from mckibben.estimators.coupled.balance_prior import LEAST_NOISE, PriorErrors
from mckibben.estimators.coupled.balance_problem import Problem, solve_stiff
from mckibben.estimators.coupled.balance_structure import Structure, Term
from mckibben.numerics.blocks import blocks_of, squared_errors, sums_of_others
from mckibben.numerics.descent import LIGHTEST, levenberg_marquardt
from mckibben.numerics.least_squares import solve_constrained, solve_products
from mckibben.numerics.statistics import autoregression, rms
from mckibben.numerics.tracker import Tracker

BLOCKS, FOLDS = 20, 5
"""Approximate number of blocks of all runs, and of cross-validation folds."""

DAMPED = 1e-2
"""Damping of the least squares whose errors are compared, relative to own effects."""

AHEAD = 4
"""Number of term groups that may be added before they, together, must reduce errors."""

UNKNOWN = 1e-10
"""Effect of a parameter, relative to the largest, that counts as none."""

FAR, LEAST_SEPARATION = 0.5, 0.7
"""Largest relative change per step; smallest difference of the logarithms of lags."""

NO_GAIN = 1e-6
"""Gain of a term, relative to the squared errors, that is rounding."""

DEVIATIONS = (("areas",), ("elasticity", "bladders"), ("friction",), ("relaxation", "damping"))
"""Kinds in which muscles may differ together."""

NEW_SHAPE = tuple(name for name in NONLINEAR if TABLE[name].option == name)
"""Nonlinear parameters that are added alone."""


@dataclass
class Search:
    """Unknowns z: of a structure's terms, and loads of recordings.

    Parameters
    ----------
    problem : Problem
    structure : Structure
    active : array of bool
        Which terms are free; others are what they begin with.
    prior_errors : PriorErrors, optional
    """

    problem: Problem
    structure: Structure
    active: Mask
    prior_errors: PriorErrors | None = None

    def errors(self, z: Array, wanted: Mask | None = None) -> tuple[Array, Array]:
        """Return all residuals, and the requested derivatives; those of the prior last."""
        parts, slopes = self.problem.errors(self.structure, z, wanted)
        errors = np.concatenate(parts) if parts else np.zeros(0)
        if self.prior_errors is None:
            return errors, slopes
        far, by = self.prior_errors.errors(self.structure, z, wanted)
        whole = np.zeros((len(by), slopes.shape[1]))
        whole[:, : by.shape[1]] = by
        return np.append(errors, far), np.concatenate([slopes, whole])

    def weighed(self, z: Array) -> Search:
        """Return the search with the prior weighted by the noise of independent errors."""
        if self.prior_errors is None:
            return self
        parts = self.problem.errors(self.structure, z)[0]
        model, count = autoregression(parts), sum(part.size for part in parts)
        noise = np.sqrt(model.variance * count / model.effective_sample_size(count))
        return replace(
            self, prior_errors=replace(self.prior_errors, noise=max(float(noise), LEAST_NOISE))
        )

    def cost(self, z: Array) -> float:
        """Return the root mean square error."""
        return rms(self.errors(z)[0])

    @property
    def free(self) -> NDArray[np.intp]:
        """Indices of the free unknowns."""
        rest = self.problem.size(self.structure) - self.active.size
        return np.flatnonzero(np.append(self.active, np.ones(rest, dtype=bool)))

    # -- descent ---------------------------------------------------------------------------------

    def narrowed(self, z: Array) -> tuple[Search, Array]:
        """Return the search restricted to free terms, and the unknowns."""
        structure, n = self.structure, len(self.structure.terms)
        free = set(compress(structure.keys, self.active))
        needed = structure.reduced(list(compress(structure.terms, self.active)))
        active = np.array([key in free for key in needed.keys])
        moved = np.append(structure.transferred(needed, z[:n]), z[n:])
        return replace(self, structure=needed, active=active), moved

    def descended(self, z: Array, steps: int, tracker: Tracker) -> Array:
        """Return the unknowns after a descent in the free terms."""
        few, narrow = self.narrowed(z)
        found, n = few.descend(narrow, steps, tracker), len(few.structure.terms)
        return np.append(few.structure.transferred(self.structure, found[:n], z), found[n:])

    def descend(self, z: Array, steps: int, tracker: Tracker) -> Array:
        """Descend, report improvements to a tracker, and return the best unknowns."""

        def errors(z: Array, sloped: bool) -> tuple[Array, Array]:
            found, slopes = self.errors(z, self.active if sloped else None)
            return found, slopes[:, self.free]

        return levenberg_marquardt(errors, self._solved, z, steps, tracker.update)

    def _solved(self, triangle: Array, z: Array, damping: float) -> Array:
        """Return the least-squares solution of the linearised problem within physical bounds.

        ``triangle`` is that of slopes and errors. Damped towards what they are, by every number's own
        effect, so that units do not matter; where it has none it stays. Springs are made stiff where
        they were found soft.
        """
        structure, free = self.structure, self.free
        n = structure.mix.shape[1]
        size = np.sqrt((triangle[:, :-1] ** 2).sum(axis=0))
        known = self._known(free, size)
        free, reduced = free[known], triangle[:, np.append(known, True)]
        target = reduced[:, :-1] @ z[free] - reduced[:, -1]
        tried, others = z.copy(), np.setdiff1d(np.arange(z.size), free)

        def of_free(sides: Array, least: Array) -> tuple[Array, Array]:
            return sides[:, free], least - sides[:, others] @ z[others]

        def asked(sides: Array, least: Array) -> tuple[Array, Array]:
            return of_free(*self._of_all(sides, least, z.size))

        def put(solution: Array) -> Array:
            tried[free] = solution
            return structure.base + structure.mix @ tried[:n]

        ridge = max(damping, LIGHTEST)
        solve = partial(solve_constrained, reduced[:, :-1], target, ridge=ridge, near=z[free])
        solve_stiff(structure, solve, of_free(*self._conditions(z)), asked, put)
        return tried

    def _known(self, free: Indices, size: Array) -> Mask:
        """Return which unknowns have an effect, by the sizes of slopes, that is not rounding."""
        scales = np.append(self.structure.scales(), np.ones(self.free[-1] + 1))[free]
        return np.asarray(size * scales > UNKNOWN * (size * scales).max())

    def _conditions(self, z: Array) -> tuple[Array, Array]:
        """Return linear constraints of all unknowns: sides @ z >= least."""
        structure = self.structure
        n, n_terms = structure.mix.shape[1], len(structure.terms)
        physics = structure.constraints(structure.expanded(z[:n_terms]))
        on_all, least = self._of_all(*physics, z.size)
        low, high, much = structure.nonlinear_bounds()
        shape, far = z[n:n_terms], FAR * much
        bounds = np.append(np.maximum(low, shape - far), -np.minimum(high, shape + far))
        lags = [i for i in np.flatnonzero(self.active) if structure.terms[i].kind == "lags"]
        one = np.eye(z.size)
        separations = np.array([one[j] - one[i] for i, j in pairwise(lags)])
        every = [on_all, one[n:n_terms], -one[n:n_terms], separations.reshape(-1, z.size)]
        asked = [least, bounds, np.full(len(separations), LEAST_SEPARATION)]
        return np.concatenate(every), np.concatenate(asked)

    def _of_all(self, sides: Array, least: Array, size: int) -> tuple[Array, Array]:
        """Return constraints of linear coefficients as those of all unknowns."""
        on_all = np.zeros((len(sides), size))
        on_all[:, : self.structure.mix.shape[1]] = sides @ self.structure.mix
        return on_all, least - sides @ self.structure.base

    # -- choice ----------------------------------------------------------------------------------

    def chosen(self, z: Array, *groups: Mask) -> tuple[Mask, Array]:
        """Return the selected terms after a forward search, and their unknowns.

        Over the first of ``groups`` of terms from which any are added. New shape begins where least
        squares have it.
        """
        structure, n = self.structure, len(self.structure.terms)
        new = np.array([term.kind in NEW_SHAPE for term in structure.terms]) & ~self.active
        wanted = (np.any(groups, axis=0) & new) | self.active
        (grams, folds), likely = self._grams(z, wanted, new), self._likely(z, wanted)
        others = sums_of_others(grams, folds) + likely
        bounded = np.append(structure.bounded, np.zeros(z.size - n, dtype=bool))
        known: dict[bytes, Array] = {}

        def missed(active: Mask) -> Array:
            """Return the squared errors of every block under the least squares of other folds."""
            if (key := active.tobytes()) not in known:
                free = np.append(active, np.ones(z.size - n, dtype=bool))
                theta = np.tile(z, (len(others), 1))
                theta[:, np.flatnonzero(free)] = _solved(others, free, bounded, z)
                known[key] = squared_errors(grams, theta[folds, :, np.newaxis])[:, 0]
            return known[key]

        active = self.active
        for tried in groups:
            best, ahead, passed = missed(active), active, 0
            while passed < AHEAD:
                options = [
                    ahead | more for more in self._candidates(ahead, z) if not (more & ~tried).any()
                ]
                if not options:
                    break
                errors = [missed(option) for option in options]
                first = int(np.argmin([one.sum() for one in errors]))
                ahead, gain = options[first], best - errors[first]
                passed += 1
                if gain.sum() > max(np.sqrt(gain.size) * gain.std(), NO_GAIN * best.sum()):
                    active, best, passed = ahead, errors[first], 0
            if (active != self.active).any():
                break
        free = np.append(active, np.ones(z.size - n, dtype=bool))
        solution, found = z.copy(), z.copy()
        solution[free] = _solved((grams.sum(axis=0) + likely)[np.newaxis], free, bounded, z)[0]
        low, high, much = structure.nonlinear_bounds()
        shape = slice(structure.mix.shape[1], n)
        near = np.clip(
            solution[shape], np.maximum(low, z[shape] - much), np.minimum(high, z[shape] + much)
        )
        found[shape] = np.where((active & new)[shape], near, z[shape])
        return active, found

    def improved(self, z: Array, other: Search, found: Array, by: float = 0.0) -> bool:
        """Return whether another search has significantly smaller errors over blocks."""
        before, after = self._by_block(z), other._by_block(found)
        gain = before - after
        least = max(np.sqrt(gain.size) * gain.std(), (1.0 - (1.0 - by) ** 2) * before.sum())
        return bool(gain.sum() > least)

    def _by_block(self, z: Array) -> Array:
        """Return the squared errors per block of time."""
        parts = self.problem.errors(self.structure, z)[0]
        return np.array(
            [float(block @ block) for part in blocks_of(parts, BLOCKS) for block in part]
        )

    def _grams(self, z: Array, wanted: Mask, new: Mask | None = None) -> tuple[Array, Indices]:
        """Return the products of derivatives and target, per block of time, and the folds of blocks.

        Each fold has a part of every run, so that it is not all that was measured under one condition;
        runs of few blocks begin with different folds.
        """
        parts, slopes = self.problem.errors(self.structure, z, wanted, new)
        table = np.column_stack([slopes, slopes @ z - np.concatenate(parts)])
        table[~np.isfinite(table).all(axis=1)] = 0.0
        size = np.sqrt((table[:, :-1] ** 2).sum(axis=0))
        table[:, :-1] *= self._known(np.arange(z.size), size)
        ends = np.cumsum([part.size for part in parts])[:-1]
        runs = blocks_of(np.split(table, ends), BLOCKS)
        folds = [
            (np.arange(len(run)) * FOLDS // len(run) + place) % FOLDS
            for place, run in enumerate(runs)
        ]
        grams = np.array([block.T @ block for run in runs for block in run])
        return grams, np.concatenate(folds)

    def _likely(self, z: Array, wanted: Mask) -> Array:
        """Return the products of the prior's derivatives and target."""
        table = np.zeros((1, z.size + 1))
        if self.prior_errors is not None:
            far, by = self.prior_errors.errors(self.structure, z, wanted)
            table = np.zeros((far.size, z.size + 1))
            table[:, : by.shape[1]] = by
            table[:, -1] = by @ z[: by.shape[1]] - far
        return np.asarray(table.T @ table)

    def _candidates(self, active: Mask, z: Array) -> Iterator[Mask]:
        """Yield candidate groups of terms beyond the active ones."""
        terms, structure = self.structure.terms, self.structure
        free = [term for term, there in zip(terms, active, strict=True) if there]
        on = {term[:2] for term in free}
        own = {term.kind for term in free if term.muscle}

        def group(*wanted: Term) -> Mask:
            return np.array([term in wanted for term in terms])

        for kind in ("elasticity", "areas"):
            following = max((which for name, which in on if name == kind), default=0) + 1
            for more in (1, 2):
                yield group(*self._with_own(kind, range(following, following + more), own))
        for kind, which, muscle in terms:
            if muscle is not None or (kind, which) in on:
                continue
            if kind in ("lines", "mass"):
                yield group(*self._with_own(kind, (which,), own))
            elif kind == "relaxation" and self._is_distinct(which, active, z):
                yield group(Term("lags", which), *self._with_own(kind, (which,), own))
        count = len(structure.obstacles)
        met = {structure.obstacles[which][0] for kind, which in on if kind == "obstacles"}
        for which, (side, _) in enumerate(structure.obstacles):
            if side not in met:
                places = (Term("places", which + j * count) for j in range(structure.m))
                yield group(Term("obstacles", which), *places)
        for kind in ("springs", "friction_slopes"):
            for which in dict.fromkeys(term.which for term in terms if term.kind == kind):
                if (kind, which) not in on:
                    yield group(Term(kind, which))
        ruled_out = {"friction_slopes", *(() if ("filling", 0) in on else ("venting",))}
        if {("dead", 0), ("contact", 0)} & on:
            ruled_out |= {"dead", "contact"}
        for kind in NEW_SHAPE:
            if (kind, 0) not in on and kind not in ruled_out:
                yield group(Term(kind))
        for kinds in DEVIATIONS if structure.n > 1 else ():
            if not own & set(kinds):
                whiches = [(kind, which) for kind, which in on if kind in kinds]
                whiches += [("areas", 0)] if "areas" in kinds else []
                yield group(*(Term(*one, k) for one in whiches for k in range(1, structure.n)))

    def _is_distinct(self, which: int, active: Mask, z: Array) -> bool:
        """Return whether a time constant is distinct from the free ones, and in order."""
        terms = self.structure.terms
        places = [place for place, term in enumerate(terms) if term.kind == "lags"]
        separations = (
            (z[i] - z[places[which]]) * np.sign(terms[i].which - which) for i in places if active[i]
        )
        return all(one > LEAST_SEPARATION for one in separations)

    def _with_own(self, kind: str, whiches: range | tuple[int, ...], own: set[str]) -> list[Term]:
        """Return terms of a kind, with differences between muscles if they are free."""
        muscles = [None, *(range(1, self.structure.n) if kind in own else ())]
        return [Term(kind, which, muscle) for which in whiches for muscle in muscles]


def _solved(grams: Array, free: Mask, bounded: Mask, z: Array) -> Array:
    """Return the least squares of free unknowns, others as they are, of every matrix in a stack.

    ``grams`` are products of slopes and target.
    """
    moving = np.flatnonzero(free)
    keep = np.append(moving, z.size)
    parts = grams[:, keep][:, :, keep]
    parts[:, :-1, -1] -= grams[:, moving] @ np.append(np.where(free, 0.0, z), 0.0)
    solve = partial(solve_products, bounded=bounded[free], near=z[free])
    return solve(parts, moving.size, DAMPED)[:, :, 0]
