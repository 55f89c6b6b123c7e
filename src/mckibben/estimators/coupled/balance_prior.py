"""Prior of a muscle, combined with its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import InstanceOf

from mckibben.arrays import Array
from mckibben.errors import ModelError
from mckibben.estimators.core.data import Mask, TrainingData
from mckibben.estimators.coupled.balance_structure import Bench, Structure
from mckibben.estimators.coupled.base import LOADS
from mckibben.muscles.prior import Prior, prior_of
from mckibben.muscles.sheet import Sheet
from mckibben.muscles.traits import TIMES, traits

STEP = 1e-5
"""Relative step of a number for finite differences of traits."""

LEAST_NOISE = 0.01
"""Smallest model error of a muscle, relative to the range, for independent samples."""

ZERO_STEPS = 6
"""Steps towards the probable origin of displacements."""

SHORTEST_LAG = 1.0
"""Smallest first time constant [s]."""

PriorLike = str | Path | Sheet | InstanceOf[Prior] | None
"""Forms of a prior: a muscle's name, a file, a data sheet (also as a mapping), or a prior."""


@dataclass(frozen=True)
class PriorErrors:
    """A prior as additional residuals.

    Parameters
    ----------
    prior : Prior
    noise : float
        Of the recordings' errors, relative to the range, were there as many independent ones: by it a
        deviation of one from the prior is as bad as one from the recordings.
    """

    prior: Prior
    noise: float = LEAST_NOISE

    @cached_property
    def weights(self) -> Array:
        """Rows that decorrelate the numbers of traits."""
        return self.prior.weights()

    def errors(
        self, structure: Structure, z: Array, wanted: Mask | None = None
    ) -> tuple[Array, Array]:
        """Return prior residuals, and derivatives by the requested terms, others 0.

        Where displacements count from is as likely makes them most so (variable projection). Traits are
        values at a few places; between them areas are smooth, no coefficient beyond that at rest.
        """
        sheet, weights, unsure = self.prior.sheet, self.noise * self.weights, self.prior.zero
        terms, scales = z[: len(structure.terms)], structure.scales()
        narrowing = np.array([kind == "areas" and which > 0 for kind, which, _ in structure.terms])
        curved = np.where(narrowing, self.noise / scales, 0.0)

        def away(free: Array, zero: float) -> Array:
            block = structure.block(structure.expanded(free))
            found = np.nan_to_num(traits(block, sheet, zero) - self.prior.mean)
            return np.append(weights @ found, self.noise * zero / unsure)

        zero, by_zero = 0.0, np.zeros(1)
        for _ in range(ZERO_STEPS):
            now = away(terms, zero)
            by_zero = (away(terms, zero + STEP * unsure) - now) / (STEP * unsure)
            step = -float(by_zero @ now) / float(by_zero @ by_zero)
            zero += min(max(step, -unsure), unsure)
        now = away(terms, zero)
        far = np.append(now, curved * terms)
        if wanted is None:
            return far, np.zeros((0, terms.size))
        slopes = np.zeros((now.size, terms.size))
        for place in np.flatnonzero(wanted).tolist():
            moved = terms.copy()
            moved[place] += (step := STEP * scales[place])
            slopes[:, place] = (away(moved, zero) - now) / step
        slopes -= np.outer(by_zero, by_zero @ slopes) / float(by_zero @ by_zero)
        return far, np.concatenate([slopes, np.diag(curved)])


def as_prior(given: Any) -> Prior:
    """Return a prior, or the one of a muscle's name, a file or a data sheet."""
    if isinstance(given, Prior):
        return given
    return prior_of(Sheet(**given) if isinstance(given, Mapping) else given)


def check_alone(data: TrainingData) -> None:
    """Raise an error for a prior of several muscles, or with scheduling inputs other than a load.

    Raises
    ------
    ModelError
    """
    if len(data.inputs) != 1 or any(channel.unit not in LOADS for channel in data.scheduled):
        raise ModelError(
            "a prior is of one muscle under its load alone",
            remedy="leave prior out for several muscles, or where something schedules them",
        )


def with_prior(bench: Bench, given: Any) -> tuple[Bench, PriorErrors]:
    """Return the set-up over the muscle's full range, recorded or not, and its prior."""
    prior = as_prior(given)
    shortest, longest = bench.lag_range
    return replace(
        bench,
        hull=np.array([[min(bench.hull[0, 0], 0.0), max(bench.hull[0, 1], prior.sheet.stroke)]]),
        highest=max(bench.highest, prior.sheet.max_pressure_bar),
        heaviest=max(bench.heaviest, prior.sheet.force),
        lag_range=(min(shortest, SHORTEST_LAG), max(longest, TIMES[-1])),
    ), PriorErrors(prior)
