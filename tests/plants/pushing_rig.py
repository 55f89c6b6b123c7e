"""A muscle that pulls a carriage against a spring whose preload is measured and moves.

- Muscle: virtual work on a braid of fibres that do not stretch. A fibre of length b with n turns binds
  the muscle's length L and radius r by b² = L² + (2πnr)², so that F = p (3L² − b²)/(4πn²) − V dW/dL.
  Chou & Hannaford, IEEE Trans. Robotics and Automation 12 (1996); Liu & Rahn, J. Applied Mechanics 70
  (2003).
- Bladder: a thin tube that keeps its volume V, with Ogden's energy W = Σ μ_i/α_i (λ₁^α_i + λ₂^α_i +
  λ₃^α_i − 3) and his constants for rubber, scaled as for a filled one. Ogden, Proc. R. Soc. A 326
  (1972). Beside it one Maxwell branch.
- Slack: the bladder reaches the braid only at some pressure, and a tendon cannot push; the spring holds
  the carriage at its stop until the muscle pulls more than the preload.
- Guide: Coulomb's friction with Stribeck's excess, F = F_c [1 + (s − 1) e^−|v|/v_s] + dv, standing
  still as long as it can. Karnopp, J. Dynamic Systems, Measurement and Control 107 (1985);
  Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994). The muscle pulls off the axis and
  presses on the guide, so that F_c grows with its pull; on the way back the carriage tilts and F_c is
  larger.
- Regulator: a lag of first order.
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
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, one_muscle

BENCH = Bench(
    ("pressure",), ("force",), ("displacement",), 0.01, high=6.0, noise=(0.003, 0.02), load=70.0
)
SUBSTEPS = 20

LENGTH, RADIUS, WALL, BRAID = 0.20, 0.005, 0.0015, math.radians(24.0)  # m, m, m, rad
FIBRE = LENGTH / math.cos(BRAID)
TURNS = LENGTH * math.tan(BRAID) / (2.0 * math.pi * RADIUS)
RUBBER = 2.0 * math.pi * RADIUS * WALL * LENGTH  # m³
POWERS = np.array([1.3, 5.0, -2.0])
MODULI = 1.5 * np.array([0.63e6, 0.0012e6, -0.01e6])  # Pa
CONTACT = 0.35e5  # Pa that the bladder takes until it lies against the braid
BRANCH, RELAXING = 700.0, 2.5  # N/m, s

SPRING, MASS, LAG = 400.0, 1.5, 0.05  # N/m, kg, s
PRESSING, TILTED = 0.028, 1.45  # share of the pull that rubs; how much more on the way back
GUIDE, STICKING, STRIBECK = 2.5, 1.18, 0.004  # N, ratio to Coulomb's friction, m/s
DAMPING, STILL = 90.0, 2e-4  # N s/m, m/s


@deferred
def _slope(length: float) -> float:
    """Return the bladder's energy by its length, V dW/dL [N]."""
    around = 2.0 * math.pi * TURNS
    radius = math.sqrt(FIBRE**2 - length**2) / around
    one, two = length / LENGTH, radius / RADIUS
    three = 1.0 / (one * two)
    two_by_length = -length / (around**2 * radius * RADIUS)
    slope = 0.0
    for i in range(POWERS.size):
        by_one = (one ** POWERS[i] - three ** POWERS[i]) / one
        by_two = (two ** POWERS[i] - three ** POWERS[i]) / two
        slope += MODULI[i] * (by_one / LENGTH + by_two * two_by_length)
    return RUBBER * slope


@deferred
def _pull(pressure: float, travel: float) -> float:
    """Return the pull without its slow part [N], negative where the tendon is slack."""
    length = LENGTH - travel
    braid = (3.0 * length**2 - FIBRE**2) / (4.0 * math.pi * TURNS**2)
    # the bladder is unstressed at its first length
    return max(pressure - CONTACT, 0.0) * braid + _slope(length) - _slope(LENGTH)


@deferred
def _travels(command: Array, preload: Array, step: float, substeps: int) -> Iterator[float]:
    """Yield the travel at every sample [mm], from pressures [bar] and preloads [N]."""
    dt = step / substeps
    pressure = travel = velocity = relaxed = 0.0
    for i in range(command.size):
        for _ in range(substeps):
            pressure += (1e5 * command[i] - pressure) * dt / LAG
            relaxed += (travel - relaxed) * dt / RELAXING
            pull = max(_pull(pressure, travel) - BRANCH * (travel - relaxed), 0.0)
            net = pull - preload[i] - SPRING * travel
            forwards = velocity > 0.0 if abs(velocity) > STILL else net > 0.0
            coulomb = (GUIDE + PRESSING * pull) * (1.0 if forwards else TILTED)
            if abs(velocity) <= STILL and abs(net) <= STICKING * coulomb:
                velocity = 0.0
                continue
            excess = (STICKING - 1.0) * math.exp(-abs(velocity) / STRIBECK)
            friction = coulomb * (1.0 + excess) * (1.0 if forwards else -1.0)
            velocity += dt / MASS * (net - friction - DAMPING * velocity)
            travel += dt * velocity
            if travel < 0.0:  # at the stop
                travel = velocity = 0.0
        yield 1e3 * travel


def move(pressures: Array, loads: Array) -> Motion:
    """Return travels [mm], shape (n, 1), from the stop; loads are preloads [N]."""
    commands, preload = BENCH.allowed(pressures[:, :1]), np.ascontiguousarray(loads[:, 0])
    return Motion(commands, _travels(commands[:, 0], preload, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    """Return what is so; stiffness is the preload that a millimetre takes, for long."""
    preload, middle, nudge = BENCH.load, 1e5 * BENCH.middle, 1e-5

    def net(travel: float) -> float:
        return float(_pull(middle, travel)) - preload - SPRING * travel

    def breaking(pressure: float) -> float:
        pull = float(_pull(pressure, 0.0))
        return pull - preload - STICKING * (GUIDE + PRESSING * pull)

    rest = brentq(net, 0.0, 0.06)
    friction = 0.5 * (1.0 + TILTED) * (GUIDE + PRESSING * (preload + SPRING * rest))
    stiffness = (net(rest - nudge) - net(rest + nudge)) / (2e3 * nudge)
    return one_muscle(
        friction,
        stiffness,
        friction_ratio=TILTED,
        friction_grows_with_pressure=True,
        relaxation_times=(RELAXING,),
        dead_zone=1e-5 * CONTACT,
        lifts_from=1e-5 * brentq(breaking, 0.0, 1e5 * BENCH.high),
        line_lag=LAG,
    )


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, high = BENCH.sample_time, BENCH.high

    def run(name: str, command: Array, speed: tuple[float, float]) -> Recording:
        """Record while the preload goes between levels at such speeds [N/s]."""
        seconds = command.size * step
        preload = 40.0 + motions.ramps(rng, seconds, step, 0.0, 70.0, speed, 3.0)
        return record(name, command, preload)

    falling = motions.through([6.0, 0.0, 6.0, 1.0, 5.2, 1.8, 4.5, 2.4, 3.8], 60.0, step)
    ramps = motions.ramps(rng, 60.0, step, 0.0, high, (0.4, 3.0), 1.5)
    waves = motions.waves(rng, 50.0, step, 0.3, 5.9, (0.04, 0.4))
    steps = motions.framed(motions.stairs(rng, 30.0, step, 0.5, 5.8, (1.0, 4.0), step), step)
    fast = motions.waves(rng, 40.0, step, 0.8, 5.5, (0.3, 2.0))
    train = (run("falling loops", falling, (3.0, 8.0)), run("ramps", ramps, (5.0, 20.0)))
    test = {
        "patterns": (run("waves", waves, (5.0, 20.0)), run("steps", steps, (5.0, 20.0))),
        "fast": (run("fast waves", fast, (10.0, 40.0)),),
    }
    return train, test
