"""One McKibben muscle that lifts weights, on a rig where weights are changed between runs.

Equations, in SI units and with the contraction x (the weight's rise) and the strain e = x/L0:

- Pull of the braid (Tondu and Lopez, IEEE Control Systems 20(2), 2000): F = pi r0² p [a (1 - k e)² -
  b], a = 3/tan²(angle), b = 1/sin²(angle), and k = A exp(-p) + B with p in bar for ends that do not
  swell.
- Rubber that stiffens: F = c1 x + c3 x³.
- Dry friction as a generalised Maxwell-slip body (Al-Bender, Lampaert and Swevers, IEEE Trans.
  Automatic Control 50(11), 2005): elements in parallel, each a spring with a slip limit, df = k v dt
  held within ±limit. The limit is Coulomb's law of threads pressed together, so it grows with pressure,
  and with the logarithm of speed as of rubber that slides (Eyring's activated flow; Persson, Sliding
  Friction, 2000): W (1 + G asinh(|v|/v0)).
- The weight is known, and moves with its mass. Pressure is recorded in the muscle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from mckibben import Recording
from mckibben.arrays import Array
from mckibben.system.compiling import deferred
from tests.plants import motions
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, after, one_muscle

BENCH = Bench(
    ("pressure",), ("force",), ("displacement",), 0.01, high=6.0, noise=(0.002, 0.04), load=60.0
)
SUBSTEPS = 20

BAR, GRAVITY = 1e5, 9.81
FITTING = 0.4  # kg
LENGTH, RADIUS, ANGLE = 0.300, 0.0075, math.radians(25.0)  # m, m, of threads at rest
LONG, WIDE = 3.0 / math.tan(ANGLE) ** 2, 1.0 / math.sin(ANGLE) ** 2
ENDS = (0.25, 1.12)  # A, B
RUBBER, STIFFENING = 1900.0, 4.0e5  # N/m, N/m³
STOP = 6.0e4  # N/m: threads that jam when pulled beyond their first length
VISCOUS = 30.0  # N s/m

LIMITS = np.array([0.10, 0.14, 0.18, 0.22, 0.22, 0.14])  # shares of the whole friction
REACHES = np.array([0.05e-3, 0.15e-3, 0.4e-3, 0.9e-3, 1.8e-3, 3.5e-3])  # m, to slip at mid-range
FRICTION, BY_PRESSURE = 4.0, 4.2 / BAR  # N, N/Pa
GROWTH, CREEPING = 0.06, 1.0e-3  # share, m/s
SPRINGS = LIMITS * (FRICTION + BY_PRESSURE * 3.0 * BAR) / REACHES  # N/m


@deferred
def _pull(pressure: float, x: float) -> float:
    """Return the pull of braid and rubber [N] at a gauge pressure [Pa]."""
    k = ENDS[0] * math.exp(-pressure / BAR) + ENDS[1]
    braid = math.pi * RADIUS**2 * pressure * (LONG * (1.0 - k * x / LENGTH) ** 2 - WIDE)
    return braid - RUBBER * x - STIFFENING * x**3


@deferred
def _run(commands: Array, loads: Array, step: float, substeps: int) -> Iterator[float]:
    x = -loads[0] / STOP
    v = 0.0
    held = np.zeros(LIMITS.size)
    dt = step / substeps
    for k in range(commands.size):
        yield 1e3 * x
        following = min(k + 1, commands.size - 1)
        for j in range(substeps):
            part = (j + 1) / substeps
            pressure = (commands[k] + (commands[following] - commands[k]) * part) * BAR
            load = loads[k] + (loads[following] - loads[k]) * part
            force = _pull(pressure, x) - load - VISCOUS * v
            if x < 0.0:
                force -= STOP * x + 150.0 * v
            slip = FRICTION + BY_PRESSURE * pressure
            slip *= 1.0 + GROWTH * math.asinh(abs(v) / CREEPING)
            for i in range(LIMITS.size):
                limit = LIMITS[i] * slip
                held[i] = min(max(held[i] + SPRINGS[i] * v * dt, -limit), limit)
                force -= held[i]
            v += dt * force / (FITTING + load / GRAVITY)
            x += dt * v


def move(pressures: Array, loads: Array) -> Motion:
    """Return displacements [mm], shape (n, 1), at pressures in the muscle [bar] and weights [N]."""
    commands, lead = motions.from_empty(BENCH.allowed(pressures), BENCH.sample_time)
    weights = np.append(np.full(lead, loads[0, 0]), loads[:, 0])
    return after(lead, commands, _run(commands[:, 0], weights, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    middle, nudge = 3.0 * BAR, 1e-5
    rest = brentq(lambda x: _pull(middle, x) - BENCH.load, 0.0, 0.3 * LENGTH)
    stiffness = (_pull(middle, rest - nudge) - _pull(middle, rest + nudge)) / (2e3 * nudge)
    friction = FRICTION + BY_PRESSURE * middle
    return one_muscle(
        friction,
        stiffness,
        friction_grows_with_pressure=True,
        friction_per_bar=BY_PRESSURE * BAR,
        friction_grows_with_speed=True,
        lifts_from=brentq(lambda p: _pull(p, 0.0) - BENCH.load, 0.0, middle) / BAR,
    )


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, low, high = BENCH.sample_time, 0.5, 5.0

    def wander(weight: float, seconds: float) -> Recording:
        pressure = motions.wander(rng, seconds, step, low, high)
        return record(f"wandering, {weight:g} N", pressure, weight)

    def fast(weight: float) -> Recording:
        pressure = motions.wander(rng, 15.0, step, 1.0, 4.5, (0.25, 0.6))
        return record(f"fast, {weight:g} N", pressure, weight)

    nested = motions.swell(20.0, step, low, high, 4.0)
    train = tuple(wander(weight, 36.0) for weight in (20.0, 60.0, 110.0))
    test = {
        "patterns": (record("nested loops, 60 N", nested, 60.0),),
        "loads between training": (wander(40.0, 20.0), wander(85.0, 20.0)),
        "loads beyond training": (wander(150.0, 20.0),),
        "fast": (fast(20.0), fast(110.0)),
    }
    return train, test
