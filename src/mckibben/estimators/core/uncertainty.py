"""What recordings tell of a block's parameters: condition and covariance, from how outputs move."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.running import run_many
from mckibben.estimators.core.data import TrainingData

LARGEST = 1e150
"""Sensitivity that still is one: its square is a number."""

DIFFERENCE = 1e-6
"""Step of finite differences, relative to the size of a parameter."""


def simulate_all(blocks: Sequence[Block], data: TrainingData) -> Array:
    """Return the free-running outputs of blocks at the samples that count, as `TrainingData.target`."""
    outputs = []
    for run in data.runs:
        many = run_many(blocks, run.inputs, sample_time=run.sample_time)
        trimmed = many if run.peak is None else many[:, 1:]
        outputs.append(trimmed[:, run.counts].reshape(len(many), -1))
    return np.concatenate(outputs, axis=1)


def unknown(block: Block) -> Array:
    """Return the covariance of a block's parameters of which nothing is known."""
    return np.full((block.n_parameters, block.n_parameters), np.nan)


def covariance_of(
    block: Block, data: TrainingData, residual: Array, fixed: Sequence[int]
) -> tuple[float, Array]:
    """Return the condition of the parameters that are free, and the covariance of all.

    From finite differences of the free-running output on a share of the samples. Parameters that
    are fixed, or that the data do not determine, have NaN; so have those at which the output
    overflows, and all of a model whose own output does.
    """
    parameters = block.pack()
    covariance = np.full((parameters.size, parameters.size), np.nan)
    free = [index for index in range(parameters.size) if index not in fixed]
    if not free:
        return np.inf, covariance
    thin = data.thinned(max(2000, 4 * parameters.size))
    sizes = relative_sizes(parameters)
    with np.errstate(over="ignore", invalid="ignore"):
        slopes = sensitivities(block, free, sizes[free], lambda blocks: simulate_all(blocks, thin))
        power = float(residual @ residual)
    finite = np.isfinite(slopes).all(axis=0) & (np.abs(slopes).max(axis=0, initial=0.0) < LARGEST)
    if not finite.any() or not np.isfinite(power):
        return np.inf, covariance
    condition, own = inverted(slopes[:, finite])
    places = np.array(free)[finite]
    variance = power / max(residual.size - len(free), 1) * len(slopes) / residual.size
    covariance[np.ix_(places, places)] = variance * own * np.outer(sizes[places], sizes[places])
    return condition if finite.all() else np.inf, covariance


def relative_sizes(parameters: Array) -> Array:
    """Return the sizes by which parameters are scaled; none is counted as very small."""
    return np.maximum(np.abs(parameters), 1e-3 * np.abs(parameters).max(initial=1e-3))


def sensitivities(
    block: Block, places: Sequence[int], sizes: Array, run: Callable[[list[Block]], Array]
) -> Array:
    """Return how outputs move with some parameters, each in units of its size, shape (n, k).

    Parameters
    ----------
    places : sequence of int, length k
        Of the parameters.
    sizes : array, shape (k,)
        Their sizes.
    run : callable
        Gives the outputs of blocks, shape (blocks, n).
    """
    parameters = block.pack()
    perturbed: list[Block] = [block]
    for place, size in zip(places, sizes, strict=True):
        moved = parameters.copy()
        moved[place] += DIFFERENCE * size
        perturbed.append(block.unpack(moved))
    base, *others = run(perturbed)
    return np.column_stack([other - base for other in others]) / DIFFERENCE


def inverted(slopes: Array) -> tuple[float, Array]:
    """Return the condition of scaled slopes, shape (n, k), and the inverse of their products, (k, k).

    Rows and columns of what the slopes do not determine are NaN.
    """
    singular, right = np.linalg.svd(slopes, full_matrices=False)[1:]
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf
    kept = singular > 1e-6 * singular[0]
    inverse = (right[kept].T / singular[kept] ** 2) @ right[kept]
    determined = 1 - (right[~kept] ** 2).sum(axis=0) > 0.99
    inverse[~determined] = np.nan
    inverse[:, ~determined] = np.nan
    return condition, inverse
