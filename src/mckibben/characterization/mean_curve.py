"""The output over the input without its hysteresis: gain, onset and saturation; the mean gap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.characterization.tracks import Scale

FLAT = 0.2
"""Share of the steepest slope below which the output hardly follows the input."""

REACH = 2
"""Levels on either side over which a slope is taken: 8 % of the input range altogether."""


@dataclass(frozen=True)
class MeanCurve:
    """What the mean of rising and falling output tells; None where the recordings do not.

    Parameters
    ----------
    gain : float or None
        Slope at mid input, over a fifth of the range [output unit/input unit].
    onset : float or None
        Input below which the slope stays under a fifth of its maximum.
    saturation : float or None
        Input above which the slope stays under a fifth of its maximum.
    gap : float or None
        Mean over the input of falling less rising output, positive where the output lags
        [output unit].
    """

    gain: float | None
    onset: float | None
    saturation: float | None
    gap: float | None


def mean_curve(levels: Array, rising: Array, falling: Array, scale: Scale) -> MeanCurve:
    """Return what the mean of two curves tells.

    Parameters
    ----------
    levels, rising, falling : array, shape (k,)
        Input levels, evenly spaced, and output there; NaN where unknown.
    scale : Scale
        Of the recordings.
    """
    known = np.isfinite(rising) & np.isfinite(falling)
    if not known.any():
        return MeanCurve(None, None, None, None)
    gap = scale.sign * float(np.mean(falling[known] - rising[known]))
    mean = 0.5 * (rising + falling)[known]
    u = levels[known]
    if u.size < 4 * REACH:
        return MeanCurve(None, None, None, gap)
    centre, fifth = 0.5 * (scale.u_low + scale.u_high), 0.1 * scale.u_span
    gain = None
    if u[0] <= centre - fifth and u[-1] >= centre + fifth:
        low, high = np.interp([centre - fifth, centre + fifth], u, mean)
        gain = float(high - low) / (2 * fifth)
    slopes = (
        scale.sign * (mean[2 * REACH :] - mean[: -2 * REACH]) / (u[2 * REACH :] - u[: -2 * REACH])
    )
    at = u[REACH:-REACH]
    steep = np.flatnonzero(slopes >= FLAT * slopes.max()) if slopes.max() > 0 else np.arange(0)
    if not steep.size:
        return MeanCurve(gain, None, None, gap)
    # A flat end counts when more than one slope is flat there, so that noise makes none.
    onset = float(at[steep[0]]) if steep[0] > 1 else None
    saturation = float(at[steep[-1]]) if steep[-1] < at.size - 2 else None
    return MeanCurve(gain, onset, saturation, gap)
