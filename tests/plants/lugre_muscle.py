"""One hanging muscle behind an air line.

Equations, in SI units and with the contraction x (the weight's rise):

- Pull of the braid by virtual work, F = -p dV/dL, with threads of length b in n turns (Chou and
  Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996): D = sqrt(b² - L²) / (n pi). End caps hold
  the ends at their first diameter, so that a cone of 45° leads from each cap to the cylinder.
- The bladder has to reach the braid first: only pressure beyond ``TOUCH`` pulls.
- Rubber as a generalised Maxwell body, a Prony series of three relaxations (Ferry, Viscoelastic
  Properties of Polymers, 1980): F = k x + sum k_i (x - q_i), dq_i/dt = (x - q_i) / tau_i.
- LuGre friction with Stribeck (Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995): F =
  s0 z + s1 dz/dt + s2 v, dz/dt = v - s0 |v| z / g(v), g(v) = Fc + (Fs - Fc) exp(-(v/vs)²).
- Air at constant temperature: d(pV)/dt = R T (mass flow); a tube with laminar flow (Hagen and
  Poiseuille) and half-way volume, then an orifice as in ISO 6358. Pressure is recorded at the
  regulator, before the tube.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from mckibben.arrays import Array
from mckibben.system.compiling import deferred
from tests.plants import motions
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, after, one_muscle

BENCH = Bench(("pressure",), (), ("displacement",), 0.01, high=6.0, noise=(0.002, 0.03))
SUBSTEPS = 40

BAR, ATMOSPHERE, GRAVITY = 1e5, 1.013e5, 9.81
WEIGHT, FITTING = 30.0, 0.15  # N, kg
LENGTH, DIAMETER, ANGLE = 0.200, 0.010, math.radians(23.0)  # m, m, of threads at rest
THREAD = LENGTH / math.cos(ANGLE)
TURNS = THREAD * math.sin(ANGLE) / (math.pi * DIAMETER)
TOUCH, TOUCHING = 0.30 * BAR, 0.03 * BAR  # Pa: bladder meets braid, and how gradually

RUBBER = 1600.0  # N/m
RELAXING = (350.0, 260.0, 220.0)  # N/m
TIMES = (0.25, 3.0, 30.0)  # s
STOP = 4.0e4  # N/m: threads that jam when pulled beyond their first length

COULOMB, STATIC, STRIBECK = 7.0, 9.0, 0.003  # N, N, m/s
BRISTLE, BRISTLE_DAMPING, VISCOUS = 1.6e4, 120.0, 25.0  # N/m, N s/m, N s/m

TUBE_RESISTANCE, TUBE_VOLUME = 2.9e8, 3.5e-6  # Pa s/m³, m³: 2 m of 1.5 mm bore
ORIFICE, CRITICAL, LAMINAR = 2.0e-9, 0.3, 0.98  # m³/(s Pa), pressure ratios (ISO 6358)


@deferred
def _volume_slope(length: float) -> tuple[float, float]:
    """Return the volume within the braid [m³] and its slope dV/dL [m²]."""
    wide = math.sqrt(THREAD**2 - length**2) / (TURNS * math.pi)
    cone = 0.5 * (wide - DIAMETER)
    ring = wide**2 + wide * DIAMETER + DIAMETER**2
    volume = math.pi * (0.25 * wide**2 * (length - 2.0 * cone) + cone * ring / 6.0)
    by_wide = math.pi * (
        0.5 * wide * (length - 2.0 * cone)
        - 0.25 * wide**2
        + (0.5 * ring + cone * (2.0 * wide + DIAMETER)) / 6.0
    )
    return volume, 0.25 * math.pi * wide**2 - by_wide * length / (wide * (TURNS * math.pi) ** 2)


@deferred
def _pull(pressure: float, length: float) -> float:
    """Return the pull of the braid [N] at a gauge pressure [Pa]."""
    beyond = (pressure - TOUCH) / TOUCHING
    acting = TOUCHING * (beyond if beyond > 30.0 else math.log1p(math.exp(beyond)))
    return -acting * _volume_slope(length)[1]


@deferred
def _orifice(here: float, there: float) -> float:
    """Return the flow times R T [Pa m³/s] from one absolute pressure [Pa] to the other."""
    high, low = max(here, there), min(here, there)
    ratio = low / high
    share = 1.0
    if ratio > CRITICAL:
        kept = min(ratio, LAMINAR)
        share = math.sqrt(1.0 - ((kept - CRITICAL) / (1.0 - CRITICAL)) ** 2)
        if ratio > LAMINAR:
            share *= (1.0 - ratio) / (1.0 - LAMINAR)
    flow = ORIFICE * BAR * high * share
    return flow if here > there else -flow


@deferred
def _run(commands: Array, step: float, substeps: int) -> Iterator[float]:
    mass = WEIGHT / GRAVITY + FITTING
    x = -WEIGHT / STOP
    v = z = 0.0
    q = np.zeros(len(TIMES))
    tube = muscle = commands[0] * BAR + ATMOSPHERE
    dt = step / substeps
    for k in range(commands.size):
        yield 1e3 * x
        ahead = commands[min(k + 1, commands.size - 1)] - commands[k]
        for j in range(substeps):
            regulator = (commands[k] + ahead * (j + 1) / substeps) * BAR + ATMOSPHERE
            volume, slope = _volume_slope(LENGTH - x)
            through = _orifice(tube, muscle)
            entering = 0.5 * (regulator + tube) * (regulator - tube) / TUBE_RESISTANCE
            tube += dt * (entering - through) / TUBE_VOLUME
            muscle += dt * (through + muscle * slope * v) / volume

            force = _pull(muscle - ATMOSPHERE, LENGTH - x) - RUBBER * x - WEIGHT
            for i in range(len(TIMES)):
                force -= RELAXING[i] * (x - q[i])
                q[i] += dt * (x - q[i]) / TIMES[i]
            if x < 0.0:
                force -= STOP * x + 100.0 * v
            limit = COULOMB + (STATIC - COULOMB) * math.exp(-((v / STRIBECK) ** 2))
            before = z
            z = (z + dt * v) / (1.0 + dt * BRISTLE * abs(v) / limit)
            force -= BRISTLE * z + BRISTLE_DAMPING * (z - before) / dt + VISCOUS * v
            v += dt * force / mass
            x += dt * v


def move(pressures: Array, loads: Array) -> Motion:
    """Return displacements [mm], shape (n, 1), at pressures of the regulator [bar]; no loads."""
    commands, lead = motions.from_empty(BENCH.allowed(pressures), BENCH.sample_time)
    return after(lead, commands, _run(commands[:, 0], BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    middle, nudge = 3.0 * BAR, 1e-5

    def net(x: float) -> float:
        return _pull(middle, LENGTH - x) - RUBBER * x - WEIGHT

    rest = brentq(net, 0.0, 0.25 * LENGTH)
    lifting = brentq(lambda p: _pull(p, LENGTH) - WEIGHT, 0.0, 3.0 * BAR)
    volume = _volume_slope(LENGTH - rest)[0]
    stiffness = 1e-3 * (net(rest - nudge) - net(rest + nudge)) / (2 * nudge)
    opening = _orifice(1.0, LAMINAR) / (1.0 - LAMINAR)  # m³/s per unit of pressure ratio
    return one_muscle(
        COULOMB,
        stiffness,
        relaxation_times=TIMES,
        relaxing_share=sum(RELAXING) / (RUBBER + sum(RELAXING)),
        dead_zone=TOUCH / BAR,
        lifts_from=lifting / BAR,
        line_lag=volume * (1.0 / opening + TUBE_RESISTANCE / (middle + ATMOSPHERE)),
    )


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, low, high = BENCH.sample_time, 0.2, 5.5
    train = (
        record("wandering", motions.wander(rng, 60.0, step, low, high)),
        record("nested loops", motions.swell(40.0, step, low, high, 5.0)),
    )
    test = {
        "patterns": (record("patterns", motions.wander(rng, 40.0, step, low, high)),),
        "holds": (record("holds", motions.stairs(rng, 40.0, step, low, high)),),
        "fast": (record("fast", motions.waves(rng, 20.0, step, 1.0, 4.5, (0.2, 1.5))),),
    }
    return train, test
