"""A muscle that is held at lengths on a testing machine, where its force is measured.

Equations, in SI units and with the contraction x of the braid within, which is not measured:

- Pull of a braid whose threads stretch, F = p (3 L² - b²) / (4 pi n²), b = b0 (1 + p/E) (Chou and
  Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996; Davis, Tsagarakis, Canderle and Caldwell,
  Int. J. Robotics Research 22(3-4), 2003).
- Load cell, clamps and the cones at the ends are in series with the braid, a standard linear solid
  (Findley, Lai and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, 1976). The braid
  contracts by what they give way, and so has friction although the machine stands still. A tendon
  cannot push.
- Friction grows with pressure and with the surface of the braid, limit = F0 + mu p S(x), S = 2 pi r0 L0
  (sin cos) / (sin0 cos0) of the threads' angle (Tondu and Lopez, IEEE Control Systems 20(2), 2000).
  Below it, Bouc's law as Wen has it (J. Engineering Mechanics Division ASCE 102(2), 1976): df = s dx
  [1 - |f/limit|^N (beta sgn(f dx) + 1 - beta)], whose small loops do not close.
- Machine: a screw with backlash, so that a clamp follows the length that is set once it is taken up, and
  does not tremble with the noise of 0.01 mm with which this length is known.
- Mass is left out; the rubber's viscosity makes it overdamped. Pressure is recorded in the muscle.
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
    ("pressure",), ("length",), ("force",), 0.02, high=6.0, noise=(0.002, 0.4), load=240.0
)
SUBSTEPS = 40

LENGTH_NOISE, BACKLASH = 0.01, 0.035  # mm, mm to each side
HELD = (250.0, 240.0, 228.0, 214.0)  # mm

BAR = 1e5
LENGTH, DIAMETER, ANGLE = 0.250, 0.014, math.radians(22.0)  # m, m, of threads at rest
THREAD, STRETCH = LENGTH / math.cos(ANGLE), 0.8e8  # m, Pa
TURNS = THREAD * math.sin(ANGLE) / (math.pi * DIAMETER)
SURFACE = math.pi * DIAMETER * LENGTH  # m²
BLADDER, BLADDER_CUBIC = 1600.0, 4.0e5  # N/m, N/m³
VISCOUS = 400.0  # N s/m

SERIES, RELAXING, TIME = 1.1e5, 0.5e5, 6.0  # N/m, N/m, s

FRICTION, RUBBING = 5.0, 0.0070  # N, ratio
PRESLIDING, SHARPNESS, SHAPE = 2.0e5, 1.5, 0.62  # N/m, N, beta


@deferred
def _pull(pressure: float, x: float) -> float:
    """Return the pull of braid and bladder [N] at a gauge pressure [Pa]."""
    thread = THREAD * (1.0 + pressure / STRETCH)
    braid = (3.0 * (LENGTH - x) ** 2 - thread**2) / (4.0 * math.pi * TURNS**2)
    return pressure * braid - BLADDER * x - BLADDER_CUBIC * x**3


@deferred
def _limit(pressure: float, x: float) -> float:
    """Return the friction of a braid that slides [N]."""
    cos = (LENGTH - x) / THREAD
    share = cos * math.sqrt(1.0 - cos * cos) / (math.sin(ANGLE) * math.cos(ANGLE))
    return FRICTION + RUBBING * pressure * SURFACE * share


@deferred
def _tension(x: float, q: float, length: float) -> float:
    """Return what the load cell feels [N] at a length between the clamps [m]."""
    given = length - LENGTH + x
    return max(SERIES * given + RELAXING * (given - q), 0.0)


@deferred
def _rates(
    x: float, f: float, q: float, pressure: float, length: float
) -> tuple[float, float, float]:
    """Return the derivatives of contraction, friction, and what the series relaxed by."""
    v = (_pull(pressure, x) - f - _tension(x, q, length)) / VISCOUS
    share = min(max(f / _limit(pressure, x), -1.0), 1.0)
    turning = SHAPE * math.copysign(1.0, f * v) + 1.0 - SHAPE
    bent = PRESLIDING * v * (1.0 - abs(share) ** SHARPNESS * turning)
    return v, bent, (length - LENGTH + x - q) / TIME


@deferred
def _clamped(lengths: Array) -> Array:
    """Return where the clamp is [mm] as the screw is set to lengths [mm]."""
    clamped = lengths.copy()
    for k in range(1, lengths.size):
        behind, before = lengths[k] - BACKLASH, lengths[k] + BACKLASH
        clamped[k] = min(max(clamped[k - 1], behind), before)
    return clamped


@deferred
def _run(commands: Array, lengths: Array, step: float, substeps: int) -> Iterator[float]:
    x, f = LENGTH - lengths[0], 0.0
    q = 0.0
    h = step / substeps
    for k in range(commands.size):
        yield _tension(x, q, lengths[k])
        following = min(k + 1, commands.size - 1)
        pressure = BAR * commands[k]
        faster = (BAR * commands[following] - pressure) / substeps
        longer = (lengths[following] - lengths[k]) / substeps
        for j in range(substeps):  # Runge and Kutta's steps
            p, at = pressure + j * faster, lengths[k] + j * longer
            x1, f1, q1 = _rates(x, f, q, p, at)
            p, at = p + 0.5 * faster, at + 0.5 * longer
            x2, f2, q2 = _rates(x + 0.5 * h * x1, f + 0.5 * h * f1, q + 0.5 * h * q1, p, at)
            x3, f3, q3 = _rates(x + 0.5 * h * x2, f + 0.5 * h * f2, q + 0.5 * h * q2, p, at)
            p, at = p + 0.5 * faster, at + 0.5 * longer
            x4, f4, q4 = _rates(x + h * x3, f + h * f3, q + h * q3, p, at)
            x += h / 6.0 * (x1 + 2.0 * x2 + 2.0 * x3 + x4)
            q += h / 6.0 * (q1 + 2.0 * q2 + 2.0 * q3 + q4)
            most = _limit(p, x)  # which can fall beneath the friction
            f += h / 6.0 * (f1 + 2.0 * f2 + 2.0 * f3 + f4)
            f = min(max(f, -most), most)


def move(pressures: Array, loads: Array) -> Motion:
    """Return forces [N], shape (n, 1), at pressures [bar] and lengths between the clamps [mm]."""
    commands, lead = motions.from_empty(BENCH.allowed(pressures), BENCH.sample_time)
    lengths = 1e-3 * _clamped(np.append(np.full(lead, loads[0, 0]), loads[:, 0]))
    return after(lead, commands, _run(commands[:, 0], lengths, BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    """Return what is so; stiffness is that of the braid, without what is in series with it."""
    middle, length, nudge = BENCH.middle * BAR, 1e-3 * BENCH.load, 1e-6
    x = brentq(lambda x: float(_pull(middle, x)) - SERIES * (length - LENGTH + x), 0.0, 0.06)
    stiffness = float(_pull(middle, x - nudge) - _pull(middle, x + nudge)) / (2 * nudge)
    friction = float(_limit(middle, x))
    return one_muscle(
        friction,
        1e-3 * stiffness,
        friction_grows_with_pressure=True,
        friction_per_bar=BAR * float(_limit(middle, x) - FRICTION) / middle,
        friction_grows_with_contraction=True,
        series_stiffness=1e-3 * SERIES,
        # of force, as the muscle is held
        loop_width=2 * friction * SERIES / (SERIES + stiffness),
        relaxation_times=(TIME,),
    )


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, low, high = BENCH.sample_time, 0.3, 5.5

    def run(name: str, pressure: Array, length: float | Array) -> Recording:
        """Record with a length that is known only nearly."""
        recorded = record(name, pressure, length)
        noise = LENGTH_NOISE * rng.standard_normal(len(recorded))
        return recorded.with_channels(length=recorded["length"] + noise)

    def loops(length: float) -> Recording:
        """Fill and vent by ramps of one speed, to levels that fall."""
        peaks = np.array([5.5, 0.3, 5.0, 0.8, 4.0, 1.5, 3.3]) + rng.uniform(-0.2, 0.2, 7)
        return run(f"held at {length:g} mm", motions.through(peaks.tolist(), 27.0, step), length)

    def wander(length: float) -> Recording:
        pressure = motions.wander(rng, 25.0, step, low, high, (0.5, 3.0))
        return run(f"wandering at {length:g} mm", pressure, length)

    moving = 232.0 + motions.waves(rng, 40.0, step, -14.0, 14.0, (0.03, 0.3))
    pulled = motions.swell(30.0, step, 220.0, 246.0, 6.0, (1.0, 0.3))
    train = tuple(loops(length) for length in HELD)
    test = {
        "patterns": tuple(wander(length) for length in HELD[:3]),
        "lengths between training": (wander(245.0), wander(221.0)),
        "small loops": (
            run("small loops", motions.swell(25.0, step, 2.0, 3.4, 2.5, (1.0, 0.3)), 228.0),
        ),
        "moving": (
            run("moving", motions.wander(rng, 40.0, step, 1.0, 5.0, (1.0, 4.0)), moving),
            run("at one pressure", np.full(pulled.size, 3.0), pulled),
        ),
    }
    return train, test
