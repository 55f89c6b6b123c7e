"""A continuum section of three bellows side by side, whose tip is moved in a plane.

- Bellows: each pushes with its area times its pressure, and resists with a spring that hardens.
- Shared elasticity: the plates and the core tie the three together, energy = ½k_a (Σe)²/3 + ½k_b Σ(e −
  mean e)², so that one bellows' pressure moves all. Jones & Walker, IEEE Trans. Robotics 22 (2006).
- Friction: Maxwell-slip elements (Jenkins' springs that slide), F = Σ k_j z_j with |z_j| ≤ Δ_j, and
  Coulomb's friction with real standstill. Iwan, J. Applied Mechanics 33 (1966); Lampaert, Swevers &
  Al-Bender, IEEE Trans. Automatic Control 47 (2002).
- Shape: constant curvature. Lengths l_i = s − θ d cos(γ_i − φ) around a core at a distance d give the
  arc s, its angle θ and its direction φ, and the tip lies s (1 − cos θ)/θ aside. Webster & Jones, Int.
  J. Robotics Research 29 (2010).
- Regulators: lags of first order. Mass is left out: the motion is overdamped.
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
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, numbered

BENCH = Bench(
    numbered("pressure", 3),
    (),
    ("displacement_x", "displacement_y"),
    0.02,
    high=2.0,
    noise=(0.001, 0.035),
)
SUBSTEPS = 40

LENGTH, AROUND = 120.0, 15.0  # mm
AREAS = np.array([20.0, 18.9, 21.2])  # N/bar
OWN, HARDENING = np.array([1.20, 1.27, 1.14]), 0.0012  # N/mm, 1/mm²
STRETCHING, BENDING = 0.9, 0.35  # N/mm
SPRINGS = np.array([0.55, 0.35, 0.20, 0.12])  # N/mm, of Maxwell-slip elements
SLIDING = np.array([0.25, 0.7, 1.8, 4.0])  # mm that they are stretched where they slide
ROUGHNESS = np.array([1.0, 1.2, 0.85])  # of each bellows, on all its friction
COULOMB = 0.45  # N
DAMPING, LAG = 0.12, 0.05  # N s/mm, s


@deferred
def _tip(lengths: Array) -> tuple[float, float]:
    """Return where the tip is of a section with bellows at 0°, 120° and 240° [mm]."""
    arc = (lengths[0] + lengths[1] + lengths[2]) / 3.0
    along = -(2.0 * lengths[0] - lengths[1] - lengths[2]) / (3.0 * AROUND)  # θ cos φ
    across = -(lengths[1] - lengths[2]) / (math.sqrt(3.0) * AROUND)  # θ sin φ
    angle = math.hypot(along, across)
    # (1 − cos θ)/θ², with its limit
    share = 0.5 - angle**2 / 24.0 if angle < 1e-4 else (1.0 - math.cos(angle)) / angle**2
    return arc * share * along, arc * share * across


@deferred
def _tips(command: Array, step: float, substeps: int) -> Iterator[tuple[float, float]]:
    """Yield the tip at every sample [mm] from pressures [bar], shape (n, 3)."""
    dt = step / substeps
    pressure, longer, moved = np.zeros(3), np.zeros(3), np.zeros(3)
    bristles = np.zeros((3, SPRINGS.size))
    for i in range(command.shape[0]):
        for _ in range(substeps):
            total = longer[0] + longer[1] + longer[2]
            for m in range(3):
                pressure[m] += (command[i, m] - pressure[m]) * dt / LAG
                left = AREAS[m] * pressure[m]
                left -= OWN[m] * longer[m] * (1.0 + HARDENING * longer[m] ** 2)
                left -= STRETCHING * total / 3.0 + BENDING * (longer[m] - total / 3.0)
                for j in range(SPRINGS.size):
                    left -= ROUGHNESS[m] * SPRINGS[j] * bristles[m, j]
                beyond = max(abs(left) - ROUGHNESS[m] * COULOMB, 0.0)
                moved[m] = math.copysign(dt * beyond / DAMPING, left)
            for m in range(3):
                longer[m] += moved[m]
                for j in range(SPRINGS.size):
                    stretched = bristles[m, j] + moved[m]
                    bristles[m, j] = min(max(stretched, -SLIDING[j]), SLIDING[j])
        yield _tip(LENGTH + longer)


def move(pressures: Array, loads: Array) -> Motion:
    """Return the tip's x and y [mm], shape (n, 2), of a section that begins vented; it has no loads."""
    commands = BENCH.allowed(pressures)
    return Motion(commands, _tips(commands, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    """Stiffnesses are those of every bellows while the others are held."""
    force = AREAS * BENCH.middle
    longer = brentq(
        lambda x: float(np.mean(OWN * x * (1 + HARDENING * x**2) + STRETCHING * x - force)), 0, 50
    )
    stiffness = OWN * (1 + 3 * HARDENING * longer**2) + STRETCHING / 3 + BENDING * 2 / 3
    friction = ROUGHNESS * (COULOMB + float(SPRINGS @ SLIDING))
    # a bellows that lengthens by 1 mm bends the section by 2/3 of it over its distance
    aside = (LENGTH + longer) / (3.0 * AROUND)
    return {
        "identical_muscles": False,
        "friction_share": tuple(map(float, ROUGHNESS / ROUGHNESS.sum())),
        "friction": tuple(map(float, friction)),
        "friction_grows_with_pressure": False,
        "static_stiffness": tuple(map(float, stiffness)),
        "loop_width": float(aside * 2 * friction[0] / stiffness[0]),
        "relaxation_times": (),
        "dead_zone": 0.0,
        "line_lag": LAG,
    }


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, low, high = BENCH.sample_time, 0.05, 1.95

    def run(name: str, *columns: Array) -> Recording:
        return record(name, np.column_stack(columns))

    def ramps() -> Array:
        return motions.ramps(rng, 60.0, step, 0.0, BENCH.high, (0.15, 0.8), 1.0)

    def waves(seconds: float, band: tuple[float, float]) -> Array:
        return motions.waves(rng, seconds, step, low, high, band)

    def steps() -> Array:
        stairs = motions.stairs(rng, 30.0, step, 0.1, 1.9, (1.0, 4.0), step)
        return motions.framed(stairs, step)

    loop = motions.through([2.0, 0.0, 1.6, 0.4, 1.2], 20.0, step)
    none = np.zeros_like(loop)
    alone = np.concatenate([np.roll([loop, none, none], m, axis=0) for m in range(3)], axis=1).T
    train = (run("one at a time", alone), run("ramps of all", *(ramps() for _ in range(3))))
    test = {
        "patterns": (
            run("waves", *(waves(50.0, (0.03, 0.3)) for _ in range(3))),
            run("steps", *(steps() for _ in range(3))),
            run("round", _round(40.0)),
        ),
        "fast": (run("fast", *(waves(40.0, (0.3, 2.0)) for _ in range(3))),),
    }
    return train, test


def _round(duration: float) -> Array:
    """Return pressures that lead the tip around in a spiral, shape (n, 3) [bar]."""
    time = np.arange(round(duration / BENCH.sample_time)) * BENCH.sample_time
    size = 0.45 * BENCH.high * np.sin(np.pi * time / duration)
    turning = 2.0 * np.pi * time / 5.0
    return np.column_stack([size * (1 + np.cos(turning - m * 2 * np.pi / 3)) for m in range(3)])
