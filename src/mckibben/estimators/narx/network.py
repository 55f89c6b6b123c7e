"""Identification of the NARX model with a network of sigmoids or wavelets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from mckibben.blocks.dynamic.narx import Narx
from mckibben.blocks.dynamic.narx_network import NarxNetwork
from mckibben.blocks.fields import vector
from mckibben.estimators.data import TrainingData
from mckibben.estimators.narx.base import NarxEstimator
from mckibben.estimators.narx.regressors import Lags
from mckibben.estimators.search import Tracker

Array = NDArray[np.float64]

ONE_STEP_SAMPLES = 3000
"""Samples on which one-step errors are minimised."""


@dataclass(kw_only=True, repr=False, eq=False)
class NarxNetworkEstimator(NarxEstimator):
    """NARX model with one hidden layer: linear part first, units on top, then free-run refinement.

    Parameters
    ----------
    n_units : int
        Units of the hidden layer.
    activation : {"tanh", "wavelet"}
        Of the units.
    n_starts : int
        Random first layers tried.
    """

    effort: ClassVar[float] = 6.0

    n_units: Annotated[int, Interval(ge=1, le=100)] = 5
    activation: Literal["tanh", "wavelet"] = "tanh"
    n_starts: Annotated[int, Interval(ge=1, le=100)] = 3

    def candidates(self, lags: Lags, data: TrainingData, tracker: Tracker) -> list[Narx]:
        """Return networks fitted to one-step errors by variable projection, one a start."""
        from scipy.optimize import least_squares

        pairs = [lags.table(run, self.starting_rule) for run in data.runs]
        x = np.concatenate([table for table, _ in pairs])
        y = np.concatenate([target for _, target in pairs])
        keep = np.linspace(0, len(y) - 1, min(len(y), ONE_STEP_SAMPLES)).round().astype(int)
        x, y = x[keep], y[keep]
        rng = np.random.default_rng(self.seed)
        n, units = lags.size, self.n_units

        def solved(first: Array) -> tuple[Array, Array]:
            layer = first.reshape(units, n + 1)
            s = x @ layer[:, :n].T + layer[:, n]
            a = np.tanh(s) if self.activation == "tanh" else (1 - s**2) * np.exp(-0.5 * s**2)
            columns = np.column_stack([np.ones(len(y)), x, a])
            # a little damping: neighbouring samples make the regressors nearly dependent
            weights = np.linalg.lstsq(
                np.vstack([columns, 1e-4 * np.eye(columns.shape[1])]),
                np.append(y, np.zeros(columns.shape[1])),
                rcond=None,
            )[0]
            return weights, columns @ weights - y

        def residuals(first: Array) -> Array:
            return solved(first)[1]

        models: list[Narx] = []
        for _ in range(self.n_starts):
            first = rng.normal(0.0, 1.0, units * (n + 1))
            found = least_squares(residuals, first, max_nfev=15, ftol=1e-6)
            tracker.evaluations += int(found.nfev)
            weights, _ = solved(found.x)
            layer = found.x.reshape(units, n + 1)
            hidden = np.column_stack([layer, weights[1 + n :]])
            models.append(
                NarxNetwork(
                    bias=float(weights[0]),
                    linear=vector(weights[1 : 1 + n]),
                    hidden=vector(hidden.ravel()),
                    activation=self.activation,
                    **self.fields(lags, data),
                )
            )
        return models
