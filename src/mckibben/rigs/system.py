"""A rig as the compiled physics sees it: what it is, what is asked of it, what it does."""

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
    """What a system remembers: its muscles' records, and its coordinates'."""

    muscles: Records
    motion: Records

    def copy(self) -> State:
        """Return a copy that shares nothing."""
        return State(self.muscles.copy(), self.motion.copy())


class System(NamedTuple):
    """Muscles, regulator and mechanism, as the compiled physics reads them."""

    muscles: Records
    air: Records
    mechanism: Records

    def as_made(self) -> State:
        """Return the state before anything was switched on."""
        return State(np.zeros(self.muscles.size, MUSCLE_STATE), np.zeros(1, MOTION))

    def run(
        self, state: State, demands: Demands, sample_time: float, longest_step: float, held: bool
    ) -> Traces:
        """March through all samples, changing the state; see `mckibben.rigs.physics.motion.march`."""
        n, m = int(self.mechanism["n"][0]), self.muscles.size
        rows = np.empty((len(demands.commands), 2 * n + 4 * m))
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
        """Return the state after pressure and load have come slowly and all has settled.

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
    """What drives the physics at every sample: commands, loads on the coordinates, drive's target."""

    commands: Array
    loads: Array
    targets: Array


class Traces:
    """What sensors could see at every sample, by name; see `mckibben.rigs.physics.motion.march`."""

    def __init__(self, rows: Array, n_coordinates: int, n_muscles: int) -> None:
        n, m = n_coordinates, n_muscles
        ends = np.cumsum([n, n, m, m, m])
        parts = np.split(rows, ends, axis=1)
        self.place, self.acceleration, self.pressure, self.tension, self.room, self.warmth = parts
