"""Inner pressure loop, as in regulators with a pressure sensor.

Compensators are identified on measured pressures, which lag behind commands as valves fill and vent. How
far a pressure goes towards its command in a step depends on the valve, the volume and the step, so that
share is estimated in the loop, and the gain follows: the whole way in a step where it is known, and none
where there is no lag to be made up for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array

STEADY = 0.2
"""Largest share of a step's error that is integrated: with more, the delay of a step causes
oscillation.
"""

FORGOTTEN = 0.02
"""Share of its weight that a step loses with the next."""

SLIGHT = 0.01
"""Share of the range: steps towards a command tell about the lag if they are longer."""


@dataclass
class PressureLoop:
    """PI feedback of pressure, added to the commanded pressure.

    Parameters
    ----------
    low, high : array
        Limits of the command [bar].
    sample_time : float
        [s].
    most : float
        Largest proportional gain.
    integral : float
        [1/s]; less in long steps.
    """

    low: Array
    high: Array
    sample_time: float
    most: float = 3.0
    integral: float = 2.0

    def __post_init__(self) -> None:
        self._least = SLIGHT * (self.high - self.low)
        # over steps: what was left to go, squared, and times the way gone; equal without a lag
        self._left, self._gone = self._least**2, self._least**2
        self._sum = np.zeros_like(self.low)
        self._before: tuple[Array, Array, Array] | None = None

    def step(self, wanted: Array, measured: Array) -> Array:
        """Return the command."""
        if self._before is not None:
            self._learn(measured, *self._before)
        share = np.clip(self._gone / self._left, 1.0 / (1.0 + self.most), 1.0)
        command = wanted + (1.0 / share - 1.0) * (wanted - measured) + self._sum
        command = np.clip(command, self.low, self.high)
        self._before = wanted.copy(), measured.copy(), command
        return command

    def _learn(self, measured: Array, due: Array, start: Array, command: Array) -> None:
        """Integrate the error, and update the share of the way to a command that a step goes."""
        inside = (command > self.low) & (command < self.high)
        self._sum += min(self.integral * self.sample_time, STEADY) * (due - measured) * inside
        left = command - start
        fades = np.where(np.abs(left) > self._least, FORGOTTEN, 0.0)
        self._left = self._left + fades * (left**2 - self._left)
        self._gone = self._gone + fades * (left * (measured - start) - self._gone)
