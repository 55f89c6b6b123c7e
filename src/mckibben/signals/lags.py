"""Lag of one signal behind another, by their correlation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.channels import by_name
from mckibben.recording import Recording

LONGEST = 2**15
"""Most samples that are correlated; of longer signals, every so many are."""

NEAREST = 1e-3
"""Correlation by which the largest lag has to be better than none."""

WIDEST = 0.25
"""Largest lag that is looked for, as a share of the recording."""

FORWARD = {"displacement": 1.0, "contraction": 1.0, "length": -1.0, "angle": 0.0}
"""Quantity that a drive moves -> the sign of its change where a pressure rises, 0 for either."""

ALIKE = 0.8
"""Smallest correlation of a drive and an output that are said to be in the wrong order."""

CLEARER = 0.7
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
        Of the effect; 0.0 where it is unknown: then as without a lag.

    Examples
    --------
    >>> import numpy as np
    >>> cause = np.random.default_rng(0).normal(size=1000).cumsum()
    >>> late = lag(cause, np.roll(cause, 7))
    >>> round(late.samples), late.correlation > 0.99
    (7, True)
    """
    every = -(-cause.size // LONGEST)
    x, y = (some[::every] / np.abs(some).max() for some in (cause, effect))
    x, y = x - x.mean(), y - y.mean()
    n, size = x.size, 2 * x.size
    reach = max(1, int(WIDEST * n))
    shifts = np.arange(-reach, reach + 1)
    found = np.fft.irfft(np.fft.rfft(y, size) * np.fft.rfft(x, size).conj(), size)[shifts]
    whole = [np.append(0.0, np.cumsum(some**2)) for some in (x, y)]  # of those that overlap
    first, last = np.maximum(0, -shifts), np.minimum(n, n - shifts)
    energies = [
        whole[0][last] - whole[0][first],
        whole[1][last + shifts] - whole[1][first + shifts],
    ]
    found /= np.sqrt(np.maximum(energies[0] * energies[1], np.finfo(float).tiny))
    found *= sign or np.sign(found[reach])
    found -= NEAREST * np.abs(shifts) / reach  # of several periods
    sides = [_near(found[reach::-1])[::-1], _near(found[reach:])]
    found, reach = np.concatenate([sides[0][:-1], sides[1]]), sides[0].size - 1
    at = int(np.argmax(found))
    shift = 0.0
    if 0 < at < found.size - 1:
        before, here, after = found[at - 1 : at + 2]
        bend = before - 2 * here + after
        shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    late = every * (at - reach + shift)
    return Lag(float(late), float(found[at]), float(found[reach:].max()))


def _near(correlations: Array) -> Array:
    """Return the correlations from no lag on before they are negative: within half a period."""
    against = np.flatnonzero(correlations <= 0)
    return correlations[: max(1, int(against[0]))] if against.size else correlations


def lags(recording: Recording) -> dict[str, Lag]:
    """Return the lag of every motion behind its drive, where both are known and vary.

    The drive of ``displacement_2`` is ``pressure_2``, or the only one.
    """
    moving = {name: x for name, x in recording.channels.items() if (x != x[0]).any()}
    drives = [name for name in by_name([recording])[0] if name in moving]
    found = {}
    for name, samples in moving.items():
        quantity, _, number = name.partition("_")
        own = [drive for drive in drives if drive.partition("_")[2] == number]
        drive = next(iter(own if number else drives if len(drives) == 1 else ()), None)
        if drive is not None and name not in drives and quantity in FORWARD:
            found[name] = lag(moving[drive], samples, FORWARD[quantity])
    return found


def comes_first(found: Lag) -> bool:
    """Return whether a signal precedes what should cause it, clearly."""
    apart = 1.0 - found.correlation < CLEARER * (1.0 - found.in_order)
    return found.samples <= -2.0 and found.correlation > ALIKE and apart
