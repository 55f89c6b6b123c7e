"""Identification of a balance of forces between muscles in parallel.

The error that is minimised is that of the pressures which the balance needs to be where the arm was,
by Gauss-Newton steps on its ratio of two linear forms. It needs no run in which a muscle moves alone,
and no search over starting points.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Interval

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import rows, vector
from mckibben.blocks.coupled.force_balance import AREA, ForceBalance
from mckibben.blocks.play_type.play import play_matrix
from mckibben.errors import ModelError
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.estimators.optimisers.descent import LIGHTEST, Damping, descend
from mckibben.estimators.optimisers.tracker import Tracker

LEAST_AREA = 0.05
"""Smallest effective area on the data, relative to that at rest."""

LIMITED = ("bar", "V")
"""Units of what the hardware limits."""

LEVEL = 0.1
"""Levels of what schedules are different if they differ by this share of its range."""

STEPS = 20
"""Of Gauss and Newton."""

MOST_SAMPLES = 30_000
"""Samples to fit; more are thinned evenly."""


@dataclass(kw_only=True, repr=False, eq=False)
class ForceBalanceEstimator(CoupledEstimator):
    """Balance of forces of muscles in parallel, scheduled by stiffness or load.

    Parameters
    ----------
    thresholds : sequence of float
        Travels at which friction elements break away, relative to the largest displacement.
    degree : int
        Highest power of what schedules.
    ridge : float
        Damping of the coefficients.
    """

    effort: ClassVar[float] = 0.2

    thresholds: tuple[Annotated[float, Gt(0)], ...] = (0.008, 0.025, 0.065, 0.16, 0.4)
    degree: Annotated[int, Interval(ge=1, le=4)] = 2
    ridge: Annotated[float, Ge(0)] = 1e-5

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the balance, solved for displacements."""
        n = len(data.inputs)
        y = data.stacked("outputs")
        scale = float(np.abs(y).max())
        if not scale > 0:
            raise ModelError("no displacement ever changes. Remedy: record muscles that move.")
        every = max(1, len(y) // MOST_SAMPLES)
        degree = self._degree(data, tracker)
        forces, areas = [], []
        for k in range(n):
            tracker.reached(k / n)
            tables = [self._columns(run, k, scale, degree) for run in data.runs]
            top = np.concatenate([a[::every] for a, _ in tables])
            bottom = np.concatenate([b[::every] for _, b in tables])
            p = np.concatenate([run.driven[::every, k] for run in data.runs])
            force, area = ratio(top, bottom, p, self.ridge)
            forces.append(force)
            areas.append(area)
        low, high = float(data.lowest.min()), float(data.highest.max())
        # pressures and voltages have limits; a force that is estimated has none
        limited = data.inputs[0].unit in LIMITED
        return ForceBalance(
            rows(np.array(forces)),
            rows(np.array(areas)),
            vector(np.array(self.thresholds) * scale),
            scale,
            degree,
            data.outputs,
            data.scheduled,
            data.inputs,
            (min(low, 0.0), high) if limited else None,
        ).inverse()

    def _degree(self, data: TrainingData, tracker: Tracker) -> int:
        """Return the highest power that the levels of what schedules can determine."""
        levels = [
            np.unique(np.round(x / (LEVEL * max(float(np.ptp(x)), 1e-9)))).size
            for x in data.stacked("scheduled").T
        ]
        most = max(min([self.degree, *(n - 1 for n in levels)]), 1)
        if most < self.degree and data.scheduled:
            tracker.notes.append(
                f"what schedules has few levels: degree {most} instead of {self.degree}"
            )
        return most

    def _columns(self, run: Run, k: int, scale: float, degree: int) -> tuple[Array, Array]:
        """Return what the coefficients of the force and of the area multiply over a run."""
        y = run.outputs / scale
        powers = [np.ones(len(y))]
        for x in run.scheduled.T:
            powers += [x**d for d in range(1, degree + 1)]
        stops = friction(y[:, k], np.array(self.thresholds))
        columns = [power * column for power in powers for column in (np.ones(len(y)), *y.T)]
        columns += [y[:, k] ** d for d in (2, 3, 4)]
        columns += [power * stop for power in powers for stop in stops.T]
        bottom = [y[:, k] ** d for d in range(1, AREA + 1)]
        return np.column_stack(columns), np.column_stack([*bottom, stops])


def friction(y: Array, r: Array) -> Array:
    """Return stop operators relative to their thresholds, shape (n, m), as the block starts them."""
    y = np.ascontiguousarray(y)
    plays = np.empty((y.size, r.size))
    play_matrix(y, r, y[0] - np.clip(y[0], -r, r), plays)
    result: Array = (y[:, np.newaxis] - plays) / r
    return result


def ratio(top: Array, bottom: Array, p: Array, ridge: float) -> tuple[Array, Array]:
    """Return a and b that minimise |p - top a / (1 + bottom b)|, a little damped."""
    n, m = top.shape[1], bottom.shape[1]
    damping = ridge * len(p) * np.eye(n + m)
    first = np.hstack([top, -bottom * p[:, np.newaxis]])
    values: Array = np.asarray(np.linalg.solve(first.T @ first + damping, first.T @ p), np.float64)
    own = np.sqrt(damping)

    def errors(values: Array) -> Array:
        area = 1.0 + bottom @ values[n:]
        if area.min() < LEAST_AREA:
            return np.full(len(p) + n + m, np.inf)
        return np.concatenate([(top @ values[:n]) / area - p, own @ values])

    def slopes(values: Array) -> Array:
        area = (1.0 + bottom @ values[n:])[:, np.newaxis]
        found = (top @ values[:n])[:, np.newaxis] / area
        return np.vstack([np.hstack([top, -bottom * found]) / area, own])

    if not np.isfinite(errors(values)).all():  # the linear start may have no area somewhere
        values = np.append(np.linalg.lstsq(top, p, rcond=None)[0], np.zeros(m))
    path = descend(errors, slopes, values, Damping(LIGHTEST, 1.0), least_gain=1e-9)
    *_, (values, _) = islice(path, STEPS + 1)
    return values[:n], values[n:]
