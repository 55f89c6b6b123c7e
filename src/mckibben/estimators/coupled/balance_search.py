"""Descent of a force balance: Gauss-Newton steps on free-running errors, within what physics asks.

Besides the errors of the runs there are those of what is likely: every term is none, give or take its
natural scale, weighed by the noise of independent errors. So what data do not determine stays small, and
nothing depends on the last bit of the data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, Mask
from mckibben.blocks.coupled.balance_terms import Indices
from mckibben.estimators.coupled.balance_prior import PriorErrors
from mckibben.estimators.coupled.balance_problem import Problem, solve_stiff
from mckibben.estimators.coupled.balance_structure import Structure
from mckibben.numerics.descent import FIRST_DAMPING, LIGHTEST, levenberg_marquardt, triangle_of
from mckibben.numerics.least_squares import solve_constrained
from mckibben.numerics.statistics import autoregression, rms
from mckibben.numerics.tracker import Tracker

UNKNOWN = 1e-10
"""Effect of a parameter, relative to the largest, that counts as none."""

FAR = 0.5
"""Largest change of a nonlinear parameter per step, relative to its scale."""

FIRST_NOISE, LEAST_NOISE = 0.01, 1e-5
"""Standard deviation of independent errors at first, and the smallest, relative to ranges."""


@dataclass
class Search:
    """Unknowns z: of a structure's terms, and loads of recordings.

    Parameters
    ----------
    problem : Problem
    structure : Structure
    active : array of bool
        Which terms are free; others are what they begin with.
    prior : PriorErrors, optional
        Of a data sheet.
    noise : float
        Standard deviation of the runs' errors, as if they were independent: what is one natural scale
        from likely costs as much.
    """

    problem: Problem
    structure: Structure
    active: Mask
    prior: PriorErrors | None = None
    noise: float = FIRST_NOISE

    def errors(self, z: Array, wanted: Mask | None = None) -> tuple[Array, Array]:
        """Return all residuals, and the requested derivatives; last those of what is likely."""
        parts, slopes = self.problem.errors(self.structure, z, wanted)
        n = len(self.structure.terms)
        doubts = self.noise * self.structure.doubts(known=self.prior is not None)
        doubts = np.append(doubts, np.zeros(z.size - n))  # loads of recordings are any
        far, by = [doubts * (z - self.none(z))], [np.diag(doubts)]
        if self.prior is not None:
            of_sheet = self.prior.errors(self.structure, z, wanted)
            far.append(self.noise * of_sheet[0])
            by.append(self.noise * np.pad(of_sheet[1], ((0, 0), (0, z.size - n))))
        errors = np.concatenate([*parts, *far])
        if wanted is None:
            return errors, np.zeros((0, z.size))
        return errors, np.concatenate([slopes, *by])

    def none(self, z: Array) -> Array:
        """Return the unknowns of a balance in which no term has an effect."""
        return np.append(self.structure.none, np.zeros(z.size - self.active.size))

    def without(self, z: Array) -> Array:
        """Return the unknowns with all terms that are not free at none."""
        free = np.append(self.active, np.ones(z.size - self.active.size, dtype=bool))
        return np.where(free, z, self.none(z))

    def weighed(self, z: Array) -> Search:
        """Return the search with the noise of independent errors that the runs show."""
        variance, count, independent = self.independent(z)
        noise = float(np.sqrt(variance * count / independent))
        return replace(self, noise=max(noise, LEAST_NOISE))

    def independent(self, z: Array) -> tuple[float, int, float]:
        """Return the variance of the runs' errors, their number, and that of independent ones."""
        parts = self.problem.errors(self.structure, z)[0]
        model, count = autoregression(parts), sum(part.size for part in parts)
        return model.variance, count, model.effective_sample_size(count)

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

        return levenberg_marquardt(errors, self.solved, z, steps, tracker.update)

    def triangle(self, z: Array) -> Array:
        """Return the triangle of the derivatives by what is free, and of the errors."""
        found, slopes = self.errors(z, self.active)
        return triangle_of(slopes[:, self.free], found)

    def ahead(self, z: Array, options: list[Mask]) -> list[float]:
        """Return the cost that a linear model expects of every choice of terms."""
        every = replace(self, active=np.any(options, axis=0))
        triangle, count, expected = every.triangle(z), self.errors(z)[0].size, []
        for active in options:
            one = replace(self, active=active)
            places = np.searchsorted(every.free, one.free)
            moved = one.solved(triangle[:, np.append(places, -1)], z, FIRST_DAMPING)
            left = triangle[:, -1] + triangle[:, places] @ (moved - z)[one.free]
            expected.append(float(np.sqrt(left @ left / count)))
        return expected

    def solved(self, triangle: Array, z: Array, damping: float) -> Array:
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
        physics = structure.constraints(structure.expanded(z))
        on_all, least = self._of_all(*physics, z.size)
        low, high, much = structure.nonlinear_bounds()
        shape, far = z[n:n_terms], FAR * much
        bounds = np.append(np.maximum(low, shape - far), -np.minimum(high, shape + far))
        one = np.eye(z.size)[n:n_terms]
        return np.concatenate([on_all, one, -one]), np.concatenate([least, bounds])

    def _of_all(self, sides: Array, least: Array, size: int) -> tuple[Array, Array]:
        """Return constraints of linear coefficients as those of all unknowns."""
        on_all = np.zeros((len(sides), size))
        on_all[:, : self.structure.mix.shape[1]] = sides @ self.structure.mix
        return on_all, least - sides @ self.structure.base
