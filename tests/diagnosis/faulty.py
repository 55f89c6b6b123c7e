"""A plant whose faults are known: a model with a slow regulator, dead time, noise, drift and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.base import Block


@dataclass
class Faulty:
    """A muscle that is a model of pressure to displacement, with faults beside.

    Its displacement has a gain, a drift [mm/min] and noise [mm], and is measured some samples late;
    its regulator lags [s] and follows some samples late, up to a highest pressure [bar].
    """

    muscle: Block
    gain: float = 1.0
    lag: float = 0.0
    dead: int = 0
    late: int = 0
    noise: float = 0.0
    drift: float = 0.0
    high: float = 10.0
    sample_time: float = 0.02
    name: str = "faulty"
    inputs: tuple[str, ...] = ("pressure",)
    outputs: tuple[str, ...] = ("pressure", "displacement")
    _past: list[float] = field(default_factory=list)

    def reset(self, seed: int = 0) -> Array:
        self._rng = np.random.default_rng(seed)
        self._stream = self.muscle.stream(self.sample_time)
        self._pressure, self._time = 0.0, 0.0
        self._commands = [0.0] * (self.dead + 1)
        self._moved: list[float] = []
        return self._measured()

    def step(self, action: ArrayLike | Mapping[str, float]) -> Array:
        assert isinstance(action, Mapping)
        self._commands = [*self._commands[1:], float(action["pressure"])]
        keep = np.exp(-self.sample_time / self.lag) if self.lag else 0.0
        self._pressure = keep * self._pressure + (1 - keep) * self._commands[0]
        self._time += self.sample_time
        return self._measured()

    def _measured(self) -> Array:
        (moved,) = self._stream.step(self._pressure)
        self._moved.append(self.gain * moved + self.drift * self._time / 60)
        seen = self._moved[max(len(self._moved) - 1 - self.late, 0)]
        return np.array([self._pressure, seen + self.noise * self._rng.standard_normal()])

    def limits(self, name: str) -> Any:
        assert name == "pressure"
        return SimpleNamespace(low=0.0, high=self.high)

    def changed(self, settings: Mapping[str, Any]) -> Faulty:
        return replace(self, sample_time=settings["sample_time"])
