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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.free_runs import FreeRuns, relative_sizes
from mckibben.errors import MckibbenError
from mckibben.estimators.core.uncertainty import LARGEST

DAMPINGS = np.geomspace(1e-2, 1e3, 6)
"""Dampings tried in turn, relative to each parameter's own effect on all data: what a part alone
determines stays about as it is, as the fit's start or bounds would hold it.
"""

MOST_FREE = 150
"""Number of free parameters up to which slopes are computed by differences."""

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
    """

    values: Array
    kept: NDArray[np.intp]
    places: NDArray[np.intp]
    units: Array


def slopes_of(runs: FreeRuns, free: Sequence[int]) -> Slopes:
    """Return the slopes of a free run by the free parameters that have an effect on it."""
    m = len(runs.names)
    n_samples = runs.residual.size // m
    samples = np.linspace(0, n_samples - 1, min(n_samples, max(MOST_ROWS // m, 1)))
    kept = (m * samples.round().astype(np.intp)[:, np.newaxis] + np.arange(m)).ravel()
    with np.errstate(over="ignore", invalid="ignore"):
        values = runs.slopes(free, kept)
        largest = np.abs(values).max(axis=0, initial=0.0)
        known = np.isfinite(largest) & (largest < LARGEST) & (largest > 0)
    values, places = values[:, known], np.array(free, dtype=np.intp)[known]
    effects = np.sqrt((values**2).sum(axis=0))
    return Slopes(
        values / effects, kept, places, relative_sizes(runs.block.pack())[places] / effects
    )


def stepped(
    runs: FreeRuns, free: Sequence[int], penalty: float, parts: Sequence[Mask]
) -> list[list[Array]] | None:
    """Return the outputs of a fitted model as it would be without each part of its data.

    Parameters
    ----------
    runs : FreeRuns
        Of the model on the data that it was fitted to.
    free : sequence of int
        Indices in ``block.pack()`` of what was fitted.
    penalty : float
        Ridge of the fit, relative to each parameter's own effect.
    parts : sequence of array of bool, shape (N,)
        Which outputs that count are left out.

    Returns
    -------
    list of list of array, shape (n, m), or None
        For every part, the outputs over every run; None where more than `MOST_FREE` are free.
    """
    if len(free) > MOST_FREE:
        return None
    slopes = slopes_of(runs, free)
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
            eased = rest + (damping + penalty) * np.eye(len(rest))
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
            tables = [table[0] for table in runs.simulated([other])]
    except MckibbenError:
        return None
    return tables if all(np.isfinite(table).all() for table in tables) else None


def _cost(error: Array, rows: Mask, thinned: float) -> float:
    """Return half the squared error at some outputs, in the scale of thinned ones."""
    kept = error[rows]
    return 0.5 * thinned * float(kept @ kept)
