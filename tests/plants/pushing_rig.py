"""A muscle that pulls a carriage against a spring whose preload is measured and moves.

- Muscle: virtual work on a braid of fibres that do not stretch. A fibre of length b with n turns binds
  the muscle's length L and radius r by b² = L² + (2πnr)², so that F = p (3L² − b²)/(4πn²) − V dW/dL.
  Chou & Hannaford, IEEE Trans. Robotics and Automation 12 (1996); Liu & Rahn, J. Applied Mechanics 70
  (2003).
- Bladder: a thin tube that keeps its volume V, with Ogden's energy
  W = Σ μ_i/α_i (λ₁^α_i + λ₂^α_i + λ₃^α_i − 3) and his constants for rubber, scaled as for a filled one.
  Ogden, Proc. R. Soc. A 326 (1972). Beside it one Maxwell branch.
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

import numpy as np
from scipy.optimize import brentq

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.system.compiling import deferred
from tests.plants import Plant
from tests.plants.courses import allowed, measured, stepping, through, wandering, waving

STEP = 0.01  # s between samples
SUBSTEPS = 20
HIGH, SPAN, FORCES = 6.0, 40.0, 150.0  # bar, mm, N

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
def _travels(command: Array, preload: Array) -> Array:
    """Return the travel at every sample [mm], from pressures [bar] and preloads [N]."""
    travels = np.empty(command.size)
    step = STEP / SUBSTEPS
    pressure = travel = velocity = relaxed = 0.0
    for i in range(command.size):
        for _ in range(SUBSTEPS):
            pressure += (1e5 * command[i] - pressure) * step / LAG
            relaxed += (travel - relaxed) * step / RELAXING
            pull = max(_pull(pressure, travel) - BRANCH * (travel - relaxed), 0.0)
            net = pull - preload[i] - SPRING * travel
            forwards = velocity > 0.0 if abs(velocity) > STILL else net > 0.0
            coulomb = (GUIDE + PRESSING * pull) * (1.0 if forwards else TILTED)
            if abs(velocity) <= STILL and abs(net) <= STICKING * coulomb:
                velocity = 0.0
                continue
            excess = (STICKING - 1.0) * math.exp(-abs(velocity) / STRIBECK)
            friction = coulomb * (1.0 + excess) * (1.0 if forwards else -1.0)
            velocity += step / MASS * (net - friction - DAMPING * velocity)
            travel += step * velocity
            if travel < 0.0:  # at the stop
                travel = velocity = 0.0
        travels[i] = 1e3 * travel
    return travels


def respond(commands: Array, loads: Array) -> Array:
    """Return travels [mm], shape (n, 1), from the stop; loads are preloads [N]."""
    return _travels(allowed(commands[:, 0], HIGH), np.ascontiguousarray(loads[:, 0]))[:, None]


def facts() -> dict[str, float | bool | tuple[float, ...]]:
    """Return what is so at half pressure under a preload of 70 N.

    Shares of friction are those of its sliding force in the pull, on the ways there and back; stiffness
    is the preload that a millimetre takes, for long; the time is that of the branch, held still; the
    dead zone is where the carriage leaves its stop under that preload.
    """
    preload, by = 70.0, 1e-5

    def net(pressure: float, travel: float) -> float:
        return float(_pull(pressure, travel)) - preload - SPRING * travel

    pressure = 0.5e5 * HIGH
    travel = float(brentq(lambda at: net(pressure, at), 0.0, 0.06))
    pull = preload + SPRING * travel
    sliding = (GUIDE + PRESSING * pull) / pull

    def breaking(pressure: float) -> float:
        pull = float(_pull(pressure, 0.0))
        return pull - preload - STICKING * (GUIDE + PRESSING * pull)

    leaves = float(brentq(breaking, 0.0, 1e5 * HIGH))
    return {
        "friction_shares": (sliding, TILTED * sliding),
        "static_stiffness": -(net(pressure, travel + by) - net(pressure, travel - by)) / (2e3 * by),
        "relaxation_times": (RELAXING,),
        "dead_zone": 1e-5 * leaves,
        "friction_grows_with_pressure": True,
        "identical_muscles": True,
    }


def plant(seed: int) -> Plant:
    """Return the rig, with runs that this seed draws."""
    rng = np.random.default_rng((seed, 4))

    def run(name: str, command: Array, preload: Array) -> Recording:
        travel = respond(command[:, None], preload[:, None])[:, 0]
        return Recording(
            {
                "pressure": measured(rng, command, HIGH),
                "force": measured(rng, preload, FORCES),
                "displacement": measured(rng, travel, SPAN),
            },
            sample_time=STEP,
            meta={"name": name, "rig": "pushing rig (virtual)", "load": "preload of a spring"},
        )

    def moving(duration: float, speed: tuple[float, float]) -> Array:
        return 40.0 + wandering(rng, duration, STEP, low=0.0, high=70.0, speed=speed, rest=3.0)

    falling = through([6.0, 0.0, 6.0, 1.0, 5.2, 1.8, 4.5, 2.4, 3.8], 60.0, STEP)
    ramps = wandering(rng, 60.0, STEP, low=0.0, high=HIGH, speed=(0.4, 3.0), rest=1.5)
    waves = waving(rng, 50.0, STEP, low=0.3, high=5.9, band=(0.04, 0.4))
    steps = stepping(rng, 30.0, STEP, low=0.5, high=5.8, hold=(1.0, 4.0))
    fast = waving(rng, 40.0, STEP, low=0.8, high=5.5, band=(0.3, 2.0))
    return Plant(
        name="pushing_rig",
        title="A muscle that pulls a carriage against a spring of moving preload",
        sources="Chou & Hannaford 1996; Liu & Rahn 2003; Ogden 1972; Karnopp 1985; Armstrong 1994",
        train=(
            run("falling loops", falling, moving(60.0, (3.0, 8.0))),
            run("ramps", ramps, moving(60.0, (5.0, 20.0))),
        ),
        test={
            "patterns": (
                run("waves", waves, moving(50.0, (5.0, 20.0))),
                run("steps", steps, moving(30.0, (5.0, 20.0))),
            ),
            "fast": (run("fast waves", fast, moving(40.0, (10.0, 40.0))),),
        },
        respond=respond,
        facts=facts(),
    )
