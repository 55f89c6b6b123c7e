"""A muscle that a proportional valve fills, which pulls a sledge against a spring, and creeps.

Equations, in SI units and with the contraction x (the sledge's travel):

- Pull of a braid with a thick wall t, the third model of Chou and Hannaford (IEEE Trans. Robotics and
  Automation 12(1), 1996): F = p [pi D²/4 (3 cos² - 1) + pi (D t (2 sin - 1/sin) - t²)] of the threads'
  angle, where D is the diameter at which it would be 90°.
- Valve: a spool with overlap and a lag, whose slit lets through the isentropic flow of a nozzle, choked
  below a ratio of pressures of 0.528 (Saint-Venant and Wantzel 1839; Richer and Hurmuzlu, ASME J.
  Dynamic Systems, Measurement, and Control 122(3), 2000). A controller opens it by the error of the
  pressure, and errors within the overlap stay. What it is asked for is recorded.
- Air: balances of mass and energy, V dp/dt = gamma R (T_in m_in - T m_out) - gamma p dV/dt - (gamma -
  1) h A (T - T_wall), in a volume that depends on the length: filling heats it, and venting cools it.
- Rubber: a spring, beside another in series with Eyring's dashpot, dq/dt = A sinh(F/F_a). What is held
  creeps by the logarithm of time, the more the faster it came there. A grows with the wall's temperature
  by Arrhenius, and friction, creep and air warm the wall (Haward and Thackray, Proc. R. Soc. A 302,
  1968).
- Friction as a generalised Maxwell-slip body with Stribeck (Lampaert, Al-Bender and Swevers, PhysCon
  2003): elements stick, df = k v dt, until they reach their share of s(v) = Fc + (Fs - Fc)
  exp(-(v/vs)²), and slip, df = sgn(v) C (share - |f|/s) dt, until v turns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from mckibben.arrays import Array
from mckibben.system.compiling import deferred
from tests.plants import motions
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, after, one_muscle

BENCH = Bench(("pressure",), (), ("displacement",), 0.01, high=6.0, noise=(0.002, 0.03))
SUBSTEPS = 40

BAR, AMBIENT, SUPPLY = 1e5, 1.013e5, 8.0e5  # Pa, Pa, Pa, absolute
GAS, GAMMA, ROOM = 287.0, 1.4, 293.0  # J/(kg K), ratio of heat capacities, K
CRITICAL, LAMINAR = 0.528, 0.998  # ratios of pressures
FILLING, VENTING = 2.6e-7, 2.0e-7  # m², of the open slit, contracted
BAND, OVERLAP, SPOOL = 0.4 * BAR, 0.04, 0.008  # Pa that open it fully, share of travel, s
LEAK = 1.0e-10  # m², out of the muscle
DEAD_VOLUME = 4.0e-6  # m³ of fittings

LENGTH, DIAMETER, ANGLE, WALL = 0.220, 0.012, math.radians(23.0), 0.0012  # m, m, rad, m
THREAD = LENGTH / math.cos(ANGLE)
WIDEST = DIAMETER / math.sin(ANGLE)
TURNS = THREAD / (math.pi * WIDEST)

COOLING, SURFACE = 40.0, 0.0083  # W/(m² K), m²
HEAT, LOSS = 38.0, 0.10  # J/K of the wall, W/K to the room

SLEDGE, SPRING, HARDENING, PRELOAD = 1.5, 4000.0, 1.2e6, 20.0  # kg, N/m, N/m³, N
VISCOUS, STOP = 110.0, 6.0e4  # N s/m, N/m at the end of the sledge's way
RUBBER, CREEPING = 1800.0, 2200.0  # N/m
EYRING, FLOW, ACTIVATION = 0.50, 1.0e-7, 60e3  # N, m/s at room temperature, J/mol

SHARES = np.array([0.30, 0.30, 0.25, 0.15])  # of the whole friction
STIFFNESSES = np.array([9.0e4, 3.0e4, 9.0e3, 2.5e3])  # N/m
COULOMB, STATIC, STRIBECK = 9.5, 12.0, 0.020  # N, N, m/s
ATTRACTION = 2500.0  # N/s


@deferred
def _pull(pressure: float, x: float) -> float:
    """Return the pull of the braid [N] at a gauge pressure [Pa]."""
    cos = (LENGTH - x) / THREAD
    sin = math.sqrt(1.0 - cos * cos)
    thin = 0.25 * WIDEST**2 * (3.0 * cos * cos - 1.0)
    return math.pi * pressure * (thin + WIDEST * WALL * (2.0 * sin - 1.0 / sin) - WALL**2)


@deferred
def _volume(x: float) -> float:
    """Return the air within [m³]."""
    cos = (LENGTH - x) / THREAD
    wide = WIDEST * math.sqrt(1.0 - cos * cos) - 2.0 * WALL
    return 0.25 * math.pi * wide**2 * (LENGTH - x) + DEAD_VOLUME


@deferred
def _nozzle(upstream: float, downstream: float, temperature: float, area: float) -> float:
    """Return the flow of mass [kg/s] from a higher absolute pressure [Pa] to a lower one."""
    ratio = min(max(downstream / upstream, CRITICAL), LAMINAR)
    expanding = ratio ** (2.0 / GAMMA) - ratio ** ((GAMMA + 1.0) / GAMMA)
    share = math.sqrt(2.0 * GAMMA / (GAMMA - 1.0) * expanding)
    if downstream > LAMINAR * upstream:
        share *= (1.0 - downstream / upstream) / (1.0 - LAMINAR)
    return area * upstream * share / math.sqrt(GAS * temperature)


@deferred
def _between(here: float, there: float, here_warm: float, there_warm: float, area: float) -> float:
    """Return the flow of mass [kg/s] from here to there, negative if it is the other way."""
    if here >= there:
        return _nozzle(here, there, here_warm, area)
    return -_nozzle(there, here, there_warm, area)


@deferred
def _run(commands: Array, step: float, substeps: int) -> Iterator[float]:
    x = -PRELOAD / STOP
    v = spool = creep = 0.0
    held, slips = np.zeros(SHARES.size), np.zeros(SHARES.size)
    pressure, mass, wall = AMBIENT, AMBIENT * _volume(x) / (GAS * ROOM), ROOM
    dt = step / substeps
    for k in range(commands.size):
        yield 1e3 * x
        ahead = commands[min(k + 1, commands.size - 1)] - commands[k]
        for j in range(substeps):
            goal = (commands[k] + ahead * (j + 0.5) / substeps) * BAR + AMBIENT
            spool += dt / SPOOL * (min(max((goal - pressure) / BAND, -1.0), 1.0) - spool)
            opening = max(abs(spool) - OVERLAP, 0.0) / (1.0 - OVERLAP)
            volume = _volume(x)
            warm = pressure * volume / (mass * GAS)
            entering = leaving = 0.0
            if spool > 0.0:
                entering = _between(SUPPLY, pressure, ROOM, warm, opening * FILLING)
            else:
                leaving = _between(pressure, AMBIENT, warm, ROOM, opening * VENTING)
            leaving += _between(pressure, AMBIENT, warm, ROOM, LEAK)

            slower = CREEPING * (x - creep)
            faster = FLOW * math.exp(ACTIVATION / 8.314 * (1.0 / ROOM - 1.0 / wall))
            # one step of Newton's from an implicit step, as sinh is stiff
            flowing = faster * math.sinh(slower / EYRING)
            flowing /= 1.0 + dt * CREEPING / EYRING * faster * math.cosh(slower / EYRING)
            creep += dt * flowing

            limit = COULOMB + (STATIC - COULOMB) * math.exp(-((v / STRIBECK) ** 2))
            friction = 0.0
            for i in range(SHARES.size):
                if slips[i] * v <= 0.0:
                    slips[i] = 0.0
                    held[i] += STIFFNESSES[i] * v * dt
                    if abs(held[i]) >= SHARES[i] * limit:
                        slips[i] = math.copysign(1.0, v)
                        held[i] = math.copysign(SHARES[i] * limit, held[i])
                else:
                    near = 1.0 - math.exp(-dt * ATTRACTION / limit)
                    held[i] += (slips[i] * SHARES[i] * limit - held[i]) * near
                friction += held[i]

            force = _pull(pressure - AMBIENT, x) - RUBBER * x - slower - friction - VISCOUS * v
            force -= PRELOAD + SPRING * x + HARDENING * x**3
            if x < 0.0:
                force -= STOP * x + 150.0 * v
            v += dt * force / SLEDGE
            x += dt * v

            swelling = (_volume(x) - volume) / dt
            heating = COOLING * SURFACE * (warm - wall)
            carried = GAMMA * GAS * (ROOM * entering - (warm if leaving > 0.0 else ROOM) * leaving)
            pressure += dt * (carried - (GAMMA - 1.0) * heating) / volume
            pressure -= dt * GAMMA * pressure * swelling / volume
            mass += dt * (entering - leaving)
            wall += dt / HEAT * (heating + friction * v + slower * flowing - LOSS * (wall - ROOM))


def move(pressures: Array, loads: Array) -> Motion:
    """Return displacements [mm], shape (n, 1), at pressures that are asked for [bar]; no loads."""
    commands, lead = motions.from_empty(BENCH.allowed(pressures), BENCH.sample_time)
    return after(lead, commands, _run(commands[:, 0], BENCH.sample_time, SUBSTEPS))


def facts() -> dict[str, Fact]:
    """Return what is so where it slides slowly; stiffness is of the springs that do not creep."""
    middle, nudge = 3.0 * BAR, 1e-5

    def net(x: float) -> float:
        springs = PRELOAD + (SPRING + RUBBER) * x + HARDENING * x**3
        return float(_pull(middle, x)) - springs

    x = brentq(net, 0.0, 0.25 * LENGTH)
    stiffness = (net(x - nudge) - net(x + nudge)) / (2e3 * nudge)
    # filling at room temperature; the slit opens in proportion to the error
    inflow = _between(SUPPLY, middle + AMBIENT, ROOM, ROOM, FILLING) / (1.0 - OVERLAP)
    return one_muscle(
        STATIC,
        stiffness,
        creep_by_logarithm=True,
        creeping_share=CREEPING / (RUBBER + CREEPING),
        lifts_from=brentq(lambda p: float(_pull(p, 0.0)) - PRELOAD, 0.0, middle) / BAR,
        line_lag=SPOOL + BAND * float(_volume(x)) / (GAS * ROOM * inflow),
    )


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check."""
    step, high = BENCH.sample_time, BENCH.high
    falling = motions.through([4.6, 0.4, 4.3, 0.8, 3.9, 1.2, 3.5, 1.7], 50.0, step)
    ramps = motions.ramps(rng, 50.0, step, 0.0, 4.6, (0.3, 2.5), 2.0)
    nested = np.concatenate(
        [
            motions.swell(15.0, step, *ends, 3.0, (1.0, 0.3))
            for ends in ((0.6, 2.0), (3.0, 4.5), (1.5, 3.2))
        ]
    )
    waves = motions.waves(rng, 40.0, step, 0.3, 4.5, (0.05, 0.5))
    holds = motions.stairs(rng, 80.0, step, 0.4, 4.6, (10.0, 20.0), 0.15)
    fast = motions.waves(rng, 30.0, step, 0.8, 4.4, (0.5, 3.0))
    train = (record("falling loops", falling), record("ramps", ramps))
    test = {
        "patterns": (record("waves", waves),),
        "small loops": (record("small loops", nested),),
        "holds": (record("holds", holds),),
        "fast": (record("fast waves", fast),),
        "pressures beyond training": (
            record("high", motions.wander(rng, 30.0, step, 3.0, 0.99 * high, (1.0, 4.0))),
        ),
    }
    return train, test
