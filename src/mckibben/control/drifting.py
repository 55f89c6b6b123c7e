"""Drifting plants: changes of stiffness, friction, and pressure calibration during a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.control.roles import Plant, rest_length_of
from mckibben.errors import require

GROUPS = ("stiffness", "friction", "gain")
"""What drifts: rubber, friction, and the calibration of pressure, commanded and measured alike."""

PART = 1e-4
"""Relative size of one step of drift."""


class Ageing(Plant, Protocol):
    """A plant whose muscles can age while it runs, such as rigs."""

    @property
    def sample_time(self) -> float:
        """Sample time [s]."""

    def aged(self, factors: Mapping[str, float]) -> Self:
        """Return the plant in its current state with scaled stiffness and friction."""


@dataclass(frozen=True)
class Drift:
    """Change of a group by a factor, linear in time or at once.

    Parameters
    ----------
    group : {"stiffness", "friction", "gain"}
    factor : float
        At the end, of what it was.
    start : float
        When it begins [s since `Drifting.reset`].
    over : float
        How long it takes [s]; 0 is a step.
    """

    group: str
    factor: float
    start: float = 0.0
    over: float = 0.0

    def __post_init__(self) -> None:
        require(self.group in GROUPS, "group", self.group, f"one of {', '.join(GROUPS)}")
        require(0.1 <= self.factor <= 10.0, "factor", self.factor, "0.1 to 10")
        for name, time in (("start", self.start), ("over", self.over)):
            require(0.0 <= time < np.inf, name, time, "0 s or more")

    def at(self, time: float) -> float:
        """Return the factor at a time [s], in steps of `PART`."""
        if self.over > 0.0:
            share = min(max((time - self.start) / self.over, 0.0), 1.0)
        else:
            share = float(time >= self.start)
        if share == 1.0:
            return self.factor
        return 1.0 + PART * round(share * (self.factor - 1.0) / PART)


class Drifting:
    """A rig of which some parameters drift while it runs.

    What it remembers, as forces in its friction, it keeps.

    Parameters
    ----------
    rig : Ageing
    drifts : sequence of Drift
        Several of one group multiply.
    """

    def __init__(self, rig: Ageing, drifts: Sequence[Drift]) -> None:
        self.fresh, self.drifts = rig, tuple(drifts)
        self.name, self.inputs, self.outputs = rig.name, rig.inputs, rig.outputs
        self.rest_length = rest_length_of(rig)
        self._now, self._steps = rig, 0
        self._factors = dict.fromkeys(GROUPS, 1.0)
        self._pressed = np.array([name.startswith("pressure") for name in rig.inputs])
        self._felt = np.array([name in rig.inputs and "pressure" in name for name in rig.outputs])

    @property
    def factors(self) -> Mapping[str, float]:
        """Current factor of every group."""
        return dict(self._factors)

    def limits(self, name: str) -> Any:
        """Return the rig's limits of an input channel."""
        return self.fresh.limits(name)

    def changed(self, settings: Mapping[str, Any]) -> Drifting:
        """Return this plant with other settings of its rig."""
        return Drifting(self.fresh.changed(settings), self.drifts)

    def reset(self, seed: int = 0) -> Array:
        """Reset all drift, bring the rig to rest, and return the first measurement."""
        self._now, self._steps = self.fresh, 0
        self._factors = dict.fromkeys(GROUPS, 1.0)
        measured = self.fresh.reset(seed)
        self._age()
        return self._shown(measured)

    def step(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Hold commands for one sample time, apply drift, and return the next measurement."""
        gain = self._factors["gain"]
        if isinstance(action, Mapping):
            action = {
                name: value * gain if name.startswith("pressure") else value
                for name, value in action.items()
            }
        elif gain != 1.0:
            action = np.where(self._pressed, gain, 1.0) * np.asarray(action, dtype=float)
        shown = self._shown(self._now.step(action))
        self._steps += 1
        self._age()
        return shown

    def _shown(self, measured: Array) -> Array:
        """Return the readings of sensors with drifted calibration."""
        return np.where(self._felt, measured / self._factors["gain"], measured)

    def _age(self) -> None:
        """Apply the drift until now."""
        time = self._steps * self.fresh.sample_time
        factors = dict.fromkeys(GROUPS, 1.0)
        for drift in self.drifts:
            factors[drift.group] *= drift.at(time)
        muscles = {group: factors[group] for group in ("stiffness", "friction")}
        if any(self._factors[group] != factor for group, factor in muscles.items()):
            self._now = self.fresh.aged(muscles)
        self._factors = factors
