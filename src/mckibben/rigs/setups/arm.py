"""A soft arm: contractile muscles round an extensor, between two discs.

The arm bends with constant curvature. Its coordinates are the shortening of its middle [mm] and the
tilts of the disc about two axes [rad]; a muscle at radius d and angle b shortens by
middle + d (cos(b) tilt_x + sin(b) tilt_y). Axial pull stands against the extensor and the other
muscles, tilt against the backbone, whose stiffness grows with the extensor's pressure. Muscles are
tied to the extensor, which presses on their braids. Arms of several sections are bundles in series.

Set-up of: Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator, Section 2.1.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from mckibben.arrays import Array
from mckibben.rigs.parameters import EachPositive, Muscle, Records, Section, parameter
from mckibben.rigs.physics.compiled import GRAVITY
from mckibben.rigs.physics.motion import MECHANISM, TOLERANCE
from mckibben.rigs.rig import Rig
from mckibben.rigs.system import Demands, System, Traces


class Spread(Section):
    """Differences of hand-made muscles from the nominal one: a factor for each."""

    diameter: tuple[EachPositive, ...] = parameter("factor on the diameter of each")
    bladder: tuple[EachPositive, ...] = parameter("factor on the bladder's stiffness of each")
    friction: tuple[EachPositive, ...] = parameter("factor on the friction of each")


N_COORDINATES = 3
"""Coordinates of a section: shortening of its middle, and tilts of its lower disc about two axes."""


class Bundle(Section):
    """Two or more contractile muscles in parallel round one extensor, between two discs."""

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

    def contractile(self) -> Records:
        """Return its contractile muscles, with levers on its own coordinates, shape (muscles,)."""
        angles, radius = np.radians(self.angle), np.array(self.radius)
        muscles = np.concatenate([self._spread(k).record() for k, _ in enumerate(self.radius)])
        muscles["levers"][:, 0] = 1.0
        muscles["levers"][:, 1] = radius * np.cos(angles)
        muscles["levers"][:, 2] = radius * np.sin(angles)
        muscles["neighbour"] = self.contact
        return muscles

    def _spread(self, k: int) -> Muscle:
        """Return a muscle as it was made by hand."""
        friction, factor = self.muscle.friction, self.spread.friction[k]
        limits = {
            name: tuple(limit * factor for limit in getattr(friction, name))
            for name in ("contracting", "extending")
        }
        bladder = self.spread.bladder[k]
        changes = {
            "diameter": self.muscle.diameter * self.spread.diameter[k],
            "c10": self.muscle.c10 * bladder,
            "c01": self.muscle.c01 * bladder,
            "friction": friction.model_copy(update=limits),
        }
        return self.muscle.model_copy(update=changes)


def in_series(bundles: Sequence[Bundle], payload: float) -> tuple[Records, Records]:
    """Return muscles and mechanism of bundles that hang from one another.

    Coordinates are three a bundle: shortening of its middle, and tilts of its lower disc from its
    upper one.

    Parameters
    ----------
    bundles : sequence of Bundle
        From above.
    payload : float
        Mass hung on the last disc [kg].

    Returns
    -------
    muscles, mechanism
        Contractile muscles, bundle by bundle, then the extensors.
    """
    n = len(bundles)
    contractile = [bundle.contractile() for bundle in bundles]
    extensors = np.concatenate([bundle.extensor.record() for bundle in bundles])
    extensors["levers"][:, 0] = 1.0
    first = sum(muscles.size for muscles in contractile)
    for i, muscles in enumerate(contractile):
        muscles["beside"] = first + i
        for records in (muscles, extensors[i : i + 1]):
            records["levers"] = np.roll(records["levers"], N_COORDINATES * i, axis=1)
    mechanism = np.zeros(1, MECHANISM)
    mechanism["n"] = N_COORDINATES * n
    mechanism["tolerance"] = TOLERANCE
    masses = [bundle.disc_mass for bundle in bundles]
    masses[-1] += payload
    _weigh(mechanism, masses, [bundle.muscle.length for bundle in bundles])
    for i, bundle in enumerate(bundles):
        tilts = np.arange(N_COORDINATES * i + 1, N_COORDINATES * (i + 1))
        mechanism["stiffness"][0, tilts, tilts] += bundle.bending_stiffness
        mechanism["stiffening"][0, tilts] = bundle.bending_stiffening
        mechanism["stiffened_by"][0, tilts] = first + i
        mechanism["damping"][0, tilts] = bundle.bending_damping
        mechanism["guide_stiffness"][0, N_COORDINATES * i] = 1.0
        mechanism["guide_stiffness"][0, tilts] = bundle.bending_presliding
        mechanism["guide_limit"][0, tilts] = bundle.bending_friction
    return np.concatenate([*contractile, extensors]), mechanism


def _weigh(mechanism: Records, masses: Sequence[float], lengths: Sequence[float]) -> None:
    """Set weight and inertia of discs [kg] below sections of some lengths [mm].

    To second order, a section whose upper disc is tilted by T, and its lower one by t from there, lifts
    what it carries by length (T²/2 + T t/2 + t²/6), and moves it aside by length (T + t/2). So a tilt
    turns gravity for all that hangs below, and what hangs aside bends what is above.
    """
    n = len(masses)
    tilt_stiffness, tilt_inertia, axial_inertia = np.zeros((3, n, n))
    for i, length in enumerate(lengths):
        weight = sum(masses[i:]) * GRAVITY
        mechanism["weight"][0, N_COORDINATES * i] = weight
        tilt_stiffness[:i, :i] += weight * length
        tilt_stiffness[:i, i] = tilt_stiffness[i, :i] = weight * length / 2
        tilt_stiffness[i, i] = weight * length / 3
        levers = np.zeros(n)
        levers[: i + 1] = [lengths[k] / 2 + sum(lengths[k + 1 : i + 1]) for k in range(i + 1)]
        tilt_inertia += 1e-3 * masses[i] * np.outer(levers, levers)
        axial_inertia[: i + 1, : i + 1] += 1e-3 * masses[i]
    axial, tilts = np.diag([1.0, 0.0, 0.0]), np.diag([0.0, 1.0, 1.0])
    size = N_COORDINATES * n
    mechanism["mass"][0, :size, :size] = np.kron(axial_inertia, axial) + np.kron(
        tilt_inertia, tilts
    )
    mechanism["stiffness"][0, :size, :size] = np.kron(tilt_stiffness, tilts)


class Hanging(Rig):
    """Sections that hang from one another, with a load on the last."""

    payload: float = parameter("mass hung on the last disc", "kg", ge=0, le=50, default=0.0)

    measurable: ClassVar[tuple[str, ...]] = ("pressure", "displacement")

    @property
    @abstractmethod
    def sections(self) -> tuple[Bundle, ...]:
        """From above."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Pressures of the contractile muscles, section by section, then of the extensors."""
        return (*self._numbered("pressure"), *self.extensors)

    @property
    def extensors(self) -> tuple[str, ...]:
        """Pressures of the extensors, numbered if there are several."""
        n = len(self.sections)
        name = "pressure_extensor"
        return (name,) if n == 1 else tuple(f"{name}_{i + 1}" for i in np.arange(n))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Pressures as measured, and the shortening of each contractile muscle."""
        names = {"pressure": self.inputs, "displacement": self._numbered("displacement")}
        return tuple(name for kind in self.sensor for name in names[kind])

    def build(self) -> System:
        muscles, mechanism = in_series(self.sections, self.payload)
        return System(muscles, self.air.record(), mechanism)

    def demands(self, inputs: Array) -> Demands:
        loads = np.zeros((len(inputs), N_COORDINATES * len(self.sections)))
        return Demands(inputs, loads, np.zeros(len(inputs)))

    def readings(self, traces: Traces, inputs: Array, zero: Array) -> Mapping[str, Array]:
        """Return pressures, and the shortening along each contractile muscle."""
        del inputs
        pose = traces.place - zero[: traces.place.shape[1]]
        channels = dict(zip(self.inputs, traces.pressure.T, strict=True))
        shortening = self.shortened(pose).T
        return channels | dict(zip(self._numbered("displacement"), shortening, strict=True))

    def shortened(self, pose: Array) -> Array:
        """Return the shortening of every contractile muscle at poses.

        Parameters
        ----------
        pose : array, shape (n, 3 sections)
            Shortening of the middle [mm] and both tilts [rad] of every section, of its lower disc from
            its upper one.

        Returns
        -------
        array, shape (n, muscles)
            [mm].
        """
        levers = self._built().muscles["levers"][: -len(self.sections), : pose.shape[1]]
        return np.asarray(pose @ levers.T)

    def known(self) -> Mapping[str, Any]:
        lengths = {section.muscle.length for section in self.sections}
        rest_length = {"rest_length": lengths.pop()} if len(lengths) == 1 else {}
        return {**rest_length, "payload_kg": self.payload}

    def _numbered(self, name: str) -> tuple[str, ...]:
        """Return the channels of a quantity, one for every contractile muscle."""
        n = sum(len(section.radius) for section in self.sections)
        return tuple(f"{name}_{k + 1}" for k in np.arange(n))


class Arm(Bundle, Hanging):
    """One section."""

    setup: Literal["arm"] = "arm"

    @property
    def sections(self) -> tuple[Bundle, ...]:
        return (self,)
