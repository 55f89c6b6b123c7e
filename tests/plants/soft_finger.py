"""A finger that bends under pressure, fills faster than it vents, and meets a wall in some runs.

- Air: flow through orifices by ISO 6358, q = C p₁ where it is choked (p₂/p₁ ≤ b) and
  q = C p₁ √(1 − ((p₂/p₁ − b)/(1 − b))²) where not; a chamber of constant temperature, dp/dt = q p₀/V,
  that grows as the finger bends. Filling is fed from a supply; venting is driven by the chamber alone.
  Beater, Pneumatic Drives (2007).
- Bending: moment = M (p − onset) beyond the pressure that takes up the slack; a cubic spring, as
  reinforced rubber hardens; a standard linear solid beside it. Polygerinos et al., IEEE Trans. Robotics
  31 (2015); Findley, Lai & Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials (1976).
- Friction: Coulomb's, twice as large on venting, with real standstill (Bingham's element: it moves only
  where the moment that is left exceeds the friction).
- Wall: a stiff spring on one side (Johnson, Contact Mechanics, 1985).

Where the wall stands is known: the channel ``wall``, and the load of `respond`, is 1 there and else 0.
Mass is left out: a finger of silicone is overdamped.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.system.compiling import deferred
from tests.plants import Plant
from tests.plants.courses import allowed, measured, stepping, through, wandering, waving

STEP = 0.01  # s between samples
SUBSTEPS = 20
HIGH = 2.5  # bar
SPAN = 1.4  # rad

AMBIENT, SUPPLY = 1e5, 4.5e5  # Pa, absolute
CRITICAL = 0.3  # ratio of pressures below which flow is choked
FILLING, VENTING = 1.1e-9, 0.55e-9  # m³/(s Pa), conductances
VOLUME, GROWTH = 4e-5, 0.25  # m³, 1/rad
WIDE_OPEN = 0.12e5  # Pa between goal and chamber where the valve is wide open

ONSET, MOMENT = 0.35e5, 1.2e-6  # Pa, N m/Pa
SPRING, CUBIC = 0.15, 0.020  # N m/rad, N m/rad³
BRANCH, RELAXING = 0.03, 3.0  # N m/rad, s
DAMPING = 0.010  # N m s/rad
FRICTION_FILLING, FRICTION_VENTING = 0.006, 0.012  # N m
WALL_AT, WALL = 0.95, 3.0  # rad, N m/rad


@deferred
def _flow(upstream: float, downstream: float, conductance: float) -> float:
    """Return the flow through an orifice [m³/s of air at ambient pressure]."""
    ratio = downstream / upstream
    if ratio >= 1.0:
        return 0.0
    if ratio <= CRITICAL:
        return conductance * upstream
    return conductance * upstream * math.sqrt(1.0 - ((ratio - CRITICAL) / (1.0 - CRITICAL)) ** 2)


@deferred
def _spring(angle: float) -> float:
    """Return the moment of the long-lasting elasticity [N m]."""
    return SPRING * angle + CUBIC * angle**3


@deferred
def _angles(command: Array, wall: Array) -> Array:
    """Return the angle at every sample [rad], from pressures asked for [bar] and the wall's presence."""
    angles = np.empty(command.size)
    step = STEP / SUBSTEPS
    pressure, angle, relaxed = AMBIENT, 0.0, 0.0
    for i in range(command.size):
        goal = AMBIENT + 1e5 * command[i]
        for _ in range(SUBSTEPS):
            opening = min(max((goal - pressure) / WIDE_OPEN, -1.0), 1.0)
            if opening > 0.0:
                flow = opening * _flow(SUPPLY, pressure, FILLING)
            else:
                flow = opening * _flow(pressure, AMBIENT, VENTING)
            pressure += step * flow * AMBIENT / (VOLUME * (1.0 + GROWTH * angle))
            relaxed += (angle - relaxed) * step / RELAXING
            left = MOMENT * max(pressure - AMBIENT - ONSET, 0.0)
            left -= _spring(angle) + BRANCH * (angle - relaxed)
            if wall[i] > 0.5:
                left -= WALL * max(angle - WALL_AT, 0.0)
            if left > FRICTION_FILLING:
                angle += step * (left - FRICTION_FILLING) / DAMPING
            elif left < -FRICTION_VENTING:
                angle += step * (left + FRICTION_VENTING) / DAMPING
        angles[i] = angle
    return angles


def respond(commands: Array, loads: Array) -> Array:
    """Return angles [rad], shape (n, 1), of a finger that begins vented.

    Loads say where the wall stands; without a column of them there is none.
    """
    command = allowed(commands[:, 0], HIGH)
    wall = np.ascontiguousarray(loads[:, 0]) if loads.shape[1] else np.zeros(command.size)
    return _angles(command, wall)[:, None]


def facts() -> dict[str, float | bool | tuple[float, ...]]:
    """Return what is so at half pressure.

    Shares of friction are those of its moment in the pressure's, filling and venting; stiffness is in
    N m/rad, of what is bent for long; the time is that of the branch, held still; the dead zone is where
    a finger that has rested begins to bend.
    """
    moment = MOMENT * (0.5e5 * HIGH - ONSET)
    angle = float(brentq(lambda at: _spring(at) - moment, 0.0, 2.0))
    return {
        "friction_shares": (FRICTION_FILLING / moment, FRICTION_VENTING / moment),
        "static_stiffness": SPRING + 3 * CUBIC * angle**2,
        "relaxation_times": (RELAXING,),
        "dead_zone": 1e-5 * (ONSET + FRICTION_FILLING / MOMENT),
        "friction_grows_with_pressure": False,
        "identical_muscles": True,
        "wall_at": WALL_AT,
    }


def plant(seed: int) -> Plant:
    """Return the finger, with runs that this seed draws."""
    rng = np.random.default_rng((seed, 2))

    def run(name: str, command: Array, *, wall: bool) -> Recording:
        stands = np.full(command.size, float(wall))
        angle = respond(command[:, None], stands[:, None])[:, 0]
        return Recording(
            {
                "pressure": measured(rng, command, HIGH),
                "wall": stands,
                "angle": measured(rng, angle, SPAN),
            },
            sample_time=STEP,
            meta={"name": name, "rig": "soft finger (virtual)"},
        )

    falling = through([2.5, 0.0, 2.5, 0.5, 2.2, 0.8, 1.9, 1.0, 1.6], 45.0, STEP)
    ramps = wandering(rng, 35.0, STEP, low=0.0, high=HIGH, speed=(0.3, 2.0), rest=1.5)
    at_wall = wandering(rng, 30.0, STEP, low=0.0, high=HIGH, speed=(0.3, 2.0), rest=1.0)
    waves = waving(rng, 45.0, STEP, low=0.1, high=2.45, band=(0.05, 0.5))
    steps = stepping(rng, 30.0, STEP, low=0.2, high=2.4, hold=(1.0, 4.0))
    fast = waving(rng, 40.0, STEP, low=0.2, high=2.3, band=(0.4, 2.5))
    against = waving(rng, 40.0, STEP, low=0.1, high=2.45, band=(0.05, 0.6))
    return Plant(
        name="soft_finger",
        title="A bending finger that vents slowly and meets a wall",
        sources="ISO 6358; Beater 2007; Polygerinos et al. 2015; Findley, Lai & Onaran 1976",
        train=(
            run("falling loops", falling, wall=False),
            run("ramps", ramps, wall=False),
            run("ramps at the wall", at_wall, wall=True),
        ),
        test={
            "patterns": (run("waves", waves, wall=False), run("steps", steps, wall=False)),
            "fast": (run("fast waves", fast, wall=False),),
            "wall": (run("waves at the wall", against, wall=True),),
        },
        respond=respond,
        facts=facts(),
    )
