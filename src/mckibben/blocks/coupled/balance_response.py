"""Mid-range responses of muscles, loops and steps, evaluated alike for models and rigs.

Nothing is read off coefficients: pressures and loads are moved up and down, stepped and held, as one
would at a bench.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.fields import Channel

KINDS = ("reach", "width", "stiffness", "creep")
"""How far a loop moves; how far apart its branches are where the input is at the middle; range of that
input over how far it moves; share of a step's way that comes after the first second."""

AFTER = 1.0
"""Time after a step from which motion counts as creep [s]."""


@dataclass(frozen=True)
class Trial:
    """Loops of every pressure and load about mid-range, and steps of pressures.

    Parameters
    ----------
    pressures, others, outputs : tuple of Channel
        Inputs are pressures, then what loads and schedules.
    middle : array, shape (inputs,)
        Pressures rise to it from 0; all else is there from the beginning.
    swing : array, shape (inputs,)
        Amplitude of loops, height of steps; 0 of what stays.
    seconds : float
        That a loop takes, and a step is held; 0 without time, and without steps.
    """

    pressures: tuple[Channel, ...]
    others: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    middle: Array
    swing: Array
    seconds: float

    def response(self, respond: Callable[[Array], Array], quarter: int) -> Array:
        """Return the responses, shape (KINDS, inputs, outputs), in channel units; NaN without a trial.

        Parameters
        ----------
        respond : callable
            From inputs, shape (samples, inputs), to outputs, of muscles that rested before.
        quarter : int
            Samples of a quarter of a loop.
        """
        n, shape = len(self.pressures), (len(KINDS), self.middle.size, len(self.outputs))
        found = np.full(shape, np.nan)

        def moved(place: int, quarters: list[float], levels: list[float]) -> Array:
            time = np.arange(round(quarters[-1] * quarter) + 1) / quarter
            inputs = np.tile(self.middle, (time.size, 1))
            inputs[:, :n] *= np.clip(time, 0.0, 1.0)[:, np.newaxis]
            inputs[:, place] += self.swing[place] * np.interp(time, quarters, levels)
            return respond(inputs)

        for place in np.flatnonzero(self.swing).tolist():
            y = moved(place, [0, 1, 2, 4, 6, 8], [0, 0, 1, -1, 1, -1])
            reach = np.ptp(y[4 * quarter :], axis=0)
            found[0, place], found[1, place] = reach, np.abs(y[7 * quarter] - y[5 * quarter])
            found[2, place] = 2.0 * self.swing[place] / np.where(reach > 0.0, reach, np.nan)
            if place < n and self.seconds > AFTER:
                y = moved(place, [0, 5, 5 + 1 / quarter, 9], [0, 0, 1, 1])[5 * quarter :]
                after, way = AFTER / self.seconds * 4 * quarter, y[-1] - y[0]
                soon = [float(np.interp(after, np.arange(len(y)), column)) for column in y.T]
                found[3, place] = (y[-1] - soon) / np.where(way != 0.0, way, np.nan)
        return found
