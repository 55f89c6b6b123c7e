"""A muscle fixed at one end, with a mass at the other, hanging or on a rail."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.rigs.parameters import Muscle, parameter
from mckibben.rigs.physics.compiled import GRAVITY
from mckibben.rigs.physics.motion import MECHANISM, NO_MUSCLE, TOLERANCE
from mckibben.rigs.rig import Rig
from mckibben.rigs.system import Demands, System, Traces


class MovingEnd(Rig):
    """One muscle, driven by pressure or by the voltage of its regulator.

    Where ``range`` has a ``force``, that is a second input: what pulls at the end, besides what hangs
    on it, and so lengthens the muscle.
    """

    setup: Literal["moving-end"] = "moving-end"
    muscle: Muscle
    command: Literal["pressure", "voltage"] = parameter(
        "what drives the regulator", default="pressure"
    )
    bar_per_volt: float = parameter("pressure commanded per volt", "bar/V", gt=0, default=0.6)
    moved_mass: float = parameter("mass of slide and fittings", "kg", ge=0.01, le=100)
    vertical: bool = parameter("whether the moved mass hangs, too", default=True)
    payload: float = parameter("mass hanging from the end", "kg", ge=0, le=500, default=0.0)
    return_force: float = parameter("constant pull of springs", "N", ge=0, le=1000, default=0.0)
    guide_friction: float = parameter("dry friction of the guide", "N", ge=0, le=1000, default=0.0)
    guide_stiffness: float = parameter(
        "presliding stiffness of the guide", "N/mm", gt=0, default=100.0
    )
    damping: float = parameter("viscous damping of the guide", "N s/mm", ge=0, le=100, default=0.0)

    measurable: ClassVar[tuple[str, ...]] = ("pressure", "displacement", "force")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Pressure or voltage, and force if a load can be applied."""
        return (self.command, "force") if "force" in self.range else (self.command,)

    def build(self) -> System:
        """Return one muscle on one coordinate: the shortening of the muscle."""
        muscles = self.muscle.record()
        muscles["levers"][0, 0] = 1.0
        made = np.zeros(1, MECHANISM)
        made["n"] = 1
        made["tolerance"] = TOLERANCE
        made["mass"][0, 0, 0] = (self.moved_mass + self.payload) * 1e-3
        hanging = self.payload + (self.moved_mass if self.vertical else 0.0)
        made["weight"][0, 0] = hanging * GRAVITY + self.return_force
        made["guide_stiffness"][0, 0] = self.guide_stiffness
        made["guide_limit"][0, 0] = self.guide_friction
        made["damping"][0, 0] = self.damping
        made["stiffened_by"] = NO_MUSCLE
        return System(muscles, self.air.record(), made)

    def demands(self, inputs: Array) -> Demands:
        bars = inputs[:, :1] * (self.bar_per_volt if self.command == "voltage" else 1.0)
        pulls = inputs[:, 1:] if inputs.shape[1] > 1 else np.zeros_like(bars)
        return Demands(bars, pulls, np.zeros(len(inputs)))

    def readings(self, traces: Traces, inputs: Array, zero: Array) -> Mapping[str, Array]:
        pulled = inputs[:, 1] if inputs.shape[1] > 1 else 0.0
        carried = self.payload * (GRAVITY + 1e-3 * traces.acceleration[:, 0])
        return {
            "pressure": traces.pressure[:, 0],
            "displacement": traces.place[:, 0] - zero[0],
            "force": pulled + carried,
        }

    def known(self) -> Mapping[str, Any]:
        return {
            "rest_length": self.muscle.length,
            "diameter": self.muscle.diameter,
            "payload_kg": self.payload,
        }
