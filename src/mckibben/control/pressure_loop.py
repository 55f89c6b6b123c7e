"""The inner loop that regulators with a pressure sensor have: what is asked for is what is there.

Compensators are identified on measured pressures; between command and pressure lie valves that fill and
vent at rates of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array


@dataclass
class PressureLoop:
    """PI feedback of pressure on top of the pressure asked for.

    Parameters
    ----------
    gain : float
        Proportional.
    integral : float
        [1/s].
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

    def step(self, wanted: Array, measured: Array) -> Array:
        """Return the command."""
        error = wanted - measured
        command = wanted + self.gain * error + self._sum
        inside = (command > self.low) & (command < self.high)
        self._sum += self.integral * self.sample_time * error * inside
        return np.clip(command, self.low, self.high)
