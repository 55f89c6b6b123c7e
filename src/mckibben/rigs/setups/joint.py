"""A joint: two muscles pull against each other over a pulley that carries an arm.

The coordinate is the angle of the arm [rad], positive where muscle 1 has shortened. A tendon that runs
on the pulley at radius r shortens the first muscle by slack + r angle, the second by slack - r angle;
where a muscle is longer than that, its tendon is slack and carries no force, as a tendon can only pull.

    inertia d²angle/dt² = r1 F1 - r2 F2 - weight sin(angle - hanging) - friction - torque

as of an elbow on a test bench (Chou and Hannaford, IEEE Transactions on Robotics and Automation 12(1),
1996; Tondu and Lopez, IEEE Control Systems Magazine 20(2), 2000).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from mckibben.arrays import Array
from mckibben.rigs.parameters import EachPositive, Muscle, parameter
from mckibben.rigs.physics.compiled import GRAVITY
from mckibben.rigs.physics.motion import MECHANISM, NO_MUSCLE
from mckibben.rigs.rig import Rig
from mckibben.rigs.system import Demands, System, Traces

SIGNS = (1.0, -1.0)
"""Of the angle, by which each muscle shortens."""

METRE = 1e3
"""In mm."""

TOLERANCE = 1e-13
"""A Newton move below this ends the search [rad]: torques balance within 1e-6 N m at an inertia of
0.1 kg m².
"""


class Joint(Rig):
    """Two contractile muscles against each other on a pulley, with an arm.

    Where ``range`` has a ``torque``, that is a third input: what turns the arm against muscle 1, besides
    its weight.
    """

    setup: Literal["joint"] = "joint"
    muscle_1: Muscle
    muscle_2: Muscle
    radius: tuple[EachPositive, EachPositive] = parameter(
        "radius of the pulley at the tendon of each muscle", "mm"
    )
    slack: tuple[float, float] = parameter(
        "how far each muscle shortens before its tendon pulls, at angle 0; below 0 it is stretched",
        "mm",
    )
    arm_mass: float = parameter("mass of the arm", "kg", ge=0, le=100)
    arm_centre: float = parameter("distance of its centre from the axis", "mm", ge=0, le=2000)
    arm_inertia: float = parameter("inertia of arm and pulley", "kg m²", gt=0, le=100)
    payload: float = parameter("mass at the arm", "kg", ge=0, le=100, default=0.0)
    reach: float = parameter("distance of the payload from the axis", "mm", ge=0, le=2000)
    vertical: bool = parameter("whether the arm moves in a vertical plane", default=True)
    hanging: float = parameter("angle at which the arm hangs straight down", "degrees", default=0.0)
    friction: float = parameter("dry friction of the bearing", "N mm", ge=0, default=0.0)
    presliding: float = parameter("its presliding stiffness", "N mm/rad", gt=0, default=1e5)
    damping: float = parameter("viscous damping of the bearing", "N mm s/rad", ge=0, default=0.0)

    measurable: ClassVar[tuple[str, ...]] = ("pressure", "angle", "torque", "force")

    @model_validator(mode="after")
    def _both_pull(self) -> Self:
        if {self.muscle_1.kind, self.muscle_2.kind} != {"contractile"}:
            raise ValueError("muscle_1 and muscle_2 pull on tendons: both are contractile")
        return self

    @property
    def inputs(self) -> tuple[str, ...]:
        """Both pressures, and torque if a load can be applied."""
        return ("pressure_1", "pressure_2", *(("torque",) if "torque" in self.range else ()))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Measured channels: pressures and tendon forces are of two muscles."""
        each = {"pressure": ("pressure_1", "pressure_2"), "force": ("force_1", "force_2")}
        kinds = (kind for kind in self.measurable if kind in self.sensor)
        return tuple(name for kind in kinds for name in each.get(kind, (kind,)))

    def build(self) -> System:
        """Return two muscles on one coordinate, the angle, and the arm as a pendulum."""
        muscles = np.concatenate([self.muscle_1.record(), self.muscle_2.record()])
        muscles["levers"][:, 0] = np.multiply(SIGNS, self.radius)
        muscles["offset"] = self.slack
        made = np.zeros(1, MECHANISM)
        made["n"] = 1
        made["tolerance"] = TOLERANCE
        inertia = METRE**2 * self.arm_inertia + self.payload * self.reach**2  # kg mm²
        made["mass"][0, 0, 0] = 1e-3 * inertia
        moment = self.arm_mass * self.arm_centre + self.payload * self.reach
        made["swing"][0, 0] = GRAVITY * moment if self.vertical else 0.0
        made["hanging"][0, 0] = math.radians(self.hanging)
        made["guide_stiffness"][0, 0] = self.presliding
        made["guide_limit"][0, 0] = self.friction
        made["damping"][0, 0] = self.damping
        made["stiffened_by"] = NO_MUSCLE
        return System(muscles, self.air.record(), made)

    def demands(self, inputs: Array) -> Demands:
        return Demands(inputs[:, :2], METRE * self._torque(inputs), np.zeros(len(inputs)))

    def readings(self, traces: Traces, inputs: Array, zero: Array) -> Mapping[str, Array]:
        """Return pressures, angle, tendon forces, and the torque that loads the arm [N m].

        The torque is the one applied, with weight and inertia of the payload.
        """
        angle, acceleration = traces.place[:, 0], traces.acceleration[:, 0]
        reach = self.reach / METRE
        weight = GRAVITY * np.sin(angle - math.radians(self.hanging)) if self.vertical else 0.0
        carried = self.payload * reach * (weight + reach * acceleration)
        return {
            **{f"pressure_{k + 1}": traces.pressure[:, k] for k in (0, 1)},
            "angle": angle - zero[0],
            "torque": self._torque(inputs)[:, 0] + carried,
            **{f"force_{k + 1}": traces.tension[:, k] for k in (0, 1)},
        }

    def known(self) -> Mapping[str, Any]:
        return {"payload_kg": self.payload}

    def _torque(self, inputs: Array) -> Array:
        """Return the applied torque [N m], shape (n, 1): 0 where none can be."""
        return inputs[:, 2:] if "torque" in self.range else np.zeros((len(inputs), 1))
