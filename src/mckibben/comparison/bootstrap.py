"""Skill of a model beside a constant, with a lower bound by paired resampling of blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.statistics import RESAMPLES


def skill_of(squares: Sequence[float], constant: Sequence[float], seed: int) -> tuple[float, float]:
    """Return the share of a constant's squared error that a model removes, and its lower bound.

    The bound is what 99 % of resamples exceed. Blocks are resampled
    together for both, so that what is hard for the two does not count.

    Parameters
    ----------
    squares, constant : sequence of float
        Sums of squared errors of the model and of the constant on the same blocks.
    seed : int
        Of the resampling.
    """
    both = np.array([squares, constant])
    if not np.isfinite(both).all() or both[1].sum() == 0:
        return float("-inf"), float("-inf")
    drawn = np.random.default_rng(seed).integers(0, both.shape[1], (RESAMPLES, both.shape[1]))
    model, mean = both[:, drawn].sum(axis=2)
    left = model / np.maximum(mean, np.finfo(float).tiny)
    return float(1 - both[0].sum() / both[1].sum()), float(1 - np.quantile(left, 0.99))
