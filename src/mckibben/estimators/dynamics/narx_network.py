"""Identification of the NARX model with a network of sigmoids or wavelets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.dynamics.narx import Narx
from mckibben.blocks.dynamics.narx_network import NarxNetwork, activated
from mckibben.blocks.fields import vector
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid
from mckibben.estimators.dynamics.narx import LEAST_GAIN, NarxEstimator
from mckibben.estimators.dynamics.narx_regressors import Lags
from mckibben.estimators.optimisers.descent import Radius, descend
from mckibben.estimators.optimisers.tracker import Tracker

ONE_STEP_SAMPLES = 3000
"""Samples on which one-step errors are minimised."""

ONE_STEP_EVALUATIONS = 15
"""Most evaluations of a start."""


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

    title = "NARX network"
    purpose = "rate"
    can = "Nonlinear dynamics by one hidden layer."
    cannot = "Slow to fit; no inverse; nothing keeps it sensible beyond the data."
    caution = "a network without physics is arbitrary beyond them"
    param_grid: ClassVar[Grid] = {"output_lags": (1, 2), "n_units": (3, 5)}
    effort: ClassVar[float] = 2.0

    n_units: Annotated[int, Interval(ge=1, le=100)] = 5
    activation: Literal["tanh", "wavelet"] = "tanh"
    n_starts: Annotated[int, Interval(ge=1, le=100)] = 3

    def candidates(self, lags: Lags, data: TrainingData, tracker: Tracker) -> list[Narx]:
        """Return networks fitted to one-step errors by variable projection, one a start."""
        pairs = [lags.table(run, self.starting_rule) for run in data.runs]
        x = np.concatenate([table for table, _ in pairs])
        y = np.concatenate([target for _, target in pairs])
        keep = np.linspace(0, len(y) - 1, min(len(y), ONE_STEP_SAMPLES)).round().astype(int)
        one_step = OneStep(x[keep], y[keep], self.n_units, self.activation, tracker)
        rng = np.random.default_rng(self.seed)
        n, units = lags.size, self.n_units
        models: list[Narx] = []
        for _ in range(self.n_starts):
            first = rng.normal(0.0, 1.0, units * (n + 1))
            *_, (found, _) = descend(
                one_step.errors,
                one_step.slopes,
                first,
                Radius(first, np.ones(first.size)),
                most_evaluations=ONE_STEP_EVALUATIONS,
                least_gain=LEAST_GAIN,
            )
            weights = one_step.weights(found)
            layer = found.reshape(units, n + 1)
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


class OneStep:
    """One-step errors of networks by their hidden layers; all behind these is solved for.

    Parameters
    ----------
    x, y : arrays, shapes (n, k) and (n,)
        Regressors, and the outputs to give.
    units : int
        Of the hidden layer.
    activation : {"tanh", "wavelet"}
    tracker : Tracker
        Counts evaluations.
    """

    def __init__(self, x: Array, y: Array, units: int, activation: str, tracker: Tracker) -> None:
        self.x, self.units, self.activation, self.tracker = x, units, activation, tracker
        # a little damping: neighbouring samples make the regressors nearly dependent
        self._damping = 1e-4 * np.eye(1 + x.shape[1] + units)
        self._target = np.append(y, np.zeros(len(self._damping)))

    def weights(self, first: Array) -> Array:
        """Return bias, linear weights and those of the units that suit a hidden layer best."""
        return self._solved(self._columns(self._activated(first)[0]))

    def errors(self, first: Array) -> Array:
        """Return the errors, and the damping of the weights, with these solved for."""
        self.tracker.evaluations += 1
        columns = self._columns(self._activated(first)[0])
        return np.asarray(columns @ self._solved(columns) - self._target)

    def slopes(self, first: Array) -> Array:
        """Return the derivatives of the errors, less what the weights would take up (Kaufman)."""
        a, steepness = self._activated(first)
        columns = self._columns(a)
        k = self.x.shape[1]
        by_sum = steepness * self._solved(columns)[1 + k :]
        slopes = np.zeros((len(columns), self.units, k + 1))
        slopes[: len(a), :, :k] = by_sum[:, :, np.newaxis] * self.x[:, np.newaxis, :]
        slopes[: len(a), :, k] = by_sum
        moved = slopes.reshape(len(columns), -1)
        taken = np.linalg.qr(columns)[0]
        return np.asarray(moved - taken @ (taken.T @ moved))

    def _activated(self, first: Array) -> tuple[Array, Array]:
        layer = first.reshape(self.units, -1)
        return activated(self.activation, self.x @ layer[:, :-1].T + layer[:, -1])

    def _columns(self, a: Array) -> Array:
        return np.vstack([np.column_stack([np.ones(len(a)), self.x, a]), self._damping])

    def _solved(self, columns: Array) -> Array:
        return np.asarray(np.linalg.lstsq(columns, self._target, rcond=None)[0])
