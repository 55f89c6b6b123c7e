"""A rig of one's own muscle, from the numbers of its data sheet."""

from __future__ import annotations

import math

import numpy as np
from pydantic import ValidationError

from mckibben.errors import DataError, require
from mckibben.metrics import loop_width
from mckibben.recording import Recording
from mckibben.rigs.parameters import Air, Creep, Friction, Muscle, Range, Sensor
from mckibben.rigs.physics.bladder import bladder_force
from mckibben.rigs.physics.braid import braid_area
from mckibben.rigs.physics.compiled import NEWTON_PER_BAR_MM2
from mckibben.rigs.refusals import refused
from mckibben.rigs.setups.moving_end import MovingEnd
from mckibben.signals.excitations import triangle

WALL_SHARE = 0.125
"""Wall of the bladder, of its inner diameter, as in fluidic muscles of 10 to 40 mm."""

PRESLIDING = (4.0, 2.0, 1.1, 0.55)
"""Stiffness of the friction elements, of force over length."""

CONTRACTING = (0.2, 0.25, 0.25, 0.3)
EXTENDING = (0.2, 0.19, 0.145, 0.145)
"""How the elements share the friction; extension has less."""

CREEP, CREEP_TIME = (0.16, 0.1), (1.5, 25.0)
"""Stiffness of the creep branches, of force over length, and their times [s]."""

VISCOSITY = 0.02
"""Of force over length [s]."""

CONDUCTANCE_PER_ML = 0.019
"""Of the regulator, for each millilitre to fill [l/(s bar)]: a tenth of a second or so."""

LARGEST = 1e6
"""Of every number of a data sheet."""

PERIOD = 20.0
"""Period of the triangle for the desired loop width [s]."""


def rig_from_data_sheet(
    *,
    name: str,
    diameter: float,
    length: float,
    max_pressure: float,
    max_force: float,
    max_contraction: float,
    payload: float = 0.0,
    loop_width: float = 0.15,
) -> MovingEnd:
    """Return a rig with a muscle that lifts a mass.

    The braid angle follows from the force at rest length, the bladder's stiffness from the largest
    contraction, and the friction from the loop's width on a triangle of 20 s over the whole range.

    Parameters
    ----------
    name : str
        Lower-case letters, digits and dashes.
    diameter, length : float
        Inner diameter and length at rest [mm].
    max_pressure : float
        Highest pressure [bar].
    max_force : float
        Pull at rest length and the highest pressure [N].
    max_contraction : float
        Contraction at the highest pressure without load, for instance 0.25.
    payload : float
        Mass that hangs from it [kg].
    loop_width : float
        e_w of the slow loop (see `mckibben.metrics.loop_width`) as a share, 0.15 for 15 %; within 0.05
        and 0.5.

    Raises
    ------
    DataError
        On numbers that no muscle has: the text says which, and what would be possible.
    """
    for label, value in (
        ("diameter", diameter),
        ("length", length),
        ("max_pressure", max_pressure),
        ("max_force", max_force),
        ("max_contraction", max_contraction),
    ):
        require(0 < value <= LARGEST, label, value, f"a number from 0 to {LARGEST:g}", DataError)
    possible = 0.05 <= loop_width <= 0.5
    require(possible, "loop_width", loop_width, "a share from 0.05 to 0.5", DataError)
    try:
        return _rig(
            name, diameter, length, max_pressure, max_force, max_contraction, payload, loop_width
        )
    except ValidationError as error:  # in range each, but not together
        parts = {part.__name__: part for part in (Muscle, Friction, Creep, Air, Sensor, Range)}
        raise refused(error, parts.get(error.title, MovingEnd)) from None


def _rig(
    name: str,
    diameter: float,
    length: float,
    max_pressure: float,
    max_force: float,
    max_contraction: float,
    payload: float,
    loop_width: float,
) -> MovingEnd:
    scale = max_force / length
    muscle = Muscle(
        kind="contractile",
        length=length,
        diameter=diameter * (1 + 2 * WALL_SHARE),
        braid_angle=_braid_angle(diameter * (1 + 2 * WALL_SHARE), max_pressure, max_force),
        end_cap=1.0,
        contact_pressure=0.05,
        wall=diameter * WALL_SHARE,
        c10=1.0,
        friction=Friction(
            stiffness=tuple(scale * share for share in PRESLIDING),
            contracting=CONTRACTING,
            extending=EXTENDING,
            preload=0.5,
            viscosity=VISCOSITY * scale,
        ),
        creep=Creep(stiffness=tuple(scale * share for share in CREEP), time=CREEP_TIME),
    )
    muscle = muscle.model_copy(update={"c10": _stiffness(muscle, max_pressure, max_contraction)})
    volume = math.pi * diameter**2 / 4 * length * 1e-3
    conductance = max(0.3, CONDUCTANCE_PER_ML * volume)
    rig = MovingEnd(
        name=name,
        title=f"{diameter:g} mm, {length:g} mm muscle lifting {payload:g} kg",
        source="data-sheet numbers",
        sample_time=0.01,
        muscle=muscle,
        moved_mass=0.5,
        payload=payload,
        range={"pressure": Range(high=max_pressure)},
        sensor={
            "pressure": Sensor(noise=0.005, resolution=0.002),
            "displacement": Sensor(noise=1e-4 * length, resolution=5e-5 * length),
        },
        air=Air(
            supply=max_pressure + 1.0,
            fill=conductance,
            vent=conductance,
            valve_time=0.004,
            gain=0.6,
            dead_band=0.01,
            dead_volume=0.3 * volume,
        ),
    )
    return _with_loop_width(rig, loop_width, max_force / max_pressure)


def _braid_angle(diameter: float, pressure: float, force: float) -> float:
    """Return the angle at which the pull at rest is the force: a - b = 2/sin² - 3."""
    per_area = force / (NEWTON_PER_BAR_MM2 * pressure * math.pi * diameter**2 / 4)
    angle = math.degrees(math.asin(math.sqrt(2.0 / (per_area + 3.0))))
    if not 12.0 <= angle <= 50.0:
        likely = [
            NEWTON_PER_BAR_MM2
            * pressure
            * math.pi
            * diameter**2
            / 4
            * (2.0 / math.sin(math.radians(a)) ** 2 - 3.0)
            for a in (35.0, 18.0)
        ]
        raise DataError(
            f"max_force {force:g} N at {pressure:g} bar and this diameter would take a braid angle "
            f"of {angle:.0f} degrees",
            remedy=f"muscles of this size pull some {likely[0]:.0f} to {likely[1]:.0f} N",
        )
    return angle


def _stiffness(muscle: Muscle, pressure: float, contraction: float) -> float:
    made = muscle.record()[0]
    x = contraction * muscle.length
    shape = (made["area"], made["a"], made["b"], made["end_cap"], made["length"])
    area, _ = braid_area(*shape, x)
    rubber, _ = bladder_force(made["c10"], 0.0, made["cos2"], made["sin2"], made["length"], x)
    if contraction >= 1 or area <= 0:
        most = 1.0 - math.sqrt(made["b"] / made["a"])
        raise DataError(
            f"max_contraction {contraction:g} is more than the braid allows",
            remedy=f"with this force, diameter and pressure it is below {most:.2f}",
        )
    return float(NEWTON_PER_BAR_MM2 * pressure * area / rubber)


def _with_loop_width(rig: MovingEnd, wanted: float, force_per_bar: float) -> MovingEnd:
    """Return the rig with friction for the desired loop width."""

    def at(share: float) -> MovingEnd:
        return rig.changed(
            {
                "muscle.friction.contracting": [share * force_per_bar * c for c in CONTRACTING],
                "muscle.friction.extending": [share * force_per_bar * c for c in EXTENDING],
            }
        )

    low, high = 0.0, 0.4
    least, most = _loop_width(at(low)), _loop_width(at(high))
    if not least < wanted < most:
        raise DataError(
            f"a loop_width of {wanted:g} cannot be had with these numbers",
            remedy=f"give a share from {least:.2f} to {most:.2f}, or another payload",
        )
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _loop_width(at(middle)) < wanted else (low, middle)
    return at(0.5 * (low + high))


def _loop_width(rig: MovingEnd) -> float:
    """Return e_w of the second cycle as a share."""
    limits, step = rig.limits("pressure"), 0.02
    half = round(0.5 * PERIOD / step)
    time = np.arange(4 * half + 1) * step
    wave = triangle(time, PERIOD, limits.high, limits.low)
    moved = rig.run(Recording({"pressure": wave}, step), ideal=True)["displacement"][2 * half :]
    return loop_width(wave[2 * half :], moved) / 100 if np.ptp(moved) else 0.0
