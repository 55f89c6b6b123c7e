"""A muscle that lifts changing weights, creeps by a power law, and softens as it warms.

- Muscle: virtual work on a cylinder of braided fibres, F = πr₀²p [a (1 − kε)² − b], with a = 3/tan²α₀
  and b = 1/sin²α₀, and k for its conical ends. Chou & Hannaford, IEEE Trans. Robotics and Automation 12
  (1996); Tondu & Lopez, IEEE Control Systems 20 (2000).
- Friction between the threads: Dahl (1968), dz/dt = σv (1 − sgn(v) z), F = z (f₀ + f₁p), with another σ
  for each direction, as threads that are being pressed together yield sooner.
- Creep of the rubber: a spring-pot, whose modulus of relaxation is E(t) = c t^−α / Γ(1 − α). Because
  t^−α = 1/Γ(α) ∫ s^α e^−st d(ln s), it is a sum of Maxwell branches whose times are evenly spaced in
  logarithm. Mainardi, Fractional Calculus and Waves in Linear Viscoelasticity (2010).
- Warming: Newton's law towards the temperature of the compressed air, T' = (T∞ − T)/τ, and a rubber
  that loses a share of its stiffness with every kelvin. Ferry, Viscoelastic Properties of Polymers
  (1980).
- Regulator: a lag of first order.

The session of ten minutes is one simulation, of which some stretches are recorded. `move` begins at
switch-on, as training does.
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

BENCH = Bench(
    ("pressure",), ("force",), ("displacement",), 0.01, high=5.0, noise=(0.0025, 0.02), load=30.0
)
SUBSTEPS = 20

LENGTH, RADIUS, BRAID = 0.25, 0.006, math.radians(25.0)  # m, m, rad
AREA = math.pi * RADIUS**2
A, B, ENDS = 3.0 / math.tan(BRAID) ** 2, 1.0 / math.sin(BRAID) ** 2, 1.25
RUBBER, HARDENING = 3800.0, 90.0  # N/m; 1/m²
STOP = 40e3  # N/m, of stretched threads
DAMPING, CARRIER, LAG = 120.0, 0.3, 0.04  # N s/m, kg, s
FRICTION, FRICTION_PER_PA = 4.0, 2.6e-5  # N, N/Pa
UP, DOWN = 1 / 0.0016, 1 / 0.0030  # 1/m, of Dahl's friction
GRAVITY = 9.81

POWER, CREEP = 0.18, 1200.0  # exponent; N/m after a second
TIMES = np.geomspace(0.01, 3e4, 15)  # s
_SPACING = math.log(TIMES[1] / TIMES[0])
BRANCHES = CREEP * TIMES**-POWER * _SPACING / math.gamma(POWER)  # N/m

WARMING, WARMER, SOFTENING = 240.0, 14.0, 0.008  # s, K, 1/K


@deferred
def _contractile(pressure: float, lift: float) -> float:
    """Return the force of the inflated braid [N]."""
    return AREA * pressure * (A * (1.0 - ENDS * lift / LENGTH) ** 2 - B)


@deferred
def _elastic(lift: float) -> float:
    """Return the force of the cold rubber, and of the threads where they are stretched [N]."""
    return RUBBER * lift * (1.0 + HARDENING * lift * lift) + STOP * min(lift, 0.0)


@deferred
def _lifts(command: Array, weight: Array, step: float, substeps: int) -> Iterator[float]:
    """Yield the lift at every sample [mm], from pressures [bar] and weights [N]."""
    dt = step / substeps
    fading = np.exp(-dt / TIMES)
    crept = np.zeros(TIMES.size)
    pressure = lift = velocity = bristle = 0.0
    settling = 200  # samples at rest before the first
    for i in range(-settling, command.size):
        goal = 0.0 if i < 0 else command[i] * 1e5
        load = weight[max(i, 0)]
        mass = CARRIER + load / GRAVITY
        soft = 1.0 - SOFTENING * WARMER * (1.0 - math.exp(-max(i, 0) * step / WARMING))
        for _ in range(substeps):
            pressure += (goal - pressure) * dt / LAG
            creeping = 0.0
            for j in range(TIMES.size):
                crept[j] = lift + (crept[j] - lift) * fading[j]
                creeping += BRANCHES[j] * (lift - crept[j])
            sigma = UP if velocity > 0.0 else DOWN
            bristle += dt * sigma * (velocity - abs(velocity) * bristle)
            friction = bristle * (FRICTION + FRICTION_PER_PA * pressure)
            net = _contractile(pressure, lift) - soft * (_elastic(lift) + creeping)
            velocity += dt / mass * (net - friction - DAMPING * velocity - load)
            lift += dt * velocity
        if i >= 0:
            yield 1e3 * lift


def move(pressures: Array, loads: Array) -> Motion:
    """Return lifts [mm], shape (n, 1), from switch-on, from pressures [bar] and weights [N]."""
    commands, weight = BENCH.allowed(pressures[:, :1]), np.ascontiguousarray(loads[:, 0])
    return Motion(commands, _lifts(commands[:, 0], weight, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    """Return what is so of cold rubber, without its creep; times are those of the branches.

    The softening is the share of the rubber's stiffness that is lost in the end.
    """
    middle, nudge = 1e5 * BENCH.middle, 1e-6

    def net(lift: float) -> float:
        return float(_contractile(middle, lift) - _elastic(lift)) - BENCH.load

    rest = brentq(net, 0.0, 0.3 * LENGTH)
    friction = FRICTION + FRICTION_PER_PA * middle
    stiffness = (net(rest - nudge) - net(rest + nudge)) / (2e3 * nudge)
    return one_muscle(
        friction,
        stiffness,
        friction_grows_with_pressure=True,
        relaxation_times=tuple(map(float, TIMES)),
        lifts_from=1e-5 * BENCH.load / (AREA * (A - B)),
        line_lag=LAG,
        creep_power=POWER,
        softening=SOFTENING * WARMER,
        one_session=True,
    )


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, high = BENCH.sample_time, BENCH.high
    stairs = motions.stairs(rng, 40.0, step, 0.3, 4.8, (1.5, 5.0), step)
    parts = {
        "falling loops": motions.through([5.0, 0.0, 5.0, 1.0, 4.0, 1.5, 3.5, 2.0, 3.0], 60.0, step),
        "ramps": motions.ramps(rng, 60.0, step, 0.0, high, (0.3, 2.5), 2.0),
        "fast waves": motions.waves(rng, 60.0, step, 0.3, 4.8, (0.25, 2.0)),
        "waves": motions.waves(rng, 60.0, step, 0.2, 4.9, (0.03, 0.4)),
        "steps": motions.framed(stairs, step),
        "between": motions.ramps(rng, 200.0, step, 0.0, high, (0.5, 2.0), 3.0),
        "late waves": motions.waves(rng, 100.0, step, 0.2, 4.9, (0.04, 0.5)),
    }
    command = np.concatenate(list(parts.values()))
    weights = motions.stairs(rng, command.size * step, step, 15.0, 55.0, (8.0, 16.0), 0.5)
    session = record("session", command, weights)
    ends = np.cumsum([part.size for part in parts.values()])
    cut = {
        name: session.slice(int(end) - part.size, int(end)).with_meta(name=name)
        for end, (name, part) in zip(ends, parts.items(), strict=True)
    }
    train = (cut["falling loops"], cut["ramps"])
    test = {
        "patterns": (cut["waves"], cut["steps"]),
        "fast": (cut["fast waves"],),
        "late": (cut["late waves"],),
    }
    return train, test
