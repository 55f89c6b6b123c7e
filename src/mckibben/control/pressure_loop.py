"""PI feedback of pressure, as in pressure regulators with a sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array

MOST_INTEGRATED = 0.2
"""Largest share of the error that is integrated in a step: with more, the delay of a step causes
oscillation.
"""

FORGETTING = 0.02
"""Share of its weight that a step loses with the next."""

SHORTEST_MOVE = 0.01
"""Share of the range: only longer moves towards a command tell about the lag."""


@dataclass
class PressureLoop:
    """PI feedback of pressure, added to the commanded pressure, as in regulators with a sensor.

    Compensators are identified on measured pressures, which lag behind commands as valves fill and vent.
    How far a pressure goes towards its command in a step depends on the valve, the volume and the step,
    so that share is estimated in the loop, and the gain follows: the whole way in a step where it is
    known, and none where there is no lag to be made up for.

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
        self._shortest_move = SHORTEST_MOVE * (self.high - self.low)
        # least squares of progress over distance, with forgetting; equal sums mean no lag
        self._sum_distance_squared = self._shortest_move**2
        self._sum_distance_times_progress = self._shortest_move**2
        self._integral_term = np.zeros_like(self.low)
        self._previous: tuple[Array, Array, Array] | None = None

    def step(self, desired: Array, measured: Array) -> Array:
        """Return the command for a wanted pressure, from the measured one [bar], shape (n,) each."""
        if self._previous is not None:
            self._learn(measured, *self._previous)
        progress_per_step = np.clip(
            self._sum_distance_times_progress / self._sum_distance_squared,
            1.0 / (1.0 + self.most),
            1.0,
        )
        gain = 1.0 / progress_per_step - 1.0
        command = desired + gain * (desired - measured) + self._integral_term
        command = np.clip(command, self.low, self.high)
        self._previous = desired.copy(), measured.copy(), command
        return command

    def _learn(self, measured: Array, desired: Array, start: Array, command: Array) -> None:
        """Integrate the error, and update the share of the way to a command that a step goes.

        ``wanted``, ``start`` and ``command`` are of the previous step: what was asked for, the pressure
        measured then, and what was sent.
        """
        inside = (command > self.low) & (command < self.high)
        share_integrated = min(self.integral * self.sample_time, MOST_INTEGRATED)
        self._integral_term += share_integrated * (desired - measured) * inside

        distance, progress = command - start, measured - start
        weight = np.where(np.abs(distance) > self._shortest_move, FORGETTING, 0.0)
        self._sum_distance_squared = self._sum_distance_squared + weight * (
            distance**2 - self._sum_distance_squared
        )
        self._sum_distance_times_progress = self._sum_distance_times_progress + weight * (
            distance * progress - self._sum_distance_times_progress
        )
