"""Periodic signals, interpolated between samples."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array


def band_limited(samples: Array, ratio: int) -> Array:
    """Return a period resampled so many times finer, without higher frequencies.

    Parameters
    ----------
    samples : array, shape (n,)
        One period, or several whole ones; the last sample is followed by the first.
    ratio : int
        New samples for each.

    Returns
    -------
    array, shape (ratio * n,)
        Every ``ratio``-th of which is a sample.

    >>> band_limited(np.array([0.0, 1.0, 0.0, -1.0]), 2).round(3)
    array([ 0.   ,  0.707,  1.   ,  0.707,  0.   , -0.707, -1.   , -0.707])
    """
    n = samples.size
    spectrum = np.fft.rfft(samples)
    wide = np.zeros(ratio * n // 2 + 1, dtype=complex)
    wide[: spectrum.size] = spectrum
    if n % 2 == 0 and ratio > 1:  # the highest frequency is shared by its two signs
        wide[n // 2] *= 0.5
    dense: Array = np.fft.irfft(wide, ratio * n) * ratio
    return dense
