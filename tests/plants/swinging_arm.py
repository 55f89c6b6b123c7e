"""An arm that two unequal muscles swing over a pulley, with a weight at its end.

Equations, in SI units but pressures in bar, and with the arm's angle q and the muscles' contractions x1
= X1 + r q and x2 = X2 - r q:

- Muscles of three elements in parallel, F = F0 + F1 p - (K0 + K1 p) x - B v, whose damper is another
  where a muscle contracts than where it lengthens, B = B0 + B1 p (Reynolds, Repperger, Phillips and
  Bandry, Annals of Biomedical Engineering 31(3), 2003). Ropes cannot push, so F >= 0.
- J(m) d²q/dt² = r (F1 - F2) - m g l sin(q + q0) - friction - viscous torque. The weight's mass m is
  known. Its torque depends on where the arm is, and its inertia slows it.
- Dry friction of the bush, which is pressed by both muscles and the weight (Bowden and Tabor, The
  Friction and Lubrication of Solids, 1950), with Stribeck; and of both braids, which grows with their
  pressures. All are elastoplastic (Dupont, Hayward, Armstrong and Altpeter, IEEE Trans. Automatic
  Control 47(5), 2002), so that they are springs for small motion, and do not drift: dz = v [1 - a(z, v)
  z/z_max] dt.
- Regulators of second order whose flow is limited, more so on venting. What they are asked for is
  recorded.

Training swings the pressures against each other: their sum is constant. Some tests have another sum, or
one that changes.
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
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, after, numbered

BENCH = Bench(
    numbered("pressure", 2), ("mass",), ("angle",), 0.01, high=6.0, noise=(0.004, 0.0008), load=1.0
)
SUBSTEPS = 20

GRAVITY, PULLEY = 9.81, 0.030  # m/s², m
MOUNTED = np.array([0.012, 0.020])  # m that they are contracted at an angle of 0
PULLS = np.array([[8.0, 75.0], [10.0, 105.0]])  # N, N/bar
SPRINGS = np.array([[1500.0, 2200.0], [1200.0, 2600.0]])  # N/m, N/(m bar)
CONTRACTING = np.array([[150.0, 40.0], [190.0, 50.0]])  # N s/m, N s/(m bar)
LENGTHENING = np.array([[90.0, 14.0], [120.0, 16.0]])
BRAIDS = np.array([[1.4, 0.70], [1.8, 0.95]])  # N, N/bar

ARM, ARM_INERTIA = 0.35, 0.012  # N m of the arm itself where it is level, kg m²
REACH, HANGING = 0.20, 0.6  # m, rad from where the weight hangs straight down
VISCOUS = 0.10  # N m s/rad
BUSH, STICKING, STRIBECK = 6.0e-4, 1.3, 0.12  # m (ratio times radius), ratio, rad/s
BRISTLE, BRAID_BRISTLE = 0.004, 0.005  # rad that they bend by before they slide
ELASTIC = 0.6  # share of the limit up to which nothing slides
BRISTLE_DAMPING = 0.05  # N m s/rad, of each

NATURAL, DAMPED = 45.0, 0.65  # rad/s, ratio
FASTEST, VENTING = 18.0, 12.0  # bar/s


@deferred
def _pull(i: int, pressure: float, angle: float, speed: float) -> float:
    """Return the pull of a muscle's rope [N]."""
    sign = 1.0 if i == 0 else -1.0
    x, v = MOUNTED[i] + sign * PULLEY * angle, sign * PULLEY * speed
    damper = CONTRACTING[i] if v > 0.0 else LENGTHENING[i]
    pull = PULLS[i, 0] + PULLS[i, 1] * pressure - (SPRINGS[i, 0] + SPRINGS[i, 1] * pressure) * x
    return max(pull - (damper[0] + damper[1] * pressure) * v, 0.0)


@deferred
def _weight(mass: float, angle: float) -> float:
    """Return the torque of arm and weight [N m]."""
    return (ARM + mass * GRAVITY * REACH) * math.sin(angle + HANGING)


@deferred
def _bend(bent: float, speed: float, slide: float) -> float:
    """Return how fast a bristle bends [share of its limit/s], by Dupont's a(z, v).

    ``slide`` is the speed in limits per second at which it would bend if nothing slid, and ``bent`` is
    told in limits, which is steady where it is 1.
    """
    if bent * speed <= 0.0 or abs(bent) <= ELASTIC:
        return slide
    share = min((abs(bent) - ELASTIC) / (1.0 - ELASTIC), 1.0)
    sliding = 0.5 - 0.5 * math.cos(math.pi * share)
    return slide * (1.0 - sliding * abs(bent))


@deferred
def _limits(first: float, second: float, pressures: Array, mass: float, speed: float) -> Array:
    """Return the dry friction of bush and braids where they slide [N m]."""
    sticking = 1.0 + (STICKING - 1.0) * math.exp(-((speed / STRIBECK) ** 2))
    limits = np.empty(3)
    limits[0] = BUSH * (first + second + (mass + 0.3) * GRAVITY) * sticking
    for i in range(2):
        limits[1 + i] = PULLEY * (BRAIDS[i, 0] + BRAIDS[i, 1] * pressures[i])
    return limits


@deferred
def _rates(state: Array, pressures: Array, mass: float, rates: Array) -> None:
    """Set the derivatives of angle, speed, and of what bush and braids are bent by [rad]."""
    angle, speed = state[0], state[1]
    first = _pull(0, pressures[0], angle, speed)
    second = _pull(1, pressures[1], angle, speed)
    torque = PULLEY * (first - second) - _weight(mass, angle) - VISCOUS * speed
    limits = _limits(first, second, pressures, mass, speed)
    slow = _limits(100.0, 100.0, pressures, mass, 1e3)
    for i in range(3):
        stiffness = slow[i] / (BRISTLE if i == 0 else BRAID_BRISTLE)
        most = limits[i] / stiffness
        rates[2 + i] = most * _bend(state[2 + i] / most, speed, speed / most)
        torque -= stiffness * state[2 + i] + BRISTLE_DAMPING * rates[2 + i]
    rates[0] = speed
    rates[1] = torque / (ARM_INERTIA + mass * REACH**2)


@deferred
def _run(commands: Array, masses: Array, step: float, substeps: int) -> Iterator[float]:
    state, rates = np.zeros(5), np.zeros((4, 5))
    state[0] = -HANGING
    pressures, flows = commands[0].copy(), np.zeros(2)
    middle = np.empty(2)
    dt = step / substeps
    for k in range(len(commands)):
        yield state[0]
        following = min(k + 1, len(commands) - 1)
        for j in range(substeps):
            part = (j + 0.5) / substeps
            mass = masses[k] + (masses[following] - masses[k]) * part
            for i in range(2):
                goal = commands[k, i] + (commands[following, i] - commands[k, i]) * part
                pull = NATURAL**2 * (goal - pressures[i])
                # an implicit step of the regulator's own damping
                flows[i] = (flows[i] + dt * pull) / (1.0 + 2.0 * dt * DAMPED * NATURAL)
                flows[i] = min(max(flows[i], -VENTING), FASTEST)
                middle[i] = max(pressures[i] + 0.5 * dt * flows[i], 0.0)
                pressures[i] = max(pressures[i] + dt * flows[i], 0.0)
            _rates(state, middle, mass, rates[0])  # Runge and Kutta's step
            _rates(state + 0.5 * dt * rates[0], middle, mass, rates[1])
            _rates(state + 0.5 * dt * rates[1], middle, mass, rates[2])
            _rates(state + dt * rates[2], middle, mass, rates[3])
            state += dt / 6.0 * (rates[0] + 2.0 * rates[1] + 2.0 * rates[2] + rates[3])


def move(pressures: Array, loads: Array) -> Motion:
    """Return angles [rad], shape (n, 1), at two pressures that are asked for [bar] and masses [kg]."""
    commands, lead = motions.from_empty(BENCH.allowed(pressures), BENCH.sample_time)
    masses = np.append(np.full(lead, loads[0, 0]), loads[:, 0])
    return after(lead, commands, _run(commands, masses, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    """Return what is so; the joint's stiffness is with its weight."""
    middle, mass, nudge = BENCH.middle, BENCH.load, 1e-5
    both = np.full(2, middle)

    def net(angle: float) -> float:
        first, second = (float(_pull(i, middle, angle, 0.0)) for i in range(2))
        return PULLEY * (first - second) - float(_weight(mass, angle))

    rest = brentq(net, -1.0, 1.0)
    first, second = (float(_pull(i, middle, rest, 0.0)) for i in range(2))
    bush, *braids = map(float, _limits(first, second, both, mass, 1e3))
    whole = bush + sum(braids)
    stiffness = (net(rest - nudge) - net(rest + nudge)) / (2 * nudge)
    return {
        "identical_muscles": False,
        "friction_share": tuple(one / whole for one in braids),
        "friction": tuple(one / PULLEY for one in braids),
        "joint_friction_share": bush / whole,
        "friction_torque": whole,
        "friction_grows_with_pressure": True,
        "static_stiffness": (1e-3 * stiffness / PULLEY**2,) * 2,
        "joint_stiffness": stiffness,
        "loop_width": 2 * whole / stiffness,
        "relaxation_times": (),
        "dead_zone": 0.0,
        "line_lag": 2 * DAMPED / NATURAL,
        "pulley": 1e3 * PULLEY,
    }


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, most = BENCH.sample_time, 2.3

    def against(name: str, swing: Array, mass: float | Array, both: float | Array) -> Recording:
        """Record while one pressure rises by what the other falls; ``both`` is their mean."""
        return record(name, np.column_stack([both + swing, both - swing]), mass)

    def ramps(seconds: float) -> Array:
        return motions.ramps(rng, seconds, step, -most, most, (0.4, 3.0), 1.0)

    def waves(seconds: float, size: float, band: tuple[float, float]) -> Array:
        return motions.waves(rng, seconds, step, -size, size, band)

    falling = [most, -most, 2.0, -1.8, 1.5, -1.2, 1.0, -0.6]
    mean = 2.9 + motions.waves(rng, 35.0, step, -0.9, 1.1, (0.04, 0.2))
    carried = motions.stairs(rng, 35.0, step, 0.4, 1.7, (4.0, 8.0), 0.5)
    train = (
        against("falling loops, 0.4 kg", motions.through(falling, 30.0, step), 0.4, 3.0),
        against("ramps, 1.0 kg", ramps(35.0), 1.0, 3.0),
        against("ramps, 1.6 kg", ramps(35.0), 1.6, 3.0),
    )
    test = {
        "patterns": (against("waves, 1.0 kg", waves(40.0, 2.2, (0.05, 0.5)), 1.0, 3.0),),
        "other masses": (
            against("waves, 0.7 kg", waves(30.0, 2.2, (0.05, 0.5)), 0.7, 3.0),
            against("waves, 2.1 kg", waves(30.0, 2.2, (0.05, 0.5)), 2.1, 3.0),
        ),
        "changing mass": (against("stairs", waves(35.0, 2.0, (0.05, 0.5)), carried, 3.0),),
        "other sums": (
            against("soft, 1.0 kg", waves(30.0, 1.6, (0.05, 0.5)), 1.0, 2.2),
            against("stiff, 1.0 kg", waves(30.0, 1.6, (0.05, 0.5)), 1.0, 3.8),
        ),
        "changing sum": (against("both", waves(35.0, 1.7, (0.05, 0.5)), 1.0, mean),),
        "fast": (against("fast waves, 1.0 kg", waves(25.0, 2.0, (0.4, 3.0)), 1.0, 3.0),),
    }
    return train, test
