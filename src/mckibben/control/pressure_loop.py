"""Inner pressure loop, as in regulators with a pressure sensor.

Compensators are identified on measured pressures, which lag behind commands as valves fill and vent. The
stable range of gains is unknown: a gain is halved when its pressure oscillates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array

SLIGHT = 0.05
"""Share of the range: an alternating pressure error above this is an oscillation."""


QUICK = 0.1
"""Longest step in which a regulator's transient is visible [s]; with longer steps it has settled.
"""

STEADY = 0.2
"""Largest share of a step's error that is integrated: with more, the delay of a step causes
oscillation.
"""


@dataclass
class PressureLoop:
    """PI feedback of pressure, added to the commanded pressure.

    Parameters
    ----------
    gain : float
        Initial proportional gain; halved for a muscle whose pressure oscillates. Zero for steps
        longer than `QUICK`, in which pressure settles.
    integral : float
        [1/s]; less in long steps.
    low, high : array
        Limits of the command [bar].
    """

    low: Array
    high: Array
    sample_time: float
    gain: float = 3.0
    integral: float = 2.0

    def __post_init__(self) -> None:
        self._sum = np.zeros_like(self.low)
        self._gains = np.full_like(self.low, self.gain if self.sample_time <= QUICK else 0.0)
        self._share = min(self.integral * self.sample_time, STEADY)
        # sign of the last pressure error, and range of commands since
        self._side = np.zeros_like(self.low)
        self._least, self._most = np.full_like(self.low, np.inf), np.full_like(self.low, -np.inf)

    def step(self, wanted: Array, measured: Array) -> Array:
        """Return the command."""
        error = wanted - measured
        self._calm(wanted, error)
        command = wanted + self._gains * error + self._sum
        inside = (command > self.low) & (command < self.high)
        self._sum += self._share * error * inside
        return np.clip(command, self.low, self.high)

    def _calm(self, wanted: Array, error: Array) -> None:
        """Halve the gains if pressures oscillate without a corresponding command."""
        slight = SLIGHT * (self.high - self.low)
        self._least, self._most = np.minimum(self._least, wanted), np.maximum(self._most, wanted)
        side = np.sign(error) * (np.abs(error) > slight)
        over = side * self._side < 0
        self._gains[over & (self._most - self._least < slight)] /= 2
        self._side = np.where(side == 0, self._side, side)
        self._least, self._most = (np.where(over, wanted, x) for x in (self._least, self._most))
