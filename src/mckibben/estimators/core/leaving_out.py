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

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.derivatives import relative_sizes
from mckibben.blocks.free_runs import FreeRuns
from mckibben.errors import MckibbenError
from mckibben.estimators.core.uncertainty import LARGEST

DAMPINGS = np.geomspace(1e-2, 1e3, 6)
"""Dampings tried in turn, relative to each parameter's own effect on all data: what a part alone
determines stays about as it is, as the fit's start or bounds would hold it.
"""

MOST_FREE = 150
"""Number of free parameters up to which slopes are computed."""

MOST_ROWS = 20_000
"""Number of outputs, evenly spread, on which slopes are computed."""


def outputs_without_parts(
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
    parameters, m = runs.block.pack(), len(runs.names)
    n_samples = runs.residual.size // m
    samples = np.linspace(0, n_samples - 1, min(n_samples, max(MOST_ROWS // m, 1)))
    rows = (m * samples.round().astype(np.intp)[:, np.newaxis] + np.arange(m)).ravel()
    with np.errstate(over="ignore", invalid="ignore"):
        slopes = runs.slopes(free, rows)
        largest = np.abs(slopes).max(axis=0, initial=0.0)
        is_usable = np.isfinite(largest) & (largest < LARGEST) & (largest > 0)
    slopes, places = slopes[:, is_usable], np.array(free, dtype=np.intp)[is_usable]
    effects = np.sqrt((slopes**2).sum(axis=0))
    slopes, units = slopes / effects, relative_sizes(parameters)[places] / effects
    residual, target = runs.residual[rows], runs.scored(runs.modelled) + runs.residual
    gram, slope = slopes.T @ slopes, slopes.T @ residual
    kept_share = residual.size / max(target.size, 1)

    def outputs_after(step: Array) -> list[Array] | None:
        """Return the outputs of the model moved by a step; None where it has none."""
        moved = parameters.copy()
        moved[places] += step * units
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                tables = runs.simulated(runs.block.unpack(moved))
        except MckibbenError:
            return None
        return tables if all(np.isfinite(table).all() for table in tables) else None

    def cost(tables: Sequence[Array], part: Mask) -> float:
        """Return half the squared error without a part, in the scale of the kept outputs."""
        error = (target - runs.scored(tables))[~part]
        return 0.5 * kept_share * float(error @ error)

    result = []
    for part in parts:
        left_out = part[rows]
        slopes_of_part = slopes[left_out]
        gram_without, uphill = (
            gram - slopes_of_part.T @ slopes_of_part,
            slopes_of_part.T @ residual[left_out],
        )
        best, before = runs.modelled, cost(runs.modelled, part)
        for damping in DAMPINGS:
            damped = gram_without + (damping + penalty) * np.eye(len(gram_without))
            step = np.linalg.lstsq(damped, -uphill, rcond=1e-14)[0]
            tables = outputs_after(step)
            if tables is not None and cost(tables, part) + float(slope @ step) < before:
                best = tables
                break
        result.append(best)
    return result
