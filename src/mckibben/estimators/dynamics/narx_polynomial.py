"""Identification of the polynomial NARX model, without and with play operators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.blocks.dynamics.narx import Narx
from mckibben.blocks.dynamics.narx_polynomial import NarxPolynomial, products
from mckibben.blocks.fields import vector
from mckibben.errors import ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.dynamics.narx import NarxEstimator
from mckibben.estimators.dynamics.narx_regressors import Lags
from mckibben.estimators.dynamics.narx_selection import candidate_terms, select
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.presets import preset

MOST_CANDIDATES = 2000

SELECTION_SAMPLES = 5000
"""Samples on which terms are chosen."""


@dataclass(kw_only=True, repr=False, eq=False)
class NarxPolynomialEstimator(NarxEstimator):
    """Polynomial NARX model: terms by forward orthogonal least squares, then free-run refinement.

    Parameters
    ----------
    degree : int
        Of the products of regressors.
    n_terms : int
        Most terms; half and a quarter of them are tried too, and the best free run kept.
    """

    title = "Polynomial NARX model"
    purpose = "rate"
    can = (
        "Nonlinear dynamics by a polynomial of past inputs and outputs; terms chosen by "
        "orthogonal least squares."
    )
    cannot = "Remembers only as far as its lags; no inverse."
    caution = "a polynomial of past values leaves all bounds beyond them"
    param_grid: ClassVar[Grid] = {
        "output_lags": (1, 2),
        "input_lags": (1, 2),
        "n_terms": (8, 16),
    }
    effort: ClassVar[float] = 0.6

    degree: Annotated[int, Interval(ge=1, le=6)] = 3
    n_terms: Annotated[int, Interval(ge=1, le=200)] = 16

    def candidates(self, lags: Lags, data: TrainingData, tracker: Tracker) -> list[Narx]:
        """Return models of the most telling terms: all that are allowed, half, and a quarter."""
        terms = candidate_terms(lags.size, self.degree)
        if len(terms) > MOST_CANDIDATES:
            raise ModelError(
                f"{len(terms)} products of {lags.size} regressors are too many to choose from. "
                "Remedy: use a lower degree, or fewer lags."
            )
        pairs = [lags.table(run, self.starting_rule) for run in data.runs]
        regressors = np.concatenate([table for table, _ in pairs])
        target = np.concatenate([target for _, target in pairs])
        keep = np.linspace(0, len(target) - 1, min(len(target), SELECTION_SAMPLES)).astype(int)
        regressors, target = regressors[keep], target[keep]
        columns = products(regressors, terms)
        order = select(columns, target, self.n_terms)
        sizes = sorted({len(order), max(len(order) // 2, 1), max(len(order) // 4, 1)}, reverse=True)
        models: list[Narx] = []
        for size in sizes:
            chosen = order[:size]
            weights = np.linalg.lstsq(columns[:, chosen], target, rcond=1e-12)[0]
            models.append(
                NarxPolynomial(
                    terms=tuple(terms[index] for index in chosen),
                    weights=vector(weights),
                    **self.fields(lags, data),
                )
            )
        return models


NARX_PLAY = preset(
    NarxPolynomialEstimator,
    (
        "Polynomial NARX model with play operators among its regressors, so that it keeps its"
        " branch."
    ),
    title="Polynomial NARX model with play operators",
    can=(
        "Polynomial dynamics with play operators among the regressors: hysteresis and rate in one."
    ),
    cannot="No inverse.",
    param_grid={"n_play": (3, 6), "n_terms": (8, 16)},
    output_lags=1,
    input_lags=1,
    n_play=6,
    effort=0.2,
)
