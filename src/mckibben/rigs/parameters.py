"""Parameters of a rig: every number with its meaning, unit and range.

A rig's file (TOML) holds these sections; see `mckibben.rigs.files`.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from mckibben.rigs.physics.air import AIR
from mckibben.rigs.physics.braid import NEUTRAL_ANGLE, braid_constants
from mckibben.rigs.physics.muscle import MOST_BRANCHES, MOST_ELEMENTS, MUSCLE

Records = NDArray[np.void]


def parameter(meaning: str, unit: str = "", **limits: Any) -> Any:
    """Return a field with its meaning, unit and limits (``ge``, ``gt``, ``le``, ``lt``)."""
    return Field(description=meaning, json_schema_extra={"unit": unit}, **limits)


Each = Annotated[float, Field(ge=0)]
EachPositive = Annotated[float, Field(gt=0)]


class Section(BaseModel):
    """One section of a rig's file; frozen, without unknown fields."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=False
    )


class Friction(Section):
    """Friction between braid and bladder, and between threads: elasto-plastic elements in parallel."""

    stiffness: tuple[EachPositive, ...] = parameter(
        "presliding stiffness of each element", "N/mm", max_length=MOST_ELEMENTS
    )
    contracting: tuple[Each, ...] = parameter(
        "limit of each element in contraction, per bar", "N/bar"
    )
    extending: tuple[Each, ...] = parameter("limit of each element in extension, per bar", "N/bar")
    preload: float = parameter(
        "contact pressure of braid and bladder without air", "bar", ge=0, le=5
    )
    viscosity: float = parameter("viscous resistance", "N s/mm", ge=0, le=100)

    @model_validator(mode="after")
    def _same_lengths(self) -> Self:
        if not len(self.stiffness) == len(self.contracting) == len(self.extending):
            raise ValueError("stiffness, contracting and extending need one number an element each")
        return self


class Creep(Section):
    """Creep and relaxation of the bladder: Maxwell branches in parallel."""

    stiffness: tuple[EachPositive, ...] = parameter(
        "stiffness of each branch", "N/mm", max_length=MOST_BRANCHES
    )
    time: tuple[EachPositive, ...] = parameter("time constant of each branch", "s")

    @model_validator(mode="after")
    def _same_lengths(self) -> Self:
        if len(self.stiffness) != len(self.time):
            raise ValueError("stiffness and time need one number a branch each")
        return self


class Muscle(Section):
    """A muscle: a bladder in a braid. Contractile below 54.7 degrees braid angle, extensor above."""

    kind: Literal["contractile", "extensor"] = parameter("what it does under pressure")
    length: float = parameter("length at rest", "mm", ge=10, le=5000)
    diameter: float = parameter("diameter of the braid at rest", "mm", ge=1, le=200)
    braid_angle: float = parameter(
        "angle between threads and axis at rest", "degrees", ge=10, le=80
    )
    end_cap: float = parameter(
        "factor on contraction for the end caps; 1 for a cylinder", ge=0.7, le=2
    )
    contact_pressure: float = parameter(
        "pressure at which the bladder meets the braid", "bar", ge=0, le=3
    )
    wall: float = parameter("thickness of the bladder", "mm", gt=0, le=20)
    c10: float = parameter("first Mooney-Rivlin constant of the bladder", "N/mm²", ge=0, le=20)
    c01: float = parameter("second Mooney-Rivlin constant", "N/mm²", ge=0, le=20, default=0.0)
    push: float = parameter("buckling force", "N", ge=0, le=1e6, default=0.0)
    friction: Friction
    creep: Creep

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if (self.kind == "contractile") != (self.braid_angle < NEUTRAL_ANGLE):
            side = "below" if self.kind == "contractile" else "above"
            raise ValueError(
                f"a braid angle of {self.braid_angle:g} degrees makes no {self.kind} muscle: "
                f"it has to be {side} {NEUTRAL_ANGLE:.1f} degrees"
            )
        if 2 * self.wall >= self.diameter:
            raise ValueError(
                f"wall {self.wall:g} mm fills the diameter of {self.diameter:g} mm: "
                f"it has to be below {self.diameter / 2:g} mm"
            )
        if self.c10 + self.c01 == 0:
            raise ValueError("c10 and c01 are both 0: a bladder has some stiffness")
        return self

    def record(self) -> Records:
        """Return the muscle as the compiled physics reads it, shape (1,)."""
        a, b = braid_constants(self.braid_angle)
        radius, inner = self.diameter / 2, self.diameter / 2 - self.wall
        rubber = math.pi * (radius**2 - inner**2) * self.length
        angle = math.radians(self.braid_angle)
        made = np.zeros(1, MUSCLE)
        made["length"] = self.length
        made["area"] = math.pi * radius**2
        made["a"], made["b"] = a, b
        made["end_cap"] = self.end_cap
        made["contact"] = self.contact_pressure
        made["room"] = math.pi * inner**2 * self.length
        # Wide enough for the air's room to grow with pressure, whatever the length.
        made["folded"] = max(self.contact_pressure, 1e-3) * made["room"]
        made["cos2"], made["sin2"] = math.cos(angle) ** 2, math.sin(angle) ** 2
        made["c10"], made["c01"] = self.c10 * rubber, self.c01 * rubber
        n = len(self.friction.stiffness)
        made["n_elements"] = n
        made["friction"][0, :n] = self.friction.stiffness
        made["contracting"][0, :n] = self.friction.contracting
        made["extending"][0, :n] = self.friction.extending
        made["preload"] = self.friction.preload
        made["viscosity"] = self.friction.viscosity
        n = len(self.creep.time)
        made["n_branches"] = n
        made["creep"][0, :n] = self.creep.stiffness
        made["creep_time"][0, :n] = self.creep.time
        made["push"] = self.push if self.kind == "contractile" else np.inf
        return made


AGEING = {
    "stiffness": ("c10", "c01", "creep.stiffness"),
    "friction": ("friction.contracting", "friction.extending"),
}
"""What of a muscle changes in months: rubber, and how threads rub. Presliding is thread, and stays."""


class Air(Section):
    """A proportional pressure regulator, its supply and its line to a muscle."""

    supply: float = parameter("pressure of the supply", "bar", gt=0, le=20)
    fill: float = parameter("sonic conductance of the way in (ISO 6358)", "l/(s bar)", gt=0, le=100)
    vent: float = parameter("sonic conductance of the way out", "l/(s bar)", gt=0, le=100)
    critical_ratio: float = parameter(
        "pressure ratio at which flow chokes", ge=0, le=0.9, default=0.3
    )
    valve_time: float = parameter("time constant of the valve", "s", ge=0.001, le=1)
    gain: float = parameter("opening per bar of pressure error", "1/bar", gt=0, le=100)
    dead_band: float = parameter("dead band of the pressure error", "bar", ge=0, le=1)
    line: float = parameter(
        "resistance of the line to the muscle, the inverse of its sonic conductance; pressure is "
        "measured at the regulator",
        "s bar/l",
        ge=0,
        le=10,
        default=0.0,
    )
    dead_volume: float = parameter("air in line and fittings", "ml", ge=0, le=10000)
    polytropic: float = parameter("exponent of the change of state", ge=1, le=1.4, default=1.1)

    def record(self) -> Records:
        """Return the regulator as the compiled physics reads it, shape (1,)."""
        made = np.zeros(1, AIR)
        for name in type(self).model_fields.keys() - {"dead_volume"}:
            made[name] = getattr(self, name)
        made["dead_room"] = self.dead_volume * 1e3
        return made


class Sensor(Section):
    """Errors of a sensor, in the unit of its channel."""

    noise: float = parameter("standard deviation of white noise", ge=0, default=0.0)
    resolution: float = parameter("resolution", ge=0, default=0.0)
    offset: float = parameter("constant offset", default=0.0)


class Range(Section):
    """Lowest and highest value of a command."""

    low: float = parameter("lowest", default=0.0)
    high: float = parameter("highest")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"high {self.high:g} is not above low {self.low:g}")
        return self
