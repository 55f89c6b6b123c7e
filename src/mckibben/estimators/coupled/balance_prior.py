"""What is likely of a muscle, weighed against what its recordings tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import InstanceOf

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.errors import ModelError
from mckibben.estimators.coupled.balance_structure import Bench, Structure
from mckibben.muscles.prior import Prior, prior_of
from mckibben.muscles.sheet import Sheet
from mckibben.muscles.traits import TIMES, traits

STEP = 1e-5
"""Change of a number, relative to what is much of it, by which traits' slopes are found."""

FIRST_NOISE = 0.01
"""Error relative to the range, of independent samples, before any is known."""

ZERO_STEPS = 6
"""To where displacements are likely to count from."""

LAGS = 1.0, 30.0
"""First and last time constant that may be [s], whatever the recordings' length."""

Told = str | Path | Sheet | InstanceOf[Prior] | None
"""What a prior may be given as: a muscle's name, a file, a data sheet (as a mapping, too), or itself."""


@dataclass(frozen=True)
class Belief:
    """A prior as errors beside those of recordings.

    Parameters
    ----------
    prior : Prior
    noise : float
        Of the recordings' errors, relative to the range, were there as many independent ones: by it a
        deviation of one from the prior is as bad as one from the recordings.
    """

    prior: Prior
    noise: float = FIRST_NOISE

    @cached_property
    def weights(self) -> Array:
        """Rows that make independent numbers of traits."""
        return self.prior.weights()

    def errors(self, structure: Structure, z: Array) -> tuple[Array, Array]:
        """Return how far terms are from what is likely, and the slopes, shape (traits, terms).

        Where displacements count from is as likely makes them most so (variable projection).
        """
        sheet, weights, unsure = self.prior.sheet, self.noise * self.weights, self.prior.zero
        n = len(structure.terms)

        def away(free: Array, zero: float) -> Array:
            found = traits(self._block(structure, free), sheet, zero) - self.prior.mean
            told = np.where(np.isfinite(found), found, 0.0)
            return np.append(weights @ told, self.noise * zero / unsure)

        zero, by_zero, terms = 0.0, np.zeros(1), z[:n]
        for _ in range(ZERO_STEPS):
            now = away(terms, zero)
            by_zero = (away(terms, zero + STEP * unsure) - now) / (STEP * unsure)
            step = -float(by_zero @ now) / float(by_zero @ by_zero)
            zero += min(max(step, -unsure), unsure)
        now = away(terms, zero)
        slopes = np.zeros((now.size, n))
        for place, much in enumerate(structure.scales().tolist()):
            if structure.terms[place].kind in ("pushes", "places", "filling", "venting", "dead"):
                continue
            moved = terms.copy()
            moved[place] += STEP * much
            slopes[:, place] = (away(moved, zero) - now) / (STEP * much)
        slopes -= np.outer(by_zero, by_zero @ slopes) / float(by_zero @ by_zero)
        return now, slopes

    @staticmethod
    def _block(structure: Structure, free: Array) -> Balance:
        return structure.block(structure.expanded(free))


def told_by(given: Any) -> Prior:
    """Return a prior, or that of a muscle's name, a file or a data sheet."""
    if isinstance(given, Prior):
        return given
    return prior_of(Sheet(**given) if isinstance(given, Mapping) else given)


def believed(bench: Bench, given: Any) -> tuple[Bench, Belief]:
    """Return a bench that covers all that the muscle can do, recorded or not, and what is likely.

    Raises
    ------
    ModelError
        Of several muscles, or one that something else than a load schedules.
    """
    if len(bench.given) != 1 or bench.scheduled:
        raise ModelError(
            "a prior is of one muscle under its load alone. Remedy: leave prior out for several "
            "muscles, or where something schedules them"
        )
    prior = told_by(given)
    shortest, longest = bench.lag_range
    return replace(
        bench,
        hull=np.array([[bench.hull[0, 0], max(bench.hull[0, 1], prior.sheet.stroke)]]),
        highest=max(bench.highest, prior.sheet.max_pressure_bar),
        lag_range=(min(shortest, LAGS[0]), max(longest, TIMES[-1])),
    ), Belief(prior)


def noise_of(errors: list[Array]) -> float:
    """Return the noise of runs' errors as if of independent samples: that of their sums.

    Errors that stay alike over many samples tell no more than as many fewer.
    """
    power = sum(float(e @ e) for e in errors)
    count = sum(e.size for e in errors)
    alike = 1.0
    longest = max(e.size for e in errors) // 2
    for lag in range(1, longest):
        shared = sum(float(e[lag:] @ e[:-lag]) for e in errors if e.size > lag) / power
        if shared <= 0.0:
            break
        alike += 2.0 * shared
    return float(np.sqrt(power / count * alike))
