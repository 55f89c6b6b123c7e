"""What recordings and runs have of their own among the coefficients of a balance of forces.

Behind those of the model: of every recording under a load that nobody measured, a constant force of
every muscle; then, of every run whose start is found, what every muscle remembers there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array


@dataclass(frozen=True)
class Own:
    """Places of what recordings and runs have of their own.

    Parameters
    ----------
    first : int
        Place of the first.
    n, n_lags : int
        Muscles; lags.
    limits : array
        Travels at which stops break away [mm/bar].
    unmeasured : tuple of int
        Recordings with loads of their own.
    n_starts : int
        Runs whose starts are found.
    """

    first: int
    n: int
    n_lags: int
    limits: Array
    unmeasured: tuple[int, ...]
    n_starts: int

    @property
    def starts(self) -> int:
        """Place of the first run's start."""
        return self.first + len(self.unmeasured) * self.n

    @property
    def stop(self) -> int:
        """Place behind the last."""
        return self.starts + self.n_starts * self.n * (1 + self.n_lags)

    def load(self, recording: int) -> NDArray[np.intp]:
        """Return the places of the load that only a recording has: of every muscle one, or none."""
        if recording not in self.unmeasured:
            return np.arange(0)
        return self.first + self.unmeasured.index(recording) * self.n + np.arange(self.n)

    def table_of_loads(self, values: Array, n_recordings: int) -> Array:
        """Return the loads that only recordings have, shape (recordings, n)."""
        table = np.zeros((n_recordings, self.n))
        for recording in self.unmeasured:
            table[recording] = values[self.load(recording)]
        return table

    def start(self, place: int) -> NDArray[np.intp]:
        """Return the places of what a run remembers, shape (n, 1 + lags): friction's share first."""
        width = self.n * (1 + self.n_lags) * bool(self.n_starts)
        return (self.starts + place * width + np.arange(width)).reshape(-1, 1 + self.n_lags)

    def begun(self, values: Array, place: int, grip: int, pressures: Array) -> tuple[Array, Array]:
        """Return with what stops and lags of a run begin [mm], and how that moves with all values."""
        own = self.start(place)
        if not own.size:
            return np.zeros(0), np.zeros((0, self.stop))
        n, m, n_l = self.n, self.limits.size, self.n_lags
        grown = np.maximum(pressures + values[grip], 0.0)
        holds = grown[:, np.newaxis] * self.limits
        shares = values[own[:, :1]]
        by = np.zeros((n * (m + n_l), self.stop))
        for k in range(n):
            stops = slice(k * m, (k + 1) * m)
            by[stops, own[k, 0]] = holds[k]
            by[stops, grip] = shares[k] * self.limits * (grown[k] > 0.0)
            lags = np.arange(n_l)
            by[n * m + k * n_l + lags, own[k, 1 + lags]] = 1.0
        return np.append((shares * holds).ravel(), values[own[:, 1:]].ravel()), by
