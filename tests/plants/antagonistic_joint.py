"""Two McKibben muscles that pull a pulley to either side, against a payload.

Equations, in SI units and with the joint's angle q and the muscles' lengths L1 = L - r q and L2 = L + r
q:

- Pull of braid and bladder by virtual work, F = -p dV/dL + Vb dW/dL (Klute and Hannaford, ASME J.
  Dynamic Systems, Measurement, and Control 122(2), 2000): threads of length b in n turns (Chou and
  Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996) around a Mooney-Rivlin bladder, W = C10
  (I1 - 3) + C01 (I2 - 3), that keeps its volume Vb. Cables cannot push, so F >= 0.
- Dry friction in the joint's bearing and in both braids, Coulomb's with Stribeck (Armstrong-Hélouvry et
  al., Automatica 30(7), 1994): g(v) = Fc + (Fs - Fc) exp(-(v/vs)²); it sticks truly, by the implicit
  step of Moreau (Nonsmooth Mechanics and Applications, 1988).
- J d²q/dt² = r (F1 - F2) - payload - viscous torque - friction. The payload hangs on a pulley of its
  own, so that its torque is known and does not depend on the angle. The angle can fall while one
  pressure rises: where the other rises faster, or the payload grows.
- Each muscle fills with one time constant from the pressure that is recorded at its valve.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from mckibben.arrays import Array
from mckibben.system.compiling import deferred
from tests.plants import motions
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, after, numbered

BENCH = Bench(
    numbered("pressure", 2), ("torque",), ("angle",), 0.02, high=6.0, noise=(0.003, 0.001)
)
SUBSTEPS = 40

BAR = 1e5
FILLING = 0.03  # s
PULLEY, MOUNTED = 0.020, 0.190  # m, m: length of both muscles where the angle is 0
LENGTHS = (0.220, 0.223)  # m, at rest: the second muscle is another one
DIAMETER, ANGLE = 0.011, math.radians(22.0)
C10, C01 = 118.4e3, 105.7e3  # Pa, latex (Klute and Hannaford 2000)
WALLS = (7.0e-6, 7.8e-6)  # m³ of rubber

MUSCLE_COULOMB, MUSCLE_STATIC, MUSCLE_STRIBECK = (4.5, 3.6), 1.15, 0.006  # N, share, m/s
JOINT_COULOMB, JOINT_STATIC, JOINT_STRIBECK = 0.06, 1.3, 0.25  # N m, share, rad/s
INERTIA, VISCOUS = 0.008, 0.15  # kg m², N m s/rad


@deferred
def _pull(pressure: float, length: float, rest: float, wall: float) -> float:
    """Return the pull of one muscle [N] at a gauge pressure [Pa]; below 0 it would push."""
    thread = rest / math.cos(ANGLE)
    turning = thread * math.sin(ANGLE) / DIAMETER  # turns times pi
    wide = math.sqrt(thread**2 - length**2) / turning
    braid = pressure * (3.0 * length**2 - thread**2) * math.pi / (4.0 * turning**2)

    long, round_ = length / rest, wide / DIAMETER
    d_long, d_round = 1.0 / rest, -length / (turning**2 * wide * DIAMETER)
    thin = 1.0 / (long * round_) ** 2  # the third stretch, squared
    d_product = d_long * round_ + long * d_round
    d_i1 = 2.0 * (long * d_long + round_ * d_round - thin * d_product / (long * round_))
    d_i2 = 2.0 * (long * round_ * d_product - d_long / long**3 - d_round / round_**3)
    return braid + wall * (C10 * d_i1 + C01 * d_i2)


@deferred
def _dry(speed: float) -> float:
    """Return the largest torque of dry friction [N m] at a joint's speed [rad/s]."""
    dip = math.exp(-((speed * PULLEY / MUSCLE_STRIBECK) ** 2))
    muscles = sum(MUSCLE_COULOMB) * PULLEY * (1.0 + (MUSCLE_STATIC - 1.0) * dip)
    dip = math.exp(-((speed / JOINT_STRIBECK) ** 2))
    return muscles + JOINT_COULOMB * (1.0 + (JOINT_STATIC - 1.0) * dip)


@deferred
def _run(commands: Array, payloads: Array, step: float, substeps: int) -> Iterator[float]:
    angle = speed = 0.0
    first, second = commands[0, 0] * BAR, commands[0, 1] * BAR
    dt = step / substeps
    for k in range(len(commands)):
        yield angle
        following = min(k + 1, len(commands) - 1)
        ahead = commands[following] - commands[k]
        for j in range(substeps):
            part = (j + 1) / substeps
            first += dt / FILLING * ((commands[k, 0] + ahead[0] * part) * BAR - first)
            second += dt / FILLING * ((commands[k, 1] + ahead[1] * part) * BAR - second)
            payload = payloads[k] + (payloads[following] - payloads[k]) * part
            up = _pull(first, MOUNTED - PULLEY * angle, LENGTHS[0], WALLS[0])
            down = _pull(second, MOUNTED + PULLEY * angle, LENGTHS[1], WALLS[1])
            torque = PULLEY * (max(up, 0.0) - max(down, 0.0)) - payload - VISCOUS * speed
            free = speed + dt * torque / INERTIA
            kept = max(abs(free) - dt * _dry(free) / INERTIA, 0.0)
            speed = math.copysign(kept, free)
            angle += dt * speed


def move(pressures: Array, loads: Array) -> Motion:
    """Return angles [rad], shape (n, 1), at two pressures [bar] and a payload's torque [N m]."""
    commands, lead = motions.from_empty(BENCH.allowed(pressures), BENCH.sample_time)
    payloads = np.append(np.linspace(0.0, loads[0, 0], lead), loads[:, 0])
    return after(lead, commands, _run(commands, payloads, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    middle, nudge = 3.0 * BAR, 1e-5
    pairs = tuple(zip(LENGTHS, WALLS, strict=True))

    def ends(angle: float) -> tuple[float, float]:
        return MOUNTED - PULLEY * angle, MOUNTED + PULLEY * angle

    def net(angle: float) -> float:
        up, down = (_pull(middle, at, *pair) for at, pair in zip(ends(angle), pairs, strict=True))
        return up - down

    def stiffness(at: float, pair: tuple[float, float]) -> float:
        ahead, behind = _pull(middle, at + nudge, *pair), _pull(middle, at - nudge, *pair)
        return 1e-3 * (ahead - behind) / (2 * nudge)

    rest = brentq(net, -0.5, 0.5)
    both = sum(stiffness(at, pair) for at, pair in zip(ends(rest), pairs, strict=True))
    whole = sum(MUSCLE_COULOMB) * PULLEY + JOINT_COULOMB
    opens = [brentq(lambda p, pair=pair: _pull(p, MOUNTED, *pair), 0.0, middle) for pair in pairs]
    return {
        "identical_muscles": False,
        "friction_share": tuple(PULLEY * one / whole for one in MUSCLE_COULOMB),
        "friction": MUSCLE_COULOMB,
        "joint_friction_share": JOINT_COULOMB / whole,
        "friction_torque": whole,
        "friction_grows_with_pressure": False,
        "static_stiffness": (both, both),
        "joint_stiffness": 1e3 * both * PULLEY**2,
        "loop_width": 2 * whole / (1e3 * both * PULLEY**2),
        "relaxation_times": (),
        "dead_zone": max(opens) / BAR,
        "line_lag": FILLING,
        "pulley": 1e3 * PULLEY,
    }


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, low, high = BENCH.sample_time, 0.8, 5.0

    def apart(seconds: float) -> Array:
        return np.column_stack([motions.wander(rng, seconds, step, low, high) for _ in range(2)])

    def against(seconds: float) -> Array:
        """Swing one muscle against the other, about a pressure of both that changes slowly."""
        both = motions.wander(rng, seconds, step, 2.2, 3.6, (6.0, 12.0))
        swing = motions.wander(rng, seconds, step, -1.4, 1.4)
        return np.column_stack([both + swing, both - swing])

    nested = motions.swell(30.0, step, -1.6, 1.6, 5.0)
    changing = motions.stairs(rng, 30.0, step, -0.8, 1.6, (4.0, 8.0), 1.0)
    train = (
        record("apart, free", apart(40.0), 0.0),
        record("apart, payload", apart(40.0), 0.8),
        record("against, payload", against(30.0), -0.5),
    )
    test = {
        "patterns": (record("nested loops", 3.0 + np.column_stack([nested, -nested]), 0.0),),
        "other payloads": (record("against", against(30.0), 0.4),),
        "payloads beyond training": (record("apart", apart(30.0), 1.4),),
        "changing payload": (record("against, changing", against(30.0), changing),),
    }
    return train, test
