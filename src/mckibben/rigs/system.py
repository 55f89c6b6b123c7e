"""The data of a rig for the compiled physics: parameters, demands, states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.rigs.physics.motion import MOTION, march
from mckibben.rigs.physics.muscle import MUSCLE_STATE

Records = NDArray[np.void]

SETTLING_SHARE = 0.3
"""Share of the settling time in which pressure and load rise; the rest is waited."""


class State(NamedTuple):
    """State of a system: of its muscles, and of its coordinates."""

    muscles: Records
    motion: Records

    def copy(self) -> State:
        """Return an independent copy."""
        return State(self.muscles.copy(), self.motion.copy())


class System(NamedTuple):
    """Muscles, regulator and mechanism, as data of the compiled physics."""

    muscles: Records
    air: Records
    mechanism: Records

    def as_made(self) -> State:
        """Return the state before switching on: as mounted, stretched or slack."""
        muscles = np.zeros(self.muscles.size, MUSCLE_STATE)
        muscles["x"] = np.minimum(self.muscles["offset"], 0.0)
        return State(muscles, np.zeros(1, MOTION))

    def run(
        self, state: State, demands: Demands, sample_time: float, longest_step: float, held: bool
    ) -> Traces:
        """March through all samples, changing the state; see `mckibben.rigs.physics.motion.march`."""
        n, m = int(self.mechanism["n"][0]), self.muscles.size
        rows = np.empty((len(demands.commands), 2 * n + 3 * m))
        steps = max(int(np.ceil(sample_time / longest_step - 1e-9)), 1)
        march(
            *self,
            *state,
            np.ascontiguousarray(demands.commands),
            np.ascontiguousarray(demands.loads),
            np.ascontiguousarray(demands.targets),
            held,
            steps,
            sample_time / steps,
            rows,
        )
        return Traces(rows, n, m)

    def switched_on(self, demands: Demands, time: float, longest_step: float) -> State:
        """Return the settled state after a slow rise of pressure and load.

        ``demands`` has two samples: off, and at rest.
        """
        state = self.as_made()
        weight = self.mechanism["weight"][0, : demands.loads.shape[1]]
        loads = demands.loads.copy()
        loads[0] -= weight
        rising = Demands(demands.commands, loads, demands.targets)
        waiting = Demands(*(column[[1, 1]] for column in demands))
        self.run(state, rising, SETTLING_SHARE * time, longest_step, held=False)
        self.run(state, waiting, (1.0 - SETTLING_SHARE) * time, longest_step, held=False)
        return state


class Demands(NamedTuple):
    """Demands at every sample: commands, loads on the coordinates, drive's target."""

    commands: Array
    loads: Array
    targets: Array


class Traces:
    """Measurable quantities at every sample; see `mckibben.rigs.physics.motion.march`."""

    def __init__(self, rows: Array, n_coordinates: int, n_muscles: int) -> None:
        n, m = n_coordinates, n_muscles
        ends = np.cumsum([n, n, m, m])
        parts = np.split(rows, ends, axis=1)
        self.place, self.acceleration, self.pressure, self.tension, self.room = parts
