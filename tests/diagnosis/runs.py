"""Recordings whose truth is known: a model, an input, and noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from mckibben import PI, Block, Recording
from mckibben.signals import triangle

Array = NDArray[np.float64]

STEP = 0.02

TRUE = PI(thresholds=(0.0, 0.3, 0.6, 1.0), weights=(3.0, 1.0, 0.7, 0.5))

LINE = PI(thresholds=(0.0,), weights=(4.0,))


def cycles(n: int) -> Array:
    """Return cycles of several sizes."""
    return triangle(STEP * np.arange(n), 6.0, [5.0, 4.0, 3.0, 4.5, 2.0])


def noise(n: int, alike: float, seed: int) -> Array:
    """Return stationary noise of unit deviation whose neighbours are so much alike."""
    white = np.random.default_rng(seed).standard_normal(n + 500)
    return np.asarray(lfilter([np.sqrt(1 - alike**2)], [1, -alike], white))[500:]


def recording(u: Array, y: Array) -> Recording:
    """Return a recording of one muscle."""
    return Recording({"pressure": u, "displacement": y}, STEP)


def run(
    model: Block, n: int = 3000, seed: int = 0, *, alike: float = 0.0, size: float = 0.1
) -> Recording:
    """Return what a model gives over cycles, with noise of a size [mm]."""
    u = cycles(n)
    return recording(u, model.simulate(u, sample_time=STEP) + size * noise(n, alike, seed))
