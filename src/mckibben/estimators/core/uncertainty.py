"""Parameter uncertainty: condition and covariance from sensitivities of outputs.

Covariances are those of least squares of the free run where residuals remember (the sandwich
P J' R J P, P the pseudo-inverse of J' J): J holds the free-run sensitivities, and R the covariance of
the residuals under an autoregression of as many terms as they ask for (Burg's, chosen by BIC). What the
fit itself has taken out of the residuals is put back, or few long-lived ones would look too small.

Sources: Ljung, "System Identification", 1999, section 9.5 (misspecified noise); den Haan and Levin, "A
practitioner's guide to robust covariance matrix estimation", 1997.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, true_runs
from mckibben.blocks.base import Block
from mckibben.blocks.derivatives import relative_sizes
from mckibben.blocks.free_runs import FreeRuns
from mckibben.numerics.statistics import Autoregression, autoregression

LARGEST = 1e150
"""Largest sensitivity; its square is finite."""

SMALLEST_SINGULAR, DETERMINED = 1e-6, 0.99
"""Smallest singular value of the sensitivities, relative to the largest, that is used; share of a
parameter's direction that must be determined.
"""

NOTHING = 1e-9
"""Relative size below which a parameter counts as 0."""


def unknown(block: Block) -> Array:
    """Return the covariance of undetermined parameters."""
    return np.full((block.n_parameters, block.n_parameters), np.nan)


def covariance_of(runs: FreeRuns, fixed: Sequence[int]) -> tuple[float, Array]:
    """Return the condition of the free parameters of a block, and the covariance of all.

    From derivatives of the free-running output. Parameters that are fixed, or that the data do
    not determine, have NaN; so have those at which the output overflows, and all of a model whose own
    output does.
    """
    parameters, covariance = runs.block.pack(), unknown(runs.block)
    free = [index for index in range(parameters.size) if index not in fixed]
    if not free:
        return np.inf, covariance
    with np.errstate(over="ignore", invalid="ignore"):
        slopes = runs.slopes(free)
        residual = runs.residual
        power = float(residual @ residual)
    finite = np.isfinite(slopes).all(axis=0) & (np.abs(slopes).max(axis=0, initial=0.0) < LARGEST)
    if not finite.any() or not np.isfinite(power):
        return np.inf, covariance
    condition, own = covariance_by_runs(slopes[:, finite], residual, runs)
    places, sizes = np.array(free)[finite], relative_sizes(parameters)
    covariance[np.ix_(places, places)] = own * np.outer(sizes[places], sizes[places])
    return condition if finite.all() else np.inf, covariance


def covariance_by_runs(slopes: Array, residual: Array, runs: FreeRuns) -> tuple[float, Array]:
    """Return the condition of sensitivities, (N, k), and the covariance for residuals, (N,)."""
    if not (np.isfinite(slopes).all() and np.isfinite(residual).all()):
        return np.inf, np.full(2 * slopes.shape[1:], np.nan)
    m = len(runs.names)
    ends = np.cumsum([m * int(rows.sum()) for rows in runs.rows])[:-1]
    moves, residuals = [], []
    for rows, by_run, own in zip(
        runs.rows, np.split(slopes, ends), np.split(residual, ends), strict=True
    ):
        moves.append(np.zeros((rows.size, m, slopes.shape[1])))
        moves[-1][rows] = by_run.reshape(-1, *moves[-1].shape[1:])
        residuals.append(np.full((rows.size, m), np.nan))
        residuals[-1][rows] = own.reshape(-1, m)
    models = autoregressions(residuals)
    condition, covariance, determined = sandwich(moves, residuals, models)
    return condition, blanked(covariance, determined)


def autoregressions(residuals: Sequence[Array]) -> list[Autoregression]:
    """Return the autoregression of every output's residuals, (n, m); NaN at unscored samples."""
    return [
        autoregression([part for e in residuals for part in _pieces(e[:, j])])
        for j in range(residuals[0].shape[1])
    ]


def sandwich(
    moves: Sequence[Array], residuals: Sequence[Array], models: Sequence[Autoregression]
) -> tuple[float, Array, NDArray[np.bool_]]:
    """Return condition, covariance, and which parameters are determined.

    The pseudo-inverse leaves out undetermined directions, so that a parameter next to two of which
    only the sum is determined is as unsure as it is with their sum free.

    Parameters
    ----------
    moves : sequence of array, shape (n, m, k)
        Slopes of every run, 0 where samples do not count.
    left : sequence of array, shape (n, m)
        Residuals, NaN there.
    models : sequence of Autoregression, length m
    """
    n_outputs, k = moves[0].shape[1:]
    scale = np.array([np.sqrt(model.variance) or 1.0 for model in models])
    weighed = [slopes / scale[:, np.newaxis] for slopes in moves]
    condition, inv, determined = pseudo_inverse(np.concatenate([w.reshape(-1, k) for w in weighed]))
    innovations = [
        np.concatenate([m.whitened(np.nan_to_num(e[:, j])) for e in residuals])
        for j, m in enumerate(models)
    ]
    together = np.nan_to_num(np.corrcoef(innovations)) if n_outputs > 1 else np.ones((1, 1))
    middle = np.zeros((k, k))
    for slopes in weighed:
        coloured = [models[j].coloured(slopes[:, j]) / scale[j] for j in range(n_outputs)]
        for i in range(n_outputs):
            for j in range(n_outputs):
                middle += together[i, j] * (coloured[i].T @ coloured[j])
    # what the fit has taken out of the residuals, of all that was in them
    effect = float(np.sum(inv * middle)) / sum(int(np.isfinite(e).sum()) for e in residuals)
    return condition, inv @ middle @ inv / max(1.0 - effect, 0.1), determined


def _pieces(series: Array) -> list[Array]:
    """Return the segments of a series without NaN."""
    return [series[start:stop] for start, stop in true_runs(np.isfinite(series))]


def vanishing(parameters: Array) -> Array:
    """Return which parameters are 0 to rounding, relative to the others."""
    return np.asarray(np.abs(parameters) <= NOTHING * relative_sizes(parameters))


def pseudo_inverse(slopes: Array) -> tuple[float, Array, NDArray[np.bool_]]:
    """Return condition, pseudo-inverse of the products, and which parameters are determined."""
    singular, right = np.linalg.svd(np.linalg.qr(slopes, mode="r"), full_matrices=False)[1:]
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf
    is_kept = singular > SMALLEST_SINGULAR * singular[0]
    inverse = (right[is_kept].T / singular[is_kept] ** 2) @ right[is_kept]
    return condition, inverse, 1 - (right[~is_kept] ** 2).sum(axis=0) > DETERMINED


def blanked(covariance: Array, determined: NDArray[np.bool_]) -> Array:
    """Return a covariance with NaN for undetermined parameters."""
    covariance = covariance.copy()
    covariance[~determined] = covariance[:, ~determined] = np.nan
    return covariance
