"""Three McKibben muscles in parallel: one section of a continuum arm that hangs down.

Equations, in SI units and with the section's mean contraction c and the tilts A and B of its tip:

- The section bends as one arc (Webster and Jones, Int. J. Robotics Research 29(13), 2010), so that
  muscle i, at radius d and azimuth f_i, contracts by x_i = c + d (A cos f_i + B sin f_i). What couples
  the muscles are a backbone that resists c and bending, and a weight at the tip, which hangs at (L - c)
  sin(T)/T, T² = A² + B².
- Pull of each braid, F = p (3 L² - b²) / (4 pi n²) (Chou and Hannaford, IEEE Trans. Robotics and
  Automation 12(1), 1996), less its rubber: an elastic part and two relaxations in parallel (generalised
  Maxwell body; Ferry, Viscoelastic Properties of Polymers, 1980).
- Dry friction of each braid after Dahl (AIAA Journal 14(12), 1976): F = s z, dz/dt = v - s |v| z /
  limit. The limit grows with the muscle's own pressure and, as muscles swell against each other, with
  the pressures of both neighbours: a motion of two muscles loses more where the third is filled.
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
    numbered("pressure", 3), (), numbered("displacement", 3), 0.02, high=6.0, noise=(0.004, 0.05)
)
SUBSTEPS = 40

BAR, GRAVITY = 1e5, 9.81
FILLING = 0.05  # s
LENGTH, DIAMETER, ANGLE = 0.270, 0.0150, math.radians(23.0)
THREAD = LENGTH / math.cos(ANGLE)
TURNS = THREAD * math.sin(ANGLE) / (math.pi * DIAMETER)
RADIUS = 0.045  # m, from the section's axis
ACROSS = np.cos(2.0 * np.pi / 3.0 * np.arange(3))  # cos f_i
ALONG = np.sin(2.0 * np.pi / 3.0 * np.arange(3))  # sin f_i

TIP, TURNING = 1.2, 0.02  # kg, kg m²
BACKBONE, BENDING = 9000.0, 1.0  # N/m, N m/rad
RUBBER, VISCOUS = 1300.0, 60.0  # N/m, N s/m
RELAXING, TIMES = (260.0, 200.0), (1.5, 15.0)  # N/m, s
SLACK, STOP = 0.006, 3.0e4  # m, N/m: threads jam where a muscle is pulled longer by more than that

FRICTION, OWN, NEIGHBOUR = 4.0, 1.6 / BAR, 1.4 / BAR  # N, N/Pa, N/Pa
BRISTLE = 1.6e4  # N/m


@deferred
def _braid(pressure: float, x: float) -> float:
    """Return the pull of one braid [N] at a gauge pressure [Pa]."""
    return pressure * (3.0 * (LENGTH - x) ** 2 - THREAD**2) / (4.0 * math.pi * TURNS**2)


@deferred
def _limit(pressures: Array, i: int) -> float:
    """Return the dry friction of one muscle that slides [N]."""
    neighbours = pressures[(i + 1) % 3] + pressures[(i + 2) % 3]
    return FRICTION + OWN * pressures[i] + NEIGHBOUR * neighbours


@deferred
def _run(commands: Array, step: float, substeps: int) -> Iterator[tuple[float, float, float]]:
    pose, speed, force, pressures = np.zeros((4, 3))  # the first three of c, A and B
    bristles, relaxed = np.zeros(3), np.zeros((3, len(TIMES)))
    dt = step / substeps
    moved = np.empty(3)
    for k in range(len(commands)):
        for i in range(3):
            moved[i] = pose[0] + RADIUS * (pose[1] * ACROSS[i] + pose[2] * ALONG[i])
        yield 1e3 * moved[0], 1e3 * moved[1], 1e3 * moved[2]
        following = min(k + 1, len(commands) - 1)
        for j in range(substeps):
            tilt = pose[1] ** 2 + pose[2] ** 2
            hanging = TIP * GRAVITY * (LENGTH - pose[0])
            righting = BENDING + hanging * (1.0 / 3.0 - tilt / 30.0)
            force[0] = -BACKBONE * pose[0] - TIP * GRAVITY * (1.0 - tilt / 6.0 + tilt**2 / 120.0)
            force[1], force[2] = -righting * pose[1], -righting * pose[2]
            for i in range(3):
                ahead = (commands[following, i] - commands[k, i]) * (j + 1) / substeps
                pressures[i] += dt / FILLING * ((commands[k, i] + ahead) * BAR - pressures[i])
            for i in range(3):
                x = pose[0] + RADIUS * (pose[1] * ACROSS[i] + pose[2] * ALONG[i])
                v = speed[0] + RADIUS * (speed[1] * ACROSS[i] + speed[2] * ALONG[i])
                pull = _braid(pressures[i], x) - RUBBER * x - VISCOUS * v
                for r in range(len(TIMES)):
                    pull -= RELAXING[r] * (x - relaxed[i, r])
                    relaxed[i, r] += dt * (x - relaxed[i, r]) / TIMES[r]
                if x < -SLACK:
                    pull -= STOP * (x + SLACK)
                longest = _limit(pressures, i) / BRISTLE
                z = (bristles[i] + dt * v) / (1.0 + dt * abs(v) / longest)
                bristles[i] = min(max(z, -longest), longest)
                pull -= BRISTLE * bristles[i]
                force[0] += pull
                force[1] += RADIUS * ACROSS[i] * pull
                force[2] += RADIUS * ALONG[i] * pull
            for i in range(3):
                speed[i] += dt * force[i] / (TIP if i == 0 else TURNING)
                pose[i] += dt * speed[i]


def move(pressures: Array, loads: Array) -> Motion:
    """Return contractions [mm], shape (n, 3), at three pressures [bar]; no loads."""
    commands, lead = motions.from_empty(BENCH.allowed(pressures), BENCH.sample_time)
    return after(lead, commands, _run(commands, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    middle, nudge = 3.0 * BAR, 1e-5

    def net(x: float) -> float:
        """Return what is left [N] where all three muscles pull alike."""
        return 3 * (_braid(middle, x) - RUBBER * x) - BACKBONE * x - TIP * GRAVITY

    x = brentq(net, 0.0, 0.3 * LENGTH)
    slope = (_braid(middle, x - nudge) - _braid(middle, x + nudge)) / (2 * nudge) + RUBBER
    lengthwise = 3 * slope + BACKBONE
    hanging = TIP * GRAVITY * (LENGTH - x) / 3
    sideways = 1.5 * slope + (BENDING + hanging) / RADIUS**2
    limit = _limit(np.full(3, middle), 0)
    stiffness = 1e-3 / (1 / lengthwise + 1 / sideways)
    return {
        "identical_muscles": True,
        "friction_share": (1 / 3, 1 / 3, 1 / 3),
        "friction": (limit, limit, limit),
        "friction_grows_with_pressure": True,
        "friction_per_bar": OWN * BAR,
        "friction_per_bar_of_neighbours": NEIGHBOUR * BAR,
        "static_stiffness": (stiffness,) * 3,
        "loop_width": 2 * limit / stiffness,
        "muscle_stiffness": 1e-3 * slope,
        "relaxation_times": TIMES,
        "relaxing_share": sum(RELAXING) / (RUBBER + sum(RELAXING)),
        "dead_zone": 0.0,
        "line_lag": FILLING,
    }


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, low, high = BENCH.sample_time, 0.3, 5.0

    def wander(seconds: float, strokes: tuple[float, float]) -> Array:
        drawn = [motions.wander(rng, seconds, step, low, high, strokes) for _ in range(3)]
        return np.column_stack(drawn)

    def circles(seconds: float, period: float) -> Array:
        """Lead the tip around in a spiral, while the whole section contracts and lengthens."""
        turns = np.pi * np.array([0.0, 2 / 3, 4 / 3])
        swings = [motions.swell(seconds, step, -1.8, 1.8, period, (1, 0.3), t) for t in turns]
        whole = motions.swell(seconds, step, 2.2, 3.1, 3.7 * period, (1.0, 1.0))
        return whole[:, None] + np.column_stack(swings)

    def pair(third: float) -> Array:
        """Swing two muscles against each other, the third held."""
        swing = motions.swell(20.0, step, -2.0, 2.0, 5.0, (1.0, 0.4))
        return np.column_stack([2.7 + swing, 2.7 - swing, np.full(swing.size, third)])

    train = (
        record("wandering", wander(70.0, (0.8, 4.0))),
        record("wandering slowly", wander(40.0, (2.0, 6.0))),
    )
    test = {
        "patterns": (record("patterns", wander(40.0, (0.8, 4.0))),),
        "joint motion": (record("circles", circles(40.0, 5.0)),),
        "third held": (record("third low", pair(0.8)), record("third high", pair(4.5))),
    }
    return train, test
