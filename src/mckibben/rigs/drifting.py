"""A rig whose stiffness, friction or pressure calibration changes during a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import require
from mckibben.rigs.rig import Rig

GROUPS = ("stiffness", "friction", "gain")
"""Rubber, friction, and the calibration of pressure, both commanded and measured."""


class Drifting:
    """A rig of which some parameters change at a time; its state continues.

    Parameters
    ----------
    rig : Rig
    factors : mapping of str to float
        Factors on ``stiffness``, ``friction`` and ``gain``, 0.1 to 10.
    start : float
        When they apply [s since `reset`].
    """

    def __init__(self, rig: Rig, factors: Mapping[str, float], start: float = 0.0) -> None:
        for group, factor in factors.items():
            require(group in GROUPS, "factors", group, f"one of {', '.join(GROUPS)}")
            require(0.1 <= factor <= 10.0, "factors", factor, "0.1 to 10")
        require(0.0 <= start < np.inf, "start", start, "0 s or more")
        self.rig, self.factors, self.start = rig, dict(factors), start
        self.name, self.inputs, self.outputs = rig.name, rig.inputs, rig.outputs
        self.rest_length = rig.rest_length
        self._current, self._n_steps, self._gain = rig, 0, 1.0
        self._commanded = np.array([name.startswith("pressure") for name in rig.inputs])
        self._measured = np.array(
            [name in rig.inputs and "pressure" in name for name in rig.outputs]
        )

    def limits(self, name: str) -> Any:
        """Return the rig's limits of an input channel."""
        return self.rig.limits(name)

    def changed(self, settings: Mapping[str, Any]) -> Drifting:
        """Return this plant with other settings of its rig."""
        return Drifting(self.rig.changed(settings), self.factors, self.start)

    def reset(self, seed: int = 0) -> Array:
        """Bring the rig to rest without changes, and return the first measurement."""
        self._current, self._n_steps, self._gain = self.rig, 0, 1.0
        measured = self.rig.reset(seed)
        self._update()
        return self._read(measured)

    def step(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Hold commands for one sample time, apply changes, and return the next measurement."""
        if isinstance(action, Mapping):
            action = {
                name: value * self._gain if name.startswith("pressure") else value
                for name, value in action.items()
            }
        else:
            action = np.where(self._commanded, self._gain, 1.0) * np.asarray(action, dtype=float)
        measured = self._read(self._current.step(action))
        self._n_steps += 1
        self._update()
        return measured

    def _read(self, measured: Array) -> Array:
        """Return the readings of sensors with the changed calibration."""
        return np.where(self._measured, measured / self._gain, measured)

    def _update(self) -> None:
        """Apply the changes once their time has come."""
        if self._current is self.rig and self._n_steps * self.rig.sample_time >= self.start:
            muscles = {name: x for name, x in self.factors.items() if name != "gain"}
            self._current = self.rig.aged(muscles)
            self._gain = self.factors.get("gain", 1.0)
