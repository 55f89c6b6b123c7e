"""A muscle that lifts changing weights, creeps by a power law, and softens as it warms.

- Muscle: virtual work on a cylinder of braided fibres, F = πr₀²p [a (1 − kε)² − b], with
  a = 3/tan²α₀ and b = 1/sin²α₀, and k for its conical ends. Chou & Hannaford, IEEE Trans. Robotics and
  Automation 12 (1996); Tondu & Lopez, IEEE Control Systems 20 (2000).
- Friction between the threads: Dahl (1968), dz/dt = σv (1 − sgn(v) z), F = z (f₀ + f₁p), with another σ
  for each direction, as threads that are being pressed together yield sooner.
- Creep of the rubber: a spring-pot, whose modulus of relaxation is E(t) = c t^−α / Γ(1 − α). Because
  t^−α = 1/Γ(α) ∫ s^α e^−st d(ln s), it is a sum of Maxwell branches whose times are evenly spaced in
  logarithm. Mainardi, Fractional Calculus and Waves in Linear Viscoelasticity (2010).
- Warming: Newton's law towards the temperature of the compressed air, T' = (T∞ − T)/τ, and a rubber
  that loses a share of its stiffness with every kelvin. Ferry, Viscoelastic Properties of Polymers
  (1980).
- Regulator: a lag of first order.

The session of ten minutes is one simulation, of which some stretches are recorded. `respond` begins at
switch-on, as training does.
"""

from __future__ import annotations

import math

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.system.compiling import deferred
from tests.plants import Plant
from tests.plants.courses import allowed, measured, stepping, through, wandering, waving

STEP = 0.01  # s between samples
SUBSTEPS = 20
HIGH = 5.0  # bar
SPAN = 40.0  # mm

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
def _lifts(command: Array, weight: Array) -> Array:
    """Return the lift at every sample [mm], from pressures [bar] and weights [N]."""
    lifts = np.empty(command.size)
    step = STEP / SUBSTEPS
    fading = np.exp(-step / TIMES)
    crept = np.zeros(TIMES.size)
    pressure = lift = velocity = bristle = 0.0
    settling = 200  # samples at rest before the first
    for i in range(-settling, command.size):
        goal = 0.0 if i < 0 else command[i] * 1e5
        load = weight[max(i, 0)]
        mass = CARRIER + load / GRAVITY
        soft = 1.0 - SOFTENING * WARMER * (1.0 - math.exp(-max(i, 0) * STEP / WARMING))
        for _ in range(SUBSTEPS):
            pressure += (goal - pressure) * step / LAG
            creeping = 0.0
            for j in range(TIMES.size):
                crept[j] = lift + (crept[j] - lift) * fading[j]
                creeping += BRANCHES[j] * (lift - crept[j])
            sigma = UP if velocity > 0.0 else DOWN
            bristle += step * sigma * (velocity - abs(velocity) * bristle)
            friction = bristle * (FRICTION + FRICTION_PER_PA * pressure)
            net = _contractile(pressure, lift) - soft * (_elastic(lift) + creeping)
            velocity += step / mass * (net - friction - DAMPING * velocity - load)
            lift += step * velocity
        if i >= 0:
            lifts[i] = 1e3 * lift
    return lifts


def respond(commands: Array, loads: Array) -> Array:
    """Return lifts [mm], shape (n, 1), from switch-on, from pressures [bar] and weights [N]."""
    return _lifts(allowed(commands[:, 0], HIGH), np.ascontiguousarray(loads[:, 0]))[:, None]


def facts() -> dict[str, float | bool | tuple[float, ...]]:
    """Return what is so at half pressure and a lift of 20 mm, where the rubber is cold.

    Shares of friction are those of its force in the braid's, up and down; stiffness is in N/mm, without
    creep; times are those of the branches; the dead zone is where the braid takes 30 N over from the
    stretched threads; softening is the share of the rubber's stiffness that is lost in the end.
    """
    pressure, lift, by = 0.5e5 * HIGH, 0.020, 1e-6
    friction = FRICTION + FRICTION_PER_PA * pressure
    share = friction / float(_contractile(pressure, lift))

    def net(x: float) -> float:
        return float(_contractile(pressure, x) - _elastic(x))

    stiffness = -(net(lift + by) - net(lift - by)) / (2 * by)
    return {
        "friction_shares": (share, share),
        "static_stiffness": 1e-3 * stiffness,
        "relaxation_times": tuple(map(float, TIMES)),
        "dead_zone": 1e-5 * 30.0 / (AREA * (A - B)),
        "friction_grows_with_pressure": True,
        "identical_muscles": True,
        "creep_power": POWER,
        "softening": SOFTENING * WARMER,
    }


def plant(seed: int) -> Plant:
    """Return the lifter, with a session that this seed draws."""
    rng = np.random.default_rng((seed, 1))
    falling = through([5.0, 0.0, 5.0, 1.0, 4.0, 1.5, 3.5, 2.0, 3.0], 60.0, STEP)
    ramps = wandering(rng, 60.0, STEP, low=0.0, high=HIGH, speed=(0.3, 2.5), rest=2.0)
    fast = waving(rng, 60.0, STEP, low=0.3, high=4.8, band=(0.25, 2.0))
    patterns = np.concatenate(
        [
            waving(rng, 60.0, STEP, low=0.2, high=4.9, band=(0.03, 0.4)),
            stepping(rng, 40.0, STEP, low=0.3, high=4.8, hold=(1.5, 5.0)),
        ]
    )
    between = wandering(rng, 200.0, STEP, low=0.0, high=HIGH, speed=(0.5, 2.0), rest=3.0)
    late = waving(rng, 100.0, STEP, low=0.2, high=4.9, band=(0.04, 0.5))
    parts = [falling, ramps, fast, patterns, between, late]
    command = np.concatenate(parts)
    weight = _weights(rng, command.size)
    lift = respond(command[:, None], weight[:, None])[:, 0]
    session = Recording(
        {
            "pressure": measured(rng, command, HIGH),
            "force": weight,
            "displacement": measured(rng, lift, SPAN),
        },
        sample_time=STEP,
        meta={"rig": "lifter (virtual)", "load": "known weights"},
    )
    ends = np.cumsum([0, *(part.size for part in parts)])
    names = ["falling loops", "ramps", "fast waves", "waves and steps", "between", "late waves"]
    falls, ramped, fasts, patterned, _, lates = (
        session.slice(int(start), int(stop)).with_meta(name=name)
        for name, start, stop in zip(names, ends[:-1], ends[1:], strict=True)
    )
    return Plant(
        name="lifter",
        title="A muscle that lifts changing weights, creeps and warms",
        sources="Chou & Hannaford 1996; Tondu & Lopez 2000; Dahl 1968; Mainardi 2010; Ferry 1980",
        train=(falls, ramped),
        test={"patterns": (patterned,), "fast": (fasts,), "late": (lates,)},
        respond=respond,
        facts=facts(),
    )


def _weights(rng: np.random.Generator, n: int) -> Array:
    """Return weights [N] that are put on and taken off, each within half a second, every 8 to 16 s."""
    times, weights = [0.0], [30.0]
    while times[-1] < n * STEP:
        times.append(times[-1] + float(rng.uniform(8.0, 16.0)))
        weights.append(weights[-1])
        times.append(times[-1] + 0.5)
        weights.append(float(rng.choice([15.0, 25.0, 35.0, 45.0, 55.0])))
    return np.interp(np.arange(n) * STEP, times, weights)
