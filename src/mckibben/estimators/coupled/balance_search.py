"""Descent of a force balance: Gauss-Newton steps on free-running errors, within what physics asks.

Besides the errors of the runs there are those of what is likely: every term is none, give or take its
natural scale, weighed by the noise of independent errors. So what data do not determine stays small, and
nothing depends on the last bit of the data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, Mask
from mckibben.estimators.coupled.balance_prior import PriorErrors
from mckibben.estimators.coupled.balance_problem import Problem, solve_stiff
from mckibben.estimators.coupled.balance_structure import Structure
from mckibben.numerics.descent import FIRST_DAMPING, LIGHTEST, levenberg_marquardt, triangle_of
from mckibben.numerics.least_squares import solve_constrained
from mckibben.numerics.statistics import autoregression, rms
from mckibben.numerics.tracker import Tracker

UNKNOWN = 1e-10
"""Effect of a parameter, relative to the largest, that counts as none."""

LONGEST_STEP = 0.5
"""Largest change of a nonlinear parameter per step, relative to its scale."""

FIRST_NOISE, LEAST_NOISE = 0.01, 1e-5
"""Standard deviation of independent errors at first, and the smallest, relative to ranges."""


@dataclass(frozen=True, eq=False)
class Search:
    """A point of a search for the unknowns: of a structure's terms, and loads of recordings.

    Parameters
    ----------
    problem : Problem
    structure : Structure
    active : array of bool
        Which terms are free; others are what they begin with.
    z : array
        The unknowns at this point.
    prior : PriorErrors, optional
        Of a data sheet.
    noise : float
        Standard deviation of the runs' errors, as if they were independent: what is one natural scale
        from likely costs as much.
    """

    problem: Problem
    structure: Structure
    active: Mask
    z: Array
    prior: PriorErrors | None = None
    noise: float = FIRST_NOISE

    @cached_property
    def values(self) -> Array:
        """All parameters of the balance."""
        return self.structure.expanded(self.z)

    @cached_property
    def none(self) -> Array:
        """The unknowns of a balance in which no term has an effect."""
        return np.append(self.structure.none, np.zeros(self.z.size - self.active.size))

    @cached_property
    def free(self) -> NDArray[np.intp]:
        """Indices of the free unknowns."""
        others = np.ones(self.z.size - self.active.size, dtype=bool)
        return np.flatnonzero(np.append(self.active, others))

    # -- errors ----------------------------------------------------------------------------------

    def errors(self, z: Array, wanted: Mask | None = None) -> tuple[Array, Array]:
        """Return all residuals, and the requested derivatives; last those of what is likely."""
        parts, slopes = self.problem.errors(self.structure, z, wanted)
        far, by = self._prior_errors(z, wanted)
        errors = np.concatenate([*parts, *far])
        if wanted is None:
            return errors, np.zeros((0, z.size))
        return errors, np.concatenate([slopes, *by])

    def _prior_errors(
        self, z: Array, wanted: Mask | None = None
    ) -> tuple[list[Array], list[Array]]:
        """Return how far unknowns are from what is likely, and the derivatives."""
        far, by = [self._doubts * (z - self.none)], [np.diag(self._doubts)]
        if self.prior is not None:
            of_sheet = self.prior.errors(self.structure, z, wanted)
            rest = z.size - self.active.size
            far.append(self.noise * of_sheet[0])
            by.append(self.noise * np.pad(of_sheet[1], ((0, 0), (0, rest))))
        return far, by

    @cached_property
    def _doubts(self) -> Array:
        """How much less likely unknowns are, the further from none; loads of recordings are any."""
        of_terms = self.noise * self.structure.doubts(known=self.prior is not None)
        return np.append(of_terms, np.zeros(self.z.size - of_terms.size))

    @cached_property
    def _of_runs(self) -> list[Array]:
        """Errors of every run."""
        return self.problem.errors(self.structure, self.z)[0]

    @cached_property
    def cost(self) -> float:
        """Root mean square error."""
        return rms(np.concatenate([*self._of_runs, *self._prior_errors(self.z)[0]]))

    @cached_property
    def independent(self) -> float:
        """Number of independent errors of the runs."""
        count = sum(part.size for part in self._of_runs)
        return autoregression(self._of_runs).effective_sample_size(count)

    def weighed(self) -> Search:
        """Return the search with the noise of independent errors that the runs show."""
        squares = np.concatenate(self._of_runs) ** 2
        noise = float(np.sqrt(squares.mean() * squares.size / self.independent))
        return replace(self, noise=max(noise, LEAST_NOISE))

    # -- descent ---------------------------------------------------------------------------------

    def without(self, terms: Mask) -> Search:
        """Return the search without terms: they are none, and not free."""
        removed = np.append(terms, np.zeros(self.z.size - terms.size, dtype=bool))
        return replace(self, active=self.active & ~terms, z=np.where(removed, self.none, self.z))

    def narrowed(self) -> Search:
        """Return the search restricted to free terms."""
        structure, n = self.structure, len(self.structure.terms)
        free = set(compress(structure.keys, self.active))
        needed = structure.reduced(list(compress(structure.terms, self.active)))
        active = np.array([key in free for key in needed.keys])
        z = np.append(structure.transferred(needed, self.z[:n]), self.z[n:])
        return replace(self, structure=needed, active=active, z=z)

    def descend(self, steps: int, tracker: Tracker | None = None) -> Search:
        """Return the search after a descent in the free terms alone."""
        few = self.narrowed()

        def errors(z: Array, sloped: bool) -> tuple[Array, Array]:
            errors_now, slopes = few.errors(z, few.active if sloped else None)
            return errors_now, slopes[:, few.free]

        improved = (tracker or Tracker()).update
        z, n = levenberg_marquardt(errors, few.solved, few.z, steps, improved), few.active.size
        terms = few.structure.transferred(self.structure, z[:n], self.z)
        return replace(self, z=np.append(terms, z[n:]))

    def linearised(self) -> tuple[Array, int]:
        """Return the triangle of derivatives by what is free and of errors, and the number of these."""
        errors, slopes = self.errors(self.z, self.active)
        return triangle_of(slopes[:, self.free], errors), errors.size

    def ahead(self, options: list[Mask]) -> list[float]:
        """Return the cost that a linear model expects of every choice of terms."""
        widest = replace(self, active=np.any(options, axis=0))
        (triangle, count), expected = widest.linearised(), []
        for active in options:
            option = replace(self, active=active)
            places = np.searchsorted(widest.free, option.free)
            solution = option.solved(triangle[:, np.append(places, -1)], self.z, FIRST_DAMPING)
            remainder = triangle[:, -1] + triangle[:, places] @ (solution - self.z)[option.free]
            expected.append(float(np.sqrt(remainder @ remainder / count)))
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
        scales = np.append(structure.scales(), np.ones(z.size - self.active.size))[free]
        is_known = size * scales > UNKNOWN * (size * scales).max()
        free, reduced = free[is_known], triangle[:, np.append(is_known, True)]
        target = reduced[:, :-1] @ z[free] - reduced[:, -1]
        tried, fixed = z.copy(), np.setdiff1d(np.arange(z.size), free)

        def of_free(sides: Array, least: Array) -> tuple[Array, Array]:
            return sides[:, free], least - sides[:, fixed] @ z[fixed]

        def asked(sides: Array, least: Array) -> tuple[Array, Array]:
            return of_free(*self._of_all(sides, least, z.size))

        def put(solution: Array) -> Array:
            tried[free] = solution
            return structure.base + structure.mix @ tried[:n]

        ridge = max(damping, LIGHTEST)
        solve = partial(solve_constrained, reduced[:, :-1], target, ridge=ridge, near=z[free])
        solve_stiff(structure, solve, of_free(*self._conditions(z)), asked, put)
        return tried

    def _conditions(self, z: Array) -> tuple[Array, Array]:
        """Return linear constraints of all unknowns: sides @ z >= least."""
        structure = self.structure
        n, n_terms = structure.mix.shape[1], len(structure.terms)
        physics = structure.constraints(structure.expanded(z))
        on_all, least = self._of_all(*physics, z.size)
        low, high, much = structure.nonlinear_ranges
        shape, far = z[n:n_terms], LONGEST_STEP * much
        bounds = np.append(np.maximum(low, shape - far), -np.minimum(high, shape + far))
        identity = np.eye(z.size)[n:n_terms]
        return np.concatenate([on_all, identity, -identity]), np.concatenate([least, bounds])

    def _of_all(self, sides: Array, least: Array, size: int) -> tuple[Array, Array]:
        """Return constraints of linear coefficients as those of all unknowns."""
        on_all = np.zeros((len(sides), size))
        on_all[:, : self.structure.mix.shape[1]] = sides @ self.structure.mix
        return on_all, least - sides @ self.structure.base
