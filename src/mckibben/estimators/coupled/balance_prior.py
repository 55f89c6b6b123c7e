"""What is likely of a muscle, weighed against what its recordings tell."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import InstanceOf

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.errors import ModelError
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_structure import Structure
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.muscles.prior import Prior, prior_of
from mckibben.muscles.sheet import Sheet
from mckibben.muscles.traits import TIMES, traits

STEP = 1e-5
"""Relative change of a coefficient by which traits' slopes are found."""

FIRST_NOISE = 0.01
"""Error relative to the range, of independent samples, before any is known."""

ZERO_STEPS = 6
"""To where displacements are likely to count from."""

REFINED = 3
"""Times that the noise is found anew."""

GRIP, TOWARDS = 0.1, 60
"""Where to begin, relative to the highest pressure, and most steps from there to what is likely."""

LAGS = 1.0, 30.0
"""First and last time constant to begin from [s], whatever the recordings' length."""


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

    def errors(self, structure: Structure, values: Array) -> tuple[Array, Array]:
        """Return how far coefficients are from what is likely, and the slopes.

        Where displacements count from is as likely makes them most so (variable projection).
        """
        sheet, weights = self.prior.sheet, self.noise * self.weights
        block = structure.block(values)
        unsure = self.prior.zero

        def away(balance: Balance, zero: float) -> Array:
            found = traits(balance, sheet, zero) - self.prior.mean
            return np.append(
                weights @ np.where(np.isfinite(found), found, 0.0), self.noise * zero / unsure
            )

        zero, by_zero = 0.0, np.zeros(1)
        for _ in range(ZERO_STEPS):
            now = away(block, zero)
            by_zero = (away(block, zero + STEP * unsure) - now) / (STEP * unsure)
            step = -float(by_zero @ now) / float(by_zero @ by_zero)
            zero += min(max(step, -unsure), unsure)
        now = away(block, zero)
        slopes = np.zeros((now.size, values.size))
        places = np.flatnonzero(structure.free(moving=True).any(axis=1))
        force = float(values[structure.places("areas", 0)[0]]) * structure.highest
        for place in places[places < structure.own.first].tolist():
            moved = values.copy()
            step = STEP * max(abs(values[place]), 1e-3 * force)
            moved[place] += step
            slopes[:, place] = (away(structure.block(moved), zero) - now) / step
        slopes -= np.outer(by_zero, by_zero @ slopes) / float(by_zero @ by_zero)
        return now, slopes


def likely(search: Search) -> Array:
    """Return the coefficients that are likely before, under the constant force the recordings ask."""
    structure, belief = search.structure, search.belief
    assert belief is not None
    alone, found = copy(search), Tracker()
    alone.runs = []
    values = structure.start
    values[structure.grip] = GRIP * structure.highest
    if structure.in_newtons:
        values[structure.places("areas", 0)[0]] = belief.prior.sheet.area
    found.saw(values, alone.cost(values))
    alone.descend(values, TOWARDS, found)
    assert found.best is not None
    values = found.best
    if not structure.in_newtons:
        lacking = [search.followed(values, i, held=True)[0] for i in range(len(search.runs))]
        values[structure.constants] -= np.concatenate(lacking).mean(axis=0)
    return values


def refined(search: Search, tracker: Tracker, steps: int) -> Search:
    """Show a tracker where its best leads as the noise gets known; return the search with that."""
    for _ in range(REFINED):
        assert tracker.best is not None
        values, belief = tracker.best, search.belief
        assert belief is not None
        runs = range(len(search.runs))
        noise = noise_of([search.missed(values, place, sloped=False)[0] for place in runs])
        search = copy(search)
        search.belief = replace(belief, noise=noise)
        tracker.best_cost = search.cost(values)
        search.descend(values, steps, tracker)
    return search


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


Told = str | Path | Sheet | InstanceOf[Prior] | None
"""What a prior may be given as: a muscle's name, a file, a data sheet (as a mapping, too), or itself."""


def told_by(given: Any) -> Prior:
    """Return a prior, or that of a muscle's name, a file or a data sheet."""
    if isinstance(given, Prior):
        return given
    return prior_of(Sheet(**given) if isinstance(given, Mapping) else given)


def believed(structure: Structure, given: Any) -> tuple[Structure, Belief]:
    """Return the structure that can be what is likely, and that belief.

    It knows all displacements and times that the muscle has, told by the recordings or not.

    Raises
    ------
    ModelError
        Of several muscles, or one that something else than a load schedules.
    """
    if structure.n != 1 or structure.scheduled:
        raise ModelError(
            "a prior is of one muscle under its load alone. Remedy: leave prior out for several "
            "muscles, or where something schedules them"
        )
    prior = told_by(given)
    stroke, hull = prior.sheet.stroke, structure.hull
    hull = np.array([[hull[0, 0], max(hull[0, 1], stroke)]])
    highest = max(structure.highest, prior.sheet.max_pressure_bar)
    n_lags = structure.lags.size
    shortest, longest = structure.lag_range
    return replace(
        structure,
        hull=hull,
        limits=structure.limits * (stroke / structure.limits[-1] / (2.0 * highest)),
        lags=np.geomspace(*LAGS, n_lags),
        lag_range=(min(shortest, LAGS[0]), max(longest, TIMES[-1])),
    ), Belief(prior)
