"""One McKibben muscle that lifts weights, on a rig where weights are changed between runs.

Equations, in SI units and with the contraction x (the weight's rise) and the strain e = x/L0:

- Pull of the braid (Tondu and Lopez 2000): F = pi r0² p [a (1 - k e)² - b], a = 3/tan²(angle),
  b = 1/sin²(angle), and k = A exp(-p) + B with p in bar for ends that do not swell.
- Rubber that stiffens: F = c1 x + c3 x³.
- Dry friction as a generalised Maxwell-slip body (Al-Bender, Lampaert and Swevers 2005): elements
  in parallel, each a spring with a slip limit, df = k v dt held within ±limit. The limit is
  Coulomb's law of threads pressed together, so it grows with pressure, and with the logarithm of
  speed as of rubber that slides (Eyring's activated flow): W (1 + G asinh(|v|/v0)).
- The weight is known, and moves with its mass. Pressure is recorded in the muscle.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.optimize import brentq

from mckibben import Recording
from mckibben.arrays import Array
from tests.plants import motions
from tests.plants.plant import Bench, Fact, Plant

BENCH = Bench(
    pressures=("pressure",),
    loads=("force",),
    outputs=("displacement",),
    sample_time=0.01,
    pressure_noise=0.002,
    output_noise=0.04,
)
SUBSTEPS = 20

BAR, GRAVITY = 1e5, 9.81
MIDDLE_LOAD = 60.0  # N
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


@njit(cache=True)
def _pull(pressure: float, x: float) -> float:
    """Return the pull of braid and rubber [N] at a gauge pressure [Pa]."""
    k = ENDS[0] * math.exp(-pressure / BAR) + ENDS[1]
    braid = math.pi * RADIUS**2 * pressure * (LONG * (1.0 - k * x / LENGTH) ** 2 - WIDE)
    return braid - RUBBER * x - STIFFENING * x**3


@njit(cache=True)
def _run(commands: Array, loads: Array, step: float, substeps: int) -> Array:
    x = -loads[0] / STOP
    v = 0.0
    held = np.zeros(LIMITS.size)
    dt = step / substeps
    outputs = np.empty(commands.size)
    for k in range(commands.size):
        outputs[k] = x
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
    return outputs


def respond(pressures: Array, loads: Array) -> Array:
    """Return displacements [mm], shape (n, 1), at pressures in the muscle [bar] and weights [N]."""
    commands, lead = motions.from_empty(pressures, BENCH.sample_time)
    weights = np.append(np.full(lead, loads[0, 0]), loads[:, 0])
    moved = _run(np.ascontiguousarray(commands[:, 0]), weights, BENCH.sample_time, SUBSTEPS)
    return 1e3 * moved[lead:, None]


def _facts() -> dict[str, Fact]:
    middle, nudge = 3.0 * BAR, 1e-5
    rest = brentq(lambda x: _pull(middle, x) - MIDDLE_LOAD, 0.0, 0.3 * LENGTH)
    slope = (_pull(middle, rest - nudge) - _pull(middle, rest + nudge)) / (2 * nudge)
    return {
        "identical_muscles": True,
        "friction_share": (1.0,),
        "friction": (FRICTION + BY_PRESSURE * middle,),
        "friction_grows_with_pressure": True,
        "friction_per_bar": BY_PRESSURE * BAR,
        "friction_grows_with_speed": True,
        "static_stiffness": (1e-3 * slope,),
        "relaxation_times": (),
        "dead_zone": 0.0,
        "lifts_from": brentq(lambda p: _pull(p, 0.0) - MIDDLE_LOAD, 0.0, middle) / BAR,
        "line_lag": 0.0,
        "pressure_noise": BENCH.pressure_noise,
        "output_noise": BENCH.output_noise,
        "weight": MIDDLE_LOAD,
    }


def plant(seed: int) -> Plant:
    """Return the rig with its runs, each drawn anew from ``seed``."""
    rng = np.random.default_rng(seed)
    step, low, high = BENCH.sample_time, 0.5, 5.0

    def record(weight: float, pressure: Array, kind: str) -> Recording:
        loads = motions.held(weight, pressure)
        return BENCH.record(f"{kind}, {weight:g} N", respond, pressure[:, None], loads, rng)

    def wander(weight: float, seconds: float) -> Recording:
        return record(weight, motions.wander(rng, seconds, step, low, high), "wandering")

    def fast(weight: float) -> Recording:
        strokes = (0.25, 0.6)
        return record(weight, motions.wander(rng, 15.0, step, 1.0, 4.5, strokes), "fast")

    return Plant(
        name="load_rig",
        title="One muscle that lifts weights",
        sources=(
            "Tondu & Lopez 2000, IEEE Control Systems Magazine 20(2) 15-38",
            "Al-Bender, Lampaert & Swevers 2005, IEEE Trans. Automatic Control 50(11) 1883-1887",
            "Persson 2000, Sliding Friction: Physical Principles and Applications",
        ),
        bench=BENCH,
        train=tuple(wander(weight, 36.0) for weight in (20.0, 60.0, 110.0)),
        test={
            "patterns": (record(60.0, motions.swell(20.0, step, low, high, 4.0), "nested loops"),),
            "loads between training": (wander(40.0, 20.0), wander(85.0, 20.0)),
            "loads beyond training": (wander(150.0, 20.0),),
            "fast": (fast(20.0), fast(110.0)),
        },
        respond=respond,
        facts=_facts(),
    )
