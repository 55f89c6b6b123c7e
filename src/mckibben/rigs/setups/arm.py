"""A soft arm: contractile muscles round an extensor, between two discs.

The arm bends with constant curvature. Its coordinates are the shortening of its middle [mm] and the
tilts of the disc about two axes [rad]; a muscle at radius d and angle b shortens by
middle + d (cos(b) tilt_x + sin(b) tilt_y). Axial pull stands against the extensor and the other
muscles, tilt against the backbone, whose stiffness grows with the extensor's pressure. Muscles are
tied to the extensor, which presses on their braids.

Set-up of: Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator, Section 2.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from mckibben.arrays import Array
from mckibben.rigs.parameters import EachPositive, Muscle, Section, parameter
from mckibben.rigs.physics.compiled import GRAVITY
from mckibben.rigs.physics.motion import MECHANISM, TOLERANCE
from mckibben.rigs.rig import Rig
from mckibben.rigs.system import Demands, System, Traces


class Spread(Section):
    """Differences of hand-made muscles from the nominal one: a factor for each."""

    diameter: tuple[EachPositive, ...] = parameter("factor on the diameter of each")
    bladder: tuple[EachPositive, ...] = parameter("factor on the bladder's stiffness of each")
    friction: tuple[EachPositive, ...] = parameter("factor on the friction of each")


class Arm(Rig):
    """Three or more contractile muscles in parallel round one extensor."""

    setup: Literal["arm"] = "arm"
    muscle: Muscle
    extensor: Muscle
    spread: Spread
    radius: tuple[EachPositive, ...] = parameter("distance of each muscle from the middle", "mm")
    angle: tuple[float, ...] = parameter("place of each muscle round the middle", "degrees")
    bending_stiffness: float = parameter("of the arm without pressure", "N mm/rad", gt=0)
    bending_stiffening: float = parameter("added per bar in the extensor", "N mm/(rad bar)", ge=0)
    bending_friction: float = parameter("dry friction of bending", "N mm", ge=0, default=0.0)
    bending_presliding: float = parameter("its presliding stiffness", "N mm/rad", gt=0, default=1e5)
    bending_damping: float = parameter(
        "viscous damping of bending", "N mm s/rad", ge=0, default=0.0
    )
    contact: float = parameter(
        "share of the extensor's pressure on muscle braids", ge=0, le=1, default=0.0
    )
    disc_mass: float = parameter("mass of the lower disc", "kg", gt=0, le=50)
    payload: float = parameter("mass hung on the disc", "kg", ge=0, le=50, default=0.0)

    measurable: ClassVar[tuple[str, ...]] = ("pressure", "displacement")

    @model_validator(mode="after")
    def _one_number_a_muscle(self) -> Self:
        n = len(self.radius)
        lists = (self.angle, self.spread.diameter, self.spread.bladder, self.spread.friction)
        if n < 2 or any(len(numbers) != n for numbers in lists):
            raise ValueError(
                f"radius names {n} muscle(s); angle and every list of spread need as many, "
                "and an arm at least 2"
            )
        if self.muscle.kind != "contractile" or self.extensor.kind != "extensor":
            raise ValueError("an arm has contractile muscles round an extensor, by their kind")
        return self

    @property
    def inputs(self) -> tuple[str, ...]:
        """Pressures of the contractile muscles, then of the extensor."""
        return (*(f"pressure_{k + 1}" for k in np.arange(len(self.radius))), "pressure_extensor")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Pressures as measured, and the shortening of each contractile muscle."""
        moves = (f"displacement_{k + 1}" for k in np.arange(len(self.radius)))
        names = {"pressure": self.inputs, "displacement": tuple(moves)}
        return tuple(name for kind in self.sensor for name in names[kind])

    def build(self) -> System:
        angles = np.radians(self.angle)
        made = [
            self.muscle.model_copy(
                update={
                    "diameter": self.muscle.diameter * self.spread.diameter[k],
                    "c10": self.muscle.c10 * self.spread.bladder[k],
                    "c01": self.muscle.c01 * self.spread.bladder[k],
                    "friction": self.muscle.friction.model_copy(
                        update={
                            name: tuple(
                                limit * self.spread.friction[k]
                                for limit in getattr(self.muscle.friction, name)
                            )
                            for name in ("contracting", "extending")
                        }
                    ),
                }
            ).record()
            for k in np.arange(len(self.radius))
        ]
        muscles = np.concatenate([*made, self.extensor.record()])
        muscles["levers"][:, 0] = 1.0
        muscles["levers"][:-1, 1] = np.array(self.radius) * np.cos(angles)
        muscles["levers"][:-1, 2] = np.array(self.radius) * np.sin(angles)
        muscles["neighbour"][:-1] = self.contact
        mechanism = np.zeros(1, MECHANISM)
        mass = self.disc_mass + self.payload
        length = self.muscle.length
        # A tilt t moves the disc aside by length t/2 and lifts it by length t²/6.
        mechanism["n"] = 3
        mechanism["tolerance"] = TOLERANCE
        mechanism["mass"] = [1e-3 * mass, *[1e-3 * mass * length**2 / 4] * 2]
        lifting = mass * GRAVITY * length / 3
        mechanism["stiffness"] = [0.0, *[self.bending_stiffness + lifting] * 2]
        mechanism["stiffening"] = [0.0, *[self.bending_stiffening] * 2]
        mechanism["stiffened_by"] = len(self.radius)
        mechanism["damping"] = [0.0, *[self.bending_damping] * 2]
        mechanism["weight"] = [mass * GRAVITY, 0.0, 0.0]
        mechanism["guide"] = [1.0, *[self.bending_presliding] * 2]
        mechanism["guide_limit"] = [0.0, *[self.bending_friction] * 2]
        return System(muscles, self.air.record(), mechanism)

    def demands(self, inputs: Array) -> Demands:
        return Demands(inputs, np.zeros((len(inputs), 3)), np.zeros(len(inputs)))

    def readings(self, traces: Traces, inputs: Array, zero: Array) -> Mapping[str, Array]:
        """Return pressures, and the shortening along each contractile muscle."""
        del inputs
        levers = self._built().muscles["levers"][:-1]
        shortened = (traces.place - zero[: traces.place.shape[1]]) @ levers.T
        found = {name: traces.pressure[:, i] for i, name in enumerate(self.inputs)}
        return found | {
            f"displacement_{k + 1}": shortened[:, k] for k in np.arange(len(self.radius))
        }

    def known(self) -> Mapping[str, Any]:
        return {"rest_length": self.muscle.length, "payload_kg": self.payload}
