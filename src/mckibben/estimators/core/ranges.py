"""Parameter ranges by profile: nearly equal error with all other parameters refitted.

A standard error speaks of a smooth model with independent residuals. Where elements stick and slip the
model is not smooth, and where it is too simple its residuals are anything but independent; the profile
of the error asks for neither.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.estimators.core.data import training_data
from mckibben.estimators.core.uncertainty import simulate_all
from mckibben.estimators.optimisers.multi_start import trust_region
from mckibben.recording import Recording
from mckibben.system.threads import one_blas_thread

FARTHEST = np.log(1000.0)
"""Logarithm of the factor beyond which a parameter counts as unbounded."""

FIRST_STEP, LEAST_STEP = 0.05, 0.003
"""First outward step of a parameter's logarithm, and tolerance of the bound."""

DIFFERENCE = 1e-5
"""Step of a parameter's logarithm, for sensitivities."""


def parameter_ranges(
    block: Block,
    recordings: Recording | Sequence[Recording],
    *,
    others: Sequence[Block] = (),
    share: float = 0.01,
) -> Array:
    """Return the lowest and highest value of every parameter at nearly equal error.

    Parameters
    ----------
    block : Block
        A model whose parameters are all positive, fitted to the recordings; of one driven input.
    recordings : Recording or sequence of Recording
        What it was fitted to.
    others : sequence of Block
        Models of the same structure from other searches: where they end in other minima that are as
        good, ranges cover those too.
    share : float
        By how much the free-running RMSE may rise, all other parameters fitted again; 0.01 is 1 %.

    Returns
    -------
    array, shape (n_parameters, 2)
        0 and infinity where it goes on for a factor of 1000.

    Raises
    ------
    ModelError
        If a parameter is not positive.
    DataError
        On recordings that cannot be learned from.
    """
    starts = [one.pack() for one in (block, *others)]
    if not all((values > 0).all() for values in starts) or not share > 0:
        raise ModelError(
            "ranges are of positive parameters, for a positive share",
            remedy="give the friction alone",
        )
    driven = block.inputs[0].name
    data = training_data(recordings, driven, block.outputs[0].name, None, block.scheduling)

    def residuals(points: Array) -> Array:
        return simulate_all([block.unpack(np.exp(point)) for point in points], data) - data.target

    with one_blas_thread():
        places = np.arange(block.n_parameters)
        minima = [_refined(residuals, np.log(values), places, 30) for values in starts]
        most = min(cost for _, cost in minima) * (1 + share) ** 2
        low, high = np.full(places.size, np.inf), np.zeros(places.size)
        for best in (best for best, cost in minima if cost <= most):
            down, up = (
                np.array([_walk(residuals, best, place, way, most) for place in places.tolist()])
                for way in (-1.0, 1.0)
            )
            low = np.minimum(low, np.where(down < FARTHEST, np.exp(best - down), 0.0))
            high = np.maximum(high, np.where(up < FARTHEST, np.exp(best + up), np.inf))
    return np.column_stack([low, high])


def _walk(
    residuals: Callable[[Array], Array], best: Array, place: int, way: float, most: float
) -> float:
    """Return the distance of a logarithm in one direction until the cost exceeds a bound."""
    others = np.flatnonzero(np.arange(best.size) != place)
    reached, gone, step = best, 0.0, FIRST_STEP
    while gone < FARTHEST and step > LEAST_STEP:
        tried = reached.copy()
        tried[place] = best[place] + way * (gone + step)
        tried, cost = _refined(residuals, tried, others, 6)
        if cost <= most:
            reached, gone, step = tried, gone + step, 2 * step
        else:
            step /= 3
    return gone


def _refined(
    residuals: Callable[[Array], Array], start: Array, free: NDArray[np.intp], steps: int
) -> tuple[Array, float]:
    """Return improved logarithms of the free parameters, within a factor, and the cost."""

    def whole(some: Array) -> Array:
        values = start.copy()
        values[free] = some
        return values

    def errors(some: Array) -> Array:
        return residuals(whole(some)[np.newaxis])[0]

    def slopes(some: Array) -> Array:
        here = whole(some)
        left, *moved = residuals(np.vstack([here, here + DIFFERENCE * np.eye(here.size)[free]]))
        return (np.array(moved) - left).T / DIFFERENCE

    found, cost = trust_region(
        errors,
        slopes,
        start[free],
        scale="jac",
        bounds=(start[free] - 12, start[free] + 12),
        least_gain=1e-4,
        max_evaluations=steps,
    )[-1]
    return whole(found), cost
