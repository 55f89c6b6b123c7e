"""What calibration stands on: a model's outputs, running free, beside what was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from mckibben.arrays import Array

BLOCK = 2.0
"""Integral memories that a block lasts: four time constants of an exponential one."""

CHANCE = 0.01
"""Of taking blocks of a run for alike that are not."""


@dataclass(frozen=True)
class Held:
    """A run that the model was not fitted to.

    Parameters
    ----------
    inputs : array, shape (n, inputs)
    modelled, measured : array, shape (n, outputs)
        Outputs.
    counts : array of bool, shape (n,)
        Samples that are scored.
    sample_time : float or None
        [s].
    by : int
        Which model's outputs these are, where a cross-validation has several: what one misses in common
        tells nothing of the next.
    """

    inputs: Array
    modelled: Array
    measured: Array
    counts: NDArray[np.bool_]
    sample_time: float | None
    by: int = 0


def off_as_a_whole(errors: list[Array], pieces: list[int]) -> bool:
    """Tell whether errors (n,) of runs differ from run to run by more than so many blocks of each do.

    By analysis of variance of the blocks' means. Then a run's blocks are no more news than one, however
    many there are.
    """
    means = [
        np.array([block.mean() for block in np.array_split(e, min(n, e.size))])
        for e, n in zip(errors, pieces, strict=True)
        if e.size
    ]
    among, within = len(means) - 1, sum(map(len, means)) - len(means)
    if among < 1 or within < 1:
        return False
    grand = np.concatenate(means).mean()
    between = sum(own.size * (own.mean() - grand) ** 2 for own in means) / among
    inside = sum(float(((own - own.mean()) ** 2).sum()) for own in means) / within
    return inside > 0 and bool(fdtrc(among, within, between / inside) < CHANCE)
