"""Prior of a muscle as additional residuals of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import InstanceOf

from mckibben.arrays import Array, Mask
from mckibben.channels import LOAD_UNITS
from mckibben.errors import ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.balance_structure import Bench, Structure
from mckibben.muscles.prior import Prior, prior_of
from mckibben.muscles.sheet import Sheet
from mckibben.muscles.traits import TIMES, traits
from mckibben.numerics.descent import differences

STEP = 1e-5
"""Step of finite differences, relative to the scale of the parameter."""

ORIGIN_STEPS = 6
"""Number of Gauss-Newton steps for the origin of displacements."""

SHORTEST_LAG = 1.0
"""Largest lower bound of the time constants [s]."""

PriorLike = str | Path | Sheet | InstanceOf[Prior] | None
"""A muscle's name, a file, a data sheet (also as a mapping), or a prior."""


@dataclass(frozen=True)
class PriorErrors:
    """A prior as additional residuals, in standard deviations."""

    prior: Prior

    @cached_property
    def weights(self) -> Array:
        """Matrix that whitens the deviations of traits."""
        return self.prior.weights()

    def errors(
        self, structure: Structure, z: Array, wanted: Mask | None = None
    ) -> tuple[Array, Array]:
        """Return prior residuals, and their derivatives by the requested terms; others are 0.

        The origin of displacements is solved for (variable projection). Traits are values at a few
        places, so coefficients of the area above the first are penalised to keep it smooth in between.
        """
        sheet, weights, origin_std = self.prior.sheet, self.weights, self.prior.zero
        terms, scales = z[: len(structure.terms)], structure.scales()

        def residuals(terms: Array, origin: float) -> Array:
            block = structure.block(structure.expanded(terms))
            deviations = np.nan_to_num(traits(block, sheet, origin) - self.prior.mean)
            return np.append(weights @ deviations, origin / origin_std)

        origin, by_origin = 0.0, np.zeros(1)
        for _ in range(ORIGIN_STEPS):
            at_terms = residuals(terms, origin)
            by_origin = (residuals(terms, origin + STEP * origin_std) - at_terms) / (
                STEP * origin_std
            )
            step = -float(by_origin @ at_terms) / float(by_origin @ by_origin)
            origin += min(max(step, -origin_std), origin_std)

        at_terms = residuals(terms, origin)
        of_area = np.array([kind == "areas" and number > 0 for kind, number, _ in structure.terms])
        smoothing = np.where(of_area, 1.0 / scales, 0.0)
        errors = np.append(at_terms, smoothing * terms)
        if wanted is None:
            return errors, np.zeros((0, terms.size))

        jacobian, places = np.zeros((at_terms.size, terms.size)), np.flatnonzero(wanted).tolist()
        jacobian[:, places] = differences(
            lambda shifted: residuals(shifted, origin), terms, STEP * scales, places
        )
        jacobian -= np.outer(by_origin, by_origin @ jacobian) / float(by_origin @ by_origin)
        return errors, np.concatenate([jacobian, np.diag(smoothing)])


def as_prior(prior: Any) -> Prior:
    """Return a prior as given, or that of a muscle's name, a file or a data sheet."""
    if isinstance(prior, Prior):
        return prior
    return prior_of(Sheet(**prior) if isinstance(prior, Mapping) else prior)


def check_single_muscle(data: TrainingData) -> None:
    """Check that the data of a prior are of one muscle, scheduled by its load only.

    Raises
    ------
    ModelError
        If there are several muscles, or scheduling inputs other than loads.
    """
    if len(data.inputs) != 1 or any(channel.unit not in LOAD_UNITS for channel in data.scheduled):
        raise ModelError(
            "it is for one muscle with no scheduling input but its load",
            parameter="prior",
            remedy="leave prior out",
        )


def with_prior(bench: Bench, given: Any) -> tuple[Bench, PriorErrors]:
    """Return the set-up extended to the muscle's full range, and its prior."""
    prior = as_prior(given)
    shortest, longest = bench.lag_range
    return replace(
        bench,
        hull=np.array([[min(bench.hull[0, 0], 0.0), max(bench.hull[0, 1], prior.sheet.stroke)]]),
        highest=max(bench.highest, prior.sheet.max_pressure_bar),
        heaviest=max(bench.heaviest, prior.sheet.force),
        lag_range=(min(shortest, SHORTEST_LAG), max(longest, TIMES[-1])),
    ), PriorErrors(prior)
