"""What a fitted model would be without a part of its data: a Gauss-Newton step away from the fit.

With residuals r and slopes J of the free run at the fit, and G = J'J, the samples b of the part lose
their weight in the least squares by the step

    d = -(G - J_b' J_b + damping + penalty)^-1 J_b' r_b,

in units of each parameter's own effect on the output. The input still runs through these samples. Terms
that were chosen, and parameters at bounds, stay. Of dampings from light to heavy the first counts with
which the free run of the moved model fits the rest better, where the cost has the fit's own slope added,
so that bounds and penalties keep their optimum. Of a model that is linear in its parameters the step is
exact.

Source: Hoerl and Kennard, "Ridge regression", Technometrics, 1970; Burman, Chow and Nolan, "A
cross-validatory method for dependent data", Biometrika, 1994.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.derivatives import relative_sizes
from mckibben.errors import MckibbenError
from mckibben.estimators.core.free_runs import FreeRuns, as_it_is
from mckibben.estimators.core.uncertainty import LARGEST
from mckibben.recording import Recording

if TYPE_CHECKING:
    from mckibben.estimators.core.estimator import Estimator

DAMPINGS = np.geomspace(1e-2, 1e3, 6)
"""Dampings tried in turn, relative to each parameter's own effect on all data: what a part alone
determines stays about as it is, as the fit's start or bounds would hold it.
"""

MOST_FREE = 150
"""Number of free parameters up to which slopes are computed."""

MOST_ROWS = 20_000
"""Number of outputs, evenly spread, on which slopes are computed."""


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of the free run by what is free, each over its own effect.

    Parameters
    ----------
    values : array, shape (n, k)
        At the outputs ``kept``.
    kept : array of int, shape (n,)
        Indices among the outputs that count.
    places : array of int, shape (k,)
        Indices in ``block.pack()``.
    units : array, shape (k,)
        Change of every parameter in the unit of its column.
    penalty : float
        Of the fit, relative to each parameter's own effect.
    """

    values: Array
    kept: NDArray[np.intp]
    places: NDArray[np.intp]
    units: Array
    penalty: float


def slopes_of(estimator: Estimator, runs: FreeRuns) -> Slopes | None:
    """Return the slopes of a fitted model's free run; None where more than `MOST_FREE` are free."""
    block, m = runs.block, len(runs.names)
    parameters = block.pack()
    fixed = {*estimator.diagnostics_.at_bounds, *estimator.fixed(block)}
    places = np.array([k for k in range(parameters.size) if k not in fixed], dtype=np.intp)
    n_samples = runs.residual.size // m
    samples = np.linspace(0, n_samples - 1, min(n_samples, max(MOST_ROWS // m, 1)))
    kept = (m * samples.round().astype(np.intp)[:, np.newaxis] + np.arange(m)).ravel()
    if len(places) > MOST_FREE:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        values = runs.slopes(places.tolist(), kept)
        largest = np.abs(values).max(axis=0, initial=0.0)
        known = np.isfinite(largest) & (largest < LARGEST) & (largest > 0)
    values, places = values[:, known], places[known]
    effects = np.sqrt((values**2).sum(axis=0))
    units = relative_sizes(parameters)[places] / effects
    return Slopes(values / effects, kept, places, units, estimator.penalty)


def held_out(
    estimator: Estimator, recordings: Sequence[Recording], parts: Sequence[Sequence[Mask]]
) -> list[Array] | None:
    """Return outputs over recordings that were fitted, each part by the model as it would be without it.

    Parameters
    ----------
    estimator : Estimator
        Fitted to the recordings.
    parts : sequence of sequence of array of bool, shape (n,)
        For every part, its samples of every recording.

    Returns
    -------
    list of array, shape (n, m), or None
        None of a model with more parameters than a step is computed for.
    """
    # as the model is delivered, without loads of the recordings' own
    runs = replace(estimator.free_runs(estimator.fitted, recordings), changed=as_it_is)
    counted = [
        np.concatenate([rows[own] for rows, own in zip(part, runs.rows, strict=True)])
        for part in parts
    ]
    without = estimator.left_out(runs, [rows.repeat(len(runs.names)) for rows in counted])
    if without is None:
        return None
    found = [table.copy() for table in runs.modelled]
    for part, tables in zip(parts, without, strict=True):
        for outputs, table, rows in zip(found, tables, part, strict=True):
            outputs[rows] = table[rows]
    return found


def stepped(
    estimator: Estimator, runs: FreeRuns, parts: Sequence[Mask]
) -> list[list[Array]] | None:
    """Return the outputs of the model as it would be without each part; None of one that is too large.

    See `Estimator.left_out`.
    """
    slopes = slopes_of(estimator, runs)
    if slopes is None:
        return None
    residual = runs.residual[slopes.kept]
    gram, slope = slopes.values.T @ slopes.values, slopes.values.T @ residual
    target = runs.scored(runs.modelled) + runs.residual
    found = []
    for part in parts:
        out = slopes.values[part[slopes.kept]]
        rest = gram - out.T @ out
        uphill = out.T @ residual[part[slopes.kept]]
        thinned = residual.size / max(target.size, 1)
        best, before = runs.modelled, _cost(target - runs.scored(runs.modelled), ~part, thinned)
        for damping in DAMPINGS:
            eased = rest + (damping + slopes.penalty) * np.eye(len(rest))
            step = np.linalg.lstsq(eased, -uphill, rcond=1e-14)[0]
            tables = _moved(runs, slopes, step)
            if tables is None:
                continue
            cost = _cost(target - runs.scored(tables), ~part, thinned) + float(slope @ step)
            if cost < before:
                best = tables
                break
        found.append(best)
    return found


def _moved(runs: FreeRuns, slopes: Slopes, step: Array) -> list[Array] | None:
    """Return the outputs of the model moved by a step; None where it has none."""
    parameters = runs.block.pack()
    parameters[slopes.places] += step * slopes.units
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            other: Block = runs.block.unpack(parameters)
            tables = runs.simulated(other)
    except MckibbenError:
        return None
    return tables if all(np.isfinite(table).all() for table in tables) else None


def _cost(error: Array, rows: Mask, thinned: float) -> float:
    """Return half the squared error at some outputs, in the scale of thinned ones."""
    kept = error[rows]
    return 0.5 * thinned * float(kept @ kept)
