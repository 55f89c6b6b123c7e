"""A fitted muscle as plain MJCF: tendons and an actuator, without plug-in, callback or compiler.

The muscle is a `balance` of one muscle with a measured force, within what MuJoCo 4 carries. Of the
shortening y below the rest length and the pressure p it pulls with

    p (a_0 + a_1 y / L) - S_0 - S_1 y - E(y) - sum_m h_m s_m - d y',

where the area is an actuator with affine gain in length, springs and elasticity up to the third degree
are the stiffness of a tendon, every stop s_m is a tendon with ``springyield``, what it meets is a tendon
that is stiff on one side, and the damping is a tendon's. The stops are those of Python to rounding:
MuJoCo moves ``mjData.plastic`` at the end of each step. SI units; lengths of tendons in m.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import Balance, balance_in
from mckibben.blocks.coupled.balance_terms import TABLE
from mckibben.blocks.coupled.load_estimate import LoadEstimate
from mckibben.errors import ModelError, require
from mckibben.exporting.naming import identifier
from mckibben.outputs import claim, marked
from mckibben.system.atomic import replacing

MM = 1000.0
"""In a metre."""

CONSTANT = 1e-3
"""Share of friction that grows with pressure, below which friction is constant."""

GRAVITY = 9.81
"""Of the examples [m/s^2]."""

Example = Literal["hanging", "joint", "arm"]


class Sites(NamedTuple):
    """Names of the two sites that a muscle pulls together."""

    start: str
    end: str


def export_mjcf(
    model: Block,
    file: str | Path,
    *,
    rest_length: float,
    name: str = "muscle",
    sites: Sites | None = None,
    example: Example = "hanging",
    lag: float = 0.0,
    force: bool = False,
) -> Path:
    """Write a muscle as MJCF.

    Parameters
    ----------
    model : Block
        Balance of one muscle, fitted with a measured force ``for="mjcf"``.
    file : str or Path
        To write.
    rest_length : float
        Distance of the sites where the displacement is 0 [mm].
    name : str
        Of the actuator and its tendon; the names of all else begin with it.
    sites : Sites, optional
        Sites of the model that includes the file: then it has the defaults, tendons and actuator alone.
    example : {"hanging", "joint", "arm"}
        Without sites: a load on a muscle, whose body can be attached elsewhere; a joint between two;
        a plate on three.
    lag : float
        Time constant of the regulator, from command to pressure [s]; 0 for none.
    force : bool
        Whether a file of the user's may be replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ModelError
        If the model has what MJCF does not carry.
    DataError
        If the file is in the way or cannot be written.
    """
    file = Path(file)
    text = mjcf(model, rest_length=rest_length, name=name, sites=sites, example=example, lag=lag)
    claim(file, force=force)
    with replacing(file) as new:
        new.write_bytes(marked(text.encode()))
    return file


def mjcf(
    model: Block,
    *,
    rest_length: float,
    name: str = "muscle",
    sites: Sites | None = None,
    example: Example = "hanging",
    lag: float = 0.0,
) -> str:
    """Return the text of `export_mjcf`."""
    muscle, name = require_exportable(model), identifier(name)
    shortest = MM * stroke(muscle)
    require(shortest < rest_length <= 1e5, "rest_length", rest_length, f"{shortest:g} to 100000 mm")
    require(0.0 <= lag <= 10.0, "lag", lag, "0 to 10 s")
    root = ET.Element("mujoco", model=name)
    each = [sites] if sites is not None else WORLDS[example](root, muscle, rest_length / MM, name)
    names = [name] if len(each) == 1 else [f"{name}_{k}" for k in range(1, len(each) + 1)]
    default = ET.SubElement(ET.SubElement(root, "default"), "default", {"class": name})
    _defaults(default, muscle, rest_length / MM, lag)
    tendon, actuator = ET.SubElement(root, "tendon"), ET.SubElement(root, "actuator")
    for one, ends in zip(names, each, strict=True):
        _tendons(tendon, muscle, rest_length / MM, one, name, ends)
        ET.SubElement(actuator, "general", {"name": one, "class": name, "tendon": one})
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def require_exportable(model: Block) -> Balance:
    """Return the balance of a model that can be exported to MJCF.

    Raises
    ------
    ModelError
        If it has features that MJCF lacks, with their names.
    """
    again = (
        "fit it with `mckibben fit balance FILES --for mjcf`, under a measured force, or "
        "several masses, each a constant of its recordings"
    )
    placed = balance_in(model)
    if placed is None:
        raise ModelError(f"{model.title!r} is no balance of forces", remedy=again)
    balance = placed.balance
    lacking = {
        "several muscles": len(balance.given) > 1 or len(balance.driven) > 1,
        "parts before or behind the balance": bool(placed.before or placed.behind),
        "springs that another channel stiffens": balance.n_schedules > 0,
        "displacements from rest at the start": balance.tare,
        "elasticity above the third degree": len(balance.elasticity[0]) > 2,
        "an area that is not linear in length": len(balance.areas[0]) > 2,
        "friction that depends on pressure": any(balance.friction[0])
        and balance.friction_growth > CONSTANT,
        "friction that differs by direction": balance.asymmetry not in (None, 1.0),
    } | {
        TABLE[name].label: bool(np.any(getattr(balance, name) or 0.0))
        for name in ("relaxation", "walls", "lines", "mass", "pushes")
    }
    if obstacles := [part for part, is_there in lacking.items() if is_there]:
        raise ModelError(f"MJCF does not carry {', '.join(obstacles)}", remedy=again)
    LoadEstimate(balance)  # refuses a balance without a force, or from what is no pressure
    return balance


def stroke(muscle: Balance) -> float:
    """Return the largest shortening that the recordings had [m]."""
    return max(muscle.hull[0][1], 1.0) / MM


def pull(muscle: Balance) -> float:
    """Return the pull at rest under the highest pressure [N]."""
    return muscle.areas[0][0] * muscle.highest_pressure


# -- the muscle ------------------------------------------------------------------------------------


def _defaults(default: ET.Element, muscle: Balance, rest: float, lag: float) -> None:
    """Fill the class that the muscle's tendon and actuator have."""
    slope = MM * (muscle.areas[0][1] if len(muscle.areas[0]) > 1 else 0.0) / muscle.scale
    low, high = muscle.pressure_range or (0.0, muscle.highest_pressure)
    # an actuator pushes a tendon's ends apart: a muscle's forces are negative
    settings = {
        "ctrlrange": _row(low, high),
        "gaintype": "affine",
        "gainprm": _row(-muscle.areas[0][0] - slope * rest, slope, 0.0),
        "biastype": "affine",
        "biasprm": _row(muscle.springs[0][0], 0.0, 0.0),
    }
    if lag > 0:
        settings |= {"dyntype": "filterexact", "dynprm": _row(lag)}
    ET.SubElement(default, "general", settings)
    # one tendon is seen, the muscle's own
    ET.SubElement(default, "tendon", springlength=_row(rest), width="0.0001", rgba="0 0 0 0")


def _tendons(
    parent: ET.Element, muscle: Balance, rest: float, name: str, kind: str, sites: Sites
) -> None:
    """Add the muscle's tendons, all between the same sites."""

    def add(suffix: str, *stiffness: float, **settings: str) -> None:
        named = {"name": f"{name}{suffix}", "class": kind, "stiffness": _row(*stiffness)}
        tendon = ET.SubElement(parent, "spatial", named | settings)
        for site in sites:
            ET.SubElement(tendon, "site", site=site)

    def beyond(side: float, start: float) -> str:
        """Return the dead band of a spring met by shortening, or by lengthening, past a place [mm]."""
        edge = rest - start / MM
        return _row(edge, 1e3) if side > 0 else _row(0.0, edge)

    square, cube = [*muscle.elasticity[0], 0.0, 0.0][:2]  # by how much shorter it is
    bladder = muscle.bladders[0] if muscle.bladders else 0.0
    add(
        "",
        MM * (muscle.springs[0][1] + bladder),
        -square * (MM / muscle.scale) ** 2,
        cube * (MM / muscle.scale) ** 3,
        damping=_row(MM * muscle.damping[0]),
        width="0.004",
        rgba="0.2 0.2 0.2 1",
    )
    stops = zip(muscle.friction[0], muscle.limits, strict=True)
    for number, (stiffness, limit) in enumerate(stops, start=1):
        if stiffness > 0:
            add(f"_stop_{number}", MM * stiffness, springyield=_row(limit / MM))
    # beyond the shortenings known elasticity goes on straight: what bends there is taken away again
    ends = [(f"_{end}", side, muscle.hull[0][side > 0]) for end, side in (("low", -1), ("high", 1))]
    for suffix, side, start in ends:
        bend = square + 3.0 * cube * start / muscle.scale
        spring = bend * (MM / muscle.scale) ** 2, -cube * (MM / muscle.scale) ** 3
        if any(spring):
            add(suffix, 0.0, *spring, springlength=beyond(side, start))
    met = np.reshape(muscle.obstacles, (-1, 3)).tolist()
    for number, (side, start, stiffness) in enumerate(met, start=1):
        if stiffness > 0:
            add(f"_obstacle_{number}", MM * stiffness, springlength=beyond(side, start))


def _row(*numbers: float) -> str:
    """Return numbers as an attribute: the shortest decimals that give back every bit."""
    return " ".join(f"{float(number) + 0.0!r}".removesuffix(".0") for number in numbers)


# -- examples --------------------------------------------------------------------------------------


def _range(muscle: Balance) -> str:
    """Return the range of a joint that moves along a muscle: no end swings through the other."""
    return _row(-0.5 * stroke(muscle), 1.5 * stroke(muscle))


def _world(root: ET.Element, bodies: str) -> None:
    """Add the world of an example."""
    text = f"""
    <mujoco>
      <option timestep="0.001" integrator="implicitfast"/>
      <worldbody><light pos="0 -1 1" dir="0 1 -1"/>{bodies}</worldbody>
    </mujoco>
    """
    root.extend(ET.fromstring(text.strip()))


def hanging(root: ET.Element, muscle: Balance, rest: float, name: str) -> list[Sites]:
    """Add a load on a muscle; return the ends of the muscle."""
    _world(
        root,
        f"""
          <body name="{name}" pos="0 0 {_row(2 * rest)}">
            <geom type="cylinder" size="0.015 0.005" contype="0" conaffinity="0"/>
            <site name="{name}_from"/>
            <body name="{name}_end" pos="0 0 {_row(-rest)}">
              <joint name="{name}_shortening" type="slide" axis="0 0 1" limited="true"
                     range="{_range(muscle)}"/>
              <geom type="cylinder" size="0.015 0.02" mass="{0.2 * pull(muscle) / GRAVITY:.3g}"/>
              <site name="{name}_to"/>
            </body>
          </body>
        """,
    )
    return [Sites(f"{name}_from", f"{name}_to")]


def joint(root: ET.Element, muscle: Balance, rest: float, name: str) -> list[Sites]:
    """Add a joint between two muscles that have shortened by half at its middle; return their ends."""
    lever, drop = 0.6 * stroke(muscle), rest - 0.5 * stroke(muscle)
    inertia = lever**2 * pull(muscle) / stroke(muscle) / (2 * math.pi * 2.0) ** 2
    mass = 3.0 * inertia / rest**2  # of a rod of the muscle's length that swings at about 2 Hz
    _world(
        root,
        f"""
          <site name="{name}_1_from" pos="{_row(lever)} 0 {_row(drop)}"/>
          <site name="{name}_2_from" pos="{_row(-lever)} 0 {_row(drop)}"/>
          <body name="forearm">
            <joint name="joint" type="hinge" axis="0 1 0" limited="true" range="-60 60"/>
            <geom type="capsule" size="0.01" fromto="0 0 0 0 0 {_row(-rest)}" mass="{mass:.3g}"/>
            <site name="{name}_1_to" pos="{_row(lever)} 0 0"/>
            <site name="{name}_2_to" pos="{_row(-lever)} 0 0"/>
          </body>
        """,
    )
    return [Sites(f"{name}_{k}_from", f"{name}_{k}_to") for k in (1, 2)]


def arm(root: ET.Element, muscle: Balance, rest: float, name: str) -> list[Sites]:
    """Add a plate that hangs on three muscles and can tilt; return their ends."""
    radius = 1.5 * stroke(muscle)
    places = [(radius * math.cos(a), radius * math.sin(a)) for a in np.radians((90, 210, 330))]
    tops, ends = (
        "".join(
            f'<site name="{name}_{k}_{end}" pos="{_row(x, y, 0.0)}"/>'
            for k, (x, y) in enumerate(places, start=1)
        )
        for end in ("from", "to")
    )
    _world(
        root,
        f"""
          <body name="base" pos="0 0 {_row(2 * rest)}">
            <geom type="cylinder" size="{_row(1.2 * radius)} 0.004" contype="0" conaffinity="0"/>
            {tops}
            <body name="plate" pos="0 0 {_row(-rest)}">
              <joint name="shortening" type="slide" axis="0 0 1" limited="true"
                     range="{_range(muscle)}"/>
              <joint name="tilt_x" type="hinge" axis="1 0 0" limited="true" range="-45 45"/>
              <joint name="tilt_y" type="hinge" axis="0 1 0" limited="true" range="-45 45"/>
              <geom type="cylinder" size="{_row(1.2 * radius)} 0.004"
                    mass="{0.3 * pull(muscle) / GRAVITY:.3g}"/>
              {ends}
            </body>
          </body>
        """,
    )
    return [Sites(f"{name}_{k}_from", f"{name}_{k}_to") for k in (1, 2, 3)]


WORLDS = {"hanging": hanging, "joint": joint, "arm": arm}
"""Examples, by name."""
