"""A finger that bends under pressure, fills faster than it vents, and meets a wall in some runs.

- Air: flow through orifices by ISO 6358, q = C p₁ where it is choked (p₂/p₁ ≤ b) and q = C p₁ √(1 −
  ((p₂/p₁ − b)/(1 − b))²) where not; a chamber of constant temperature, dp/dt = q p₀/V, that grows as
  the finger bends. Filling is fed from a supply; venting is driven by the chamber alone. Beater,
  Pneumatic Drives (2007).
- Bending: moment = M (p − onset) beyond the pressure that takes up the slack; a cubic spring, as
  reinforced rubber hardens; a standard linear solid beside it. Polygerinos et al., IEEE Trans. Robotics
  31 (2015); Findley, Lai & Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials (1976).
- Friction: Coulomb's, twice as large on venting, with real standstill (Bingham's element: it moves only
  where the moment that is left exceeds the friction).
- Wall: a stiff spring on one side (Johnson, Contact Mechanics, 1985).

Where the wall stands is known: the channel ``wall``, and the load of `move`, is 1 there and else 0.
Mass is left out: a finger of silicone is overdamped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from mckibben.arrays import Array
from mckibben.system.compiling import deferred
from tests.plants import motions
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, one_muscle

BENCH = Bench(("pressure",), ("wall",), ("angle",), 0.01, high=2.5, noise=(0.00125, 0.0007))
SUBSTEPS = 20

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
def _angles(command: Array, wall: Array, step: float, substeps: int) -> Iterator[float]:
    """Yield the angle at every sample [rad], from pressures asked for [bar] and the wall's presence."""
    dt = step / substeps
    pressure, angle, relaxed = AMBIENT, 0.0, 0.0
    for i in range(command.size):
        goal = AMBIENT + 1e5 * command[i]
        for _ in range(substeps):
            opening = min(max((goal - pressure) / WIDE_OPEN, -1.0), 1.0)
            if opening > 0.0:
                flow = opening * _flow(SUPPLY, pressure, FILLING)
            else:
                flow = opening * _flow(pressure, AMBIENT, VENTING)
            pressure += dt * flow * AMBIENT / (VOLUME * (1.0 + GROWTH * angle))
            relaxed += (angle - relaxed) * dt / RELAXING
            left = MOMENT * max(pressure - AMBIENT - ONSET, 0.0)
            left -= _spring(angle) + BRANCH * (angle - relaxed)
            if wall[i] > 0.5:
                left -= WALL * max(angle - WALL_AT, 0.0)
            if left > FRICTION_FILLING:
                angle += dt * (left - FRICTION_FILLING) / DAMPING
            elif left < -FRICTION_VENTING:
                angle += dt * (left + FRICTION_VENTING) / DAMPING
        yield angle


def move(pressures: Array, loads: Array) -> Motion:
    """Return angles [rad], shape (n, 1), of a finger that begins vented; loads are the wall."""
    commands, wall = BENCH.allowed(pressures[:, :1]), np.ascontiguousarray(loads[:, 0])
    return Motion(commands, _angles(commands[:, 0], wall, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    """Return what is so; stiffness is that of what is bent for long."""
    moment = MOMENT * (1e5 * BENCH.middle - ONSET)
    angle = brentq(lambda at: float(_spring(at)) - moment, 0.0, 2.0)
    friction = 0.5 * (FRICTION_FILLING + FRICTION_VENTING)
    stiffness = SPRING + 3 * CUBIC * angle**2
    return one_muscle(
        friction,
        stiffness,
        friction_ratio=FRICTION_VENTING / FRICTION_FILLING,
        relaxation_times=(RELAXING,),
        dead_zone=1e-5 * ONSET,
        lifts_from=1e-5 * (ONSET + FRICTION_FILLING / MOMENT),
        wall_at=WALL_AT,
    )


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, high = BENCH.sample_time, BENCH.high
    falling = motions.through([2.5, 0.0, 2.5, 0.5, 2.2, 0.8, 1.9, 1.0, 1.6], 45.0, step)
    ramps = motions.ramps(rng, 35.0, step, 0.0, high, (0.3, 2.0), 1.5)
    at_wall = motions.ramps(rng, 30.0, step, 0.0, high, (0.3, 2.0), 1.0)
    waves = motions.waves(rng, 45.0, step, 0.1, 2.45, (0.05, 0.5))
    steps = motions.framed(motions.stairs(rng, 30.0, step, 0.2, 2.4, (1.0, 4.0), step), step)
    fast = motions.waves(rng, 40.0, step, 0.2, 2.3, (0.4, 2.5))
    against = motions.waves(rng, 40.0, step, 0.1, 2.45, (0.05, 0.6))
    train = (
        record("falling loops", falling),
        record("ramps", ramps),
        record("ramps at the wall", at_wall, 1.0),
    )
    test = {
        "patterns": (record("waves", waves), record("steps", steps)),
        "fast": (record("fast waves", fast),),
        "wall": (record("waves at the wall", against, 1.0),),
    }
    return train, test
