"""Lag of one signal behind another, by their correlation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.channels import by_name
from mckibben.recording import Recording

MOST_SAMPLES = 2**15
"""Most samples that are correlated; longer signals are thinned evenly."""

LAG_PENALTY = 1e-3
"""Correlation by which the largest lag has to be better than none: of the alike peaks of a periodic
signal, the nearest is taken.
"""

LARGEST_LAG = 0.25
"""Largest lag that is looked for, as a share of the recording."""

FORWARD = {"displacement": 1.0, "contraction": 1.0, "length": -1.0, "angle": 0.0}
"""Quantity that a drive moves -> the sign of its change where a pressure rises, 0 for either."""

LEAST_CORRELATION = 0.8
"""Smallest correlation of a drive and an output that are said to be in the wrong order."""

LARGEST_VARIANCE_RATIO = 0.7
"""Variance that the output leaves of a drive that follows it, relative to that in the usual order,
below which the order is wrong.
"""


class Lag(NamedTuple):
    """How late a signal is [samples], the correlation then, and the largest without being early."""

    samples: float
    correlation: float
    in_order: float


def lag(cause: Array, effect: Array, sign: float = 0.0) -> Lag:
    """Return how late a signal is behind another.

    A hysteresis delays the output too: by about half of the time that a dead zone takes.

    Parameters
    ----------
    cause, effect : ndarray, shape (n,)
        Both vary.
    sign : {1.0, -1.0, 0.0}
        Of the effect, where the cause rises; 0.0: use the sign at zero lag.

    Examples
    --------
    >>> import numpy as np
    >>> cause = np.random.default_rng(0).normal(size=1000).cumsum()
    >>> late = lag(cause, np.roll(cause, 7))
    >>> round(late.samples), late.correlation > 0.99
    (7, True)
    """
    stride = -(-cause.size // MOST_SAMPLES)
    x, y = (signal[::stride] / np.abs(signal).max() for signal in (cause, effect))
    x, y = x - x.mean(), y - y.mean()
    reach = max(1, int(LARGEST_LAG * x.size))
    shifts = np.arange(-reach, reach + 1)

    correlations = _overlap_correlation(x, y, shifts)
    correlations *= sign or np.sign(correlations[reach])
    correlations -= LAG_PENALTY * np.abs(shifts) / reach
    early = _within_half_period(correlations[reach::-1])[::-1]
    late = _within_half_period(correlations[reach:])
    near, no_lag = np.concatenate([early[:-1], late]), early.size - 1

    peak = int(np.argmax(near))
    samples = stride * (peak - no_lag + _refinement(near, peak))
    return Lag(float(samples), float(near[peak]), float(near[no_lag:].max()))


def _overlap_correlation(x: Array, y: Array, shifts: NDArray[np.int_]) -> Array:
    """Return the correlation of x and y, shape (n,) each, with y shifted back, one value a shift.

    The energies that it is relative to are those of the samples that overlap.
    """
    n, size = x.size, 2 * x.size
    correlations = np.fft.irfft(np.fft.rfft(y, size) * np.fft.rfft(x, size).conj(), size)[shifts]
    x_energy, y_energy = (np.append(0.0, np.cumsum(signal**2)) for signal in (x, y))
    first, last = np.maximum(0, -shifts), np.minimum(n, n - shifts)
    x_overlap = x_energy[last] - x_energy[first]
    y_overlap = y_energy[last + shifts] - y_energy[first + shifts]
    correlations /= np.sqrt(np.maximum(x_overlap * y_overlap, np.finfo(float).tiny))
    return np.asarray(correlations)


def _within_half_period(correlations: Array) -> Array:
    """Return the correlations, from no lag on, before the first that is not positive."""
    negative = np.flatnonzero(correlations <= 0)
    return correlations[: max(1, int(negative[0]))] if negative.size else correlations


def _refinement(values: Array, peak: int) -> float:
    """Return how far the vertex of the parabola through a peak and its neighbours is from the peak."""
    if not 0 < peak < values.size - 1:
        return 0.0
    before, peak_value, after = values[peak - 1 : peak + 2]
    bend = before - 2 * peak_value + after
    return float(0.5 * (before - after) / bend) if bend < 0 else 0.0


def lags(recording: Recording) -> dict[str, Lag]:
    """Return the lag of every motion behind its drive, where both are known and vary.

    The drive of ``displacement_2`` is ``pressure_2``, or the only one.
    """
    varying = {name: x for name, x in recording.channels.items() if (x != x[0]).any()}
    drives = [name for name in by_name([recording])[0] if name in varying]
    by_motion = {}
    for name, samples in varying.items():
        quantity, _, number = name.partition("_")
        of_output = [drive for drive in drives if drive.partition("_")[2] == number]
        drive = next(iter(of_output if number else drives if len(drives) == 1 else ()), None)
        if drive is not None and name not in drives and quantity in FORWARD:
            by_motion[name] = lag(varying[drive], samples, FORWARD[quantity])
    return by_motion


def comes_first(effect: Lag) -> bool:
    """Return whether an effect clearly precedes its cause: the two are in the wrong order."""
    clear = 1.0 - effect.correlation < LARGEST_VARIANCE_RATIO * (1.0 - effect.in_order)
    return effect.samples <= -2.0 and effect.correlation > LEAST_CORRELATION and clear
