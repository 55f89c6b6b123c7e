"""How much later one signal is than another: a dead time, a lag, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array

LONGEST = 1.0
"""Dead time and lag looked for [s]."""

MOST = 100
"""Samples of either at most."""

SHORTEST_LOG = 8
"""Dead times that a log lasts at least."""

LOOKED_AT = 20_000
"""Samples that are compared."""

BLOCKS, STUDENT = 20, 2.09
"""Blocks whose sums tell how sure a dead time is, and Student's quantile of 95 % for so many."""

EARLY = 1.0
"""Samples by which a command may be logged before it acts; a longer dead time is one."""

SHORTEST_LAG = 1e-3
"""Samples below which a lag is none."""

STEP = 0.05
"""Samples by which dead time and lag are moved to see what that changes."""


@dataclass(frozen=True)
class Delay:
    """A shift in time.

    Parameters
    ----------
    where : str
        Between what and what, in words.
    seconds : float
        Positive where the second comes later [s].
    interval : (float, float)
        Of 95 % [s].
    lag : float
        Time constant of a first-order lag beside it [s].
    """

    where: str
    seconds: float
    interval: tuple[float, float]
    lag: float = 0.0

    @property
    def certain(self) -> bool:
        """Whether no shift at all is out of the question."""
        return not self.interval[0] <= 0 <= self.interval[1]

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "where": self.where,
            "seconds": self.seconds,
            "interval": list(self.interval),
            "lag": self.lag,
        }


def shifted(x: Array, samples: float) -> Array:
    """Return a signal so many samples later, shape (n, ...); before its start it is as there."""
    at = np.clip(np.arange(len(x)) - samples, 0, len(x) - 1)
    low = np.floor(at).astype(int)
    high = np.minimum(low + 1, len(x) - 1)
    share = (at - low).reshape(-1, *[1] * (x.ndim - 1))
    return np.asarray(x[low] * (1 - share) + x[high] * share)


def lagged(x: Array, samples: float) -> Array:
    """Return a signal through a first-order lag of a time constant, shape (n,), at rest before it."""
    from scipy.signal import lfilter

    keep = np.exp(-1 / samples) if samples > SHORTEST_LAG else 0.0
    return np.asarray(lfilter([1 - keep], [1.0, -keep], x, zi=[keep * x[0]])[0])


def most_samples(n: int, step: float) -> int:
    """Return by how many samples signals of a length are shifted at most."""
    return int(min(MOST, round(LONGEST / step), n // SHORTEST_LOG))


def dead_time(wanted: Array, got: Array, step: float) -> tuple[float, float, float]:
    """Return dead time, half of its 95 % interval, and lag between two signals [samples].

    The second is the first through a dead time and a first-order lag, of any gain and level: what a
    lag explains as well is called a lag.

    Parameters
    ----------
    wanted, got : array, shape (n,)
    step : float
        Sample time [s].
    """
    from scipy.optimize import least_squares

    wanted, got = wanted[:LOOKED_AT], got[:LOOKED_AT]
    most = most_samples(len(wanted), step)
    if most < 1 or np.ptp(wanted) == 0 or np.ptp(got) == 0:
        return 0.0, float("inf"), 0.0

    def left(place: Array) -> Array:
        # what was on its way when the log began is not known
        return _left(wanted, got, float(place[0]), float(place[1]), most)

    late = np.unique(np.round(np.concatenate([[0], np.geomspace(1, most, 16)])))
    lags = np.concatenate([[0.0], np.geomspace(0.5, most, 12)])
    grid = [(float(np.sum(left(np.array([d, t])) ** 2)), d, t) for d in late for t in lags]
    bounds = ([0.0, 0.0], [float(most), 4.0 * most])
    # a lag between those of the grid looks like a dead time, so a start without one is tried too
    tried = [min(grid), min(point for point in grid if point[1] == 0)]
    for _, *start in tuple(tried):
        begun = np.clip(start, 1e-3, np.array(bounds[1]) - 1e-3)
        place = least_squares(left, begun, bounds=bounds, diff_step=[STEP, STEP]).x
        tried.append((float(np.sum(left(place) ** 2)), float(place[0]), float(place[1])))
    found = np.array(min(tried)[1:])
    slopes = [
        (left(found + move) - left(np.maximum(found - move, 0)))
        / np.sum(move + np.minimum(move, found))
        for move in np.diag([STEP, STEP])
    ]
    own = slopes[0] - _on(slopes[1], slopes[0]) if found[1] > STEP else slopes[0]
    power = float(own @ own)
    rest = left(found)
    sums = [float(part.sum()) for part in np.array_split(own * rest, BLOCKS)]
    spread = np.sqrt(np.sum(np.square(sums)) * BLOCKS / (BLOCKS - 1))
    half = STUDENT * spread / power if power > 0 else float("inf")
    return float(found[0]), float(half), float(found[1])


def _left(wanted: Array, got: Array, late: float, lag: float, start: int) -> Array:
    x = lagged(shifted(wanted, late), lag)[start:]
    x = x - x.mean()
    about = got[start:] - got[start:].mean()
    return np.asarray(about - _on(x, about))


def _on(x: Array, y: Array) -> Array:
    """Return what of y is along x."""
    power = float(x @ x)
    return x * (float(x @ y) / power) if power > 0 else np.zeros_like(y)
