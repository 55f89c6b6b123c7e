"""The paper's methods, their printed errors, and what came of each here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.estimators.core.estimator import Estimator
from mckibben.estimators.hysteresis.pi import PIEstimator
from mckibben.papers.field_models.published import THRESHOLDS
from mckibben.registry import load

Errors = tuple[float, float, float, float]

PRINTED = {
    "NARX": (1.90, 96.83, 2.10, 96.72),
    "Box-Jenkins": (3.25, 90.79, 3.17, 92.55),
    "P2UZ": (1.80, 97.15, 1.91, 97.31),
    "PI by slopes": (2.60, 94.08, 2.48, 95.44),
}
"""Table 2: RMSE [mm] and fitness [%] on calibration, then on test."""

LEAST_SQUARES = "PI by least squares, ours"

NOTHING: Errors = (np.inf, -np.inf, np.inf, -np.inf)
"""Errors of no model."""


def published(seed: int) -> dict[str, Estimator]:
    """Return the paper's four methods as published, and its PI model by least squares.

    Of the NARX model the paper prints neither regressors nor mapping: this one is a sigmoid network on
    two past outputs and inputs, one sample late, fitted to one-step errors, of five starts the one with
    the least free-running error.
    Box-Jenkins has the printed orders, Eqs. (6) to (9): B has terms in q^0 and q^-2. Like P2UZ it starts
    at rest, as the muscle does. PI has the printed thresholds, and weights by the slopes of segments,
    Eqs. (14) and (15).
    """
    return {
        "NARX": load("estimators", "narx-network")(
            n_units=10, delay=1, refine=False, allow_unstable=True, n_starts=5, seed=seed
        ),
        "Box-Jenkins": load("estimators", "bj")(lags=(0, 2), initial="first_sample", seed=seed),
        "P2UZ": load("estimators", "p2uz")(initial="first_sample", seed=seed),
        "PI by slopes": PIEstimator(thresholds=THRESHOLDS, method="slopes", seed=seed),
        LEAST_SQUARES: PIEstimator(thresholds=THRESHOLDS, seed=seed),
    }


@dataclass(frozen=True)
class Tried:
    """What came of one method.

    Parameters
    ----------
    model : Block or None
        Found with the first seed that gave one, matched by range.
    plain : Block or None
        The same, not matched.
    matched_errors, plain_errors : array, shape (seeds, 4)
        RMSE [mm] and fitness [%] on calibration, then on test; infinite where there is no model, or its
        free run overflows.
    failures : tuple of str
        Why, one a seed that failed.
    """

    model: Block | None
    plain: Block | None
    matched_errors: Array
    plain_errors: Array
    failures: tuple[str, ...]

    def median(self, errors: Array) -> Errors | None:
        """Return the median errors over all seeds, those that failed counted as the worst."""
        found = np.median(errors, axis=0)
        if not np.isfinite(found).all():
            return None
        calibration, fitness, test, test_fitness = found.tolist()
        return calibration, fitness, test, test_fitness

    @property
    def lowest_test(self) -> float | None:
        """The lower median test RMSE of plain and matched [mm].

        None where most seeds failed, or are worse than the mean of what was measured: what is broken is
        nothing to compare with.
        """
        medians = [self.median(self.plain_errors), self.median(self.matched_errors)]
        return min(
            (found[2] for found in medians if found is not None and found[3] > 0), default=None
        )

    @property
    def reason(self) -> str:
        """Why it failed, and how often."""
        if not self.failures:
            return ""
        n = len(self.plain_errors)
        return f"{len(self.failures)} of {n} seeds: {self.failures[0]}"
