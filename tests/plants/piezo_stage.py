"""A piezoelectric stack that moves a stage over a lever, of thousands of domains that switch.

It is no muscle: its input is a voltage, the only one of `Bench.pressures`.

- Domains: relays of Preisach (Zeitschrift für Physik 94, 1935; Mayergoyz, Mathematical Models of
  Hysteresis, 1991), each with a coercive voltage and a bias of its own, so that they switch up at bias +
  coercive and down at bias - coercive. They are drawn once from two families. In both, the bias is
  correlated with the coercive voltage, so that their density is no product of functions of these, nor of
  the switching voltages.
- Rate: a relay does not jump but moves as fast as the voltage is beyond its own, ds/dt = k (u - alpha)
  above and k (u - beta) below, |s| <= 1 (Bertotti, IEEE Trans. Magnetics 28(5), 1992). k is spread over
  decades, as grains have it: loops widen with speed, and what is held creeps.
- Beside them, a displacement that saturates and has no memory (Damjanovic, Reports on Progress in
  Physics 61, 1998).
- Amplifier: a lag of first order, the charge of which is limited by its current (Fleming and Leang,
  Design, Modeling and Control of Nanopositioning Systems, 2014). What is asked for is recorded.
- Stage: mass and flexures, lightly damped.

All runs are stretches of one session, in the middle of which others had used it. `move` begins where
training does, after what happened before and was not recorded, and leads to the first voltage.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mckibben.arrays import Array
from mckibben.system.compiling import deferred
from tests.plants import motions
from tests.plants.plant import Bench, Fact, Motion, Record, Runs, after

BENCH = Bench(("voltage",), (), ("displacement",), 0.01, high=120.0, noise=(0.03, 0.0002))
SUBSTEPS = 4

AMPLIFIER, SLEW = 0.012, 700.0  # s, V/s
RESONANCE, DAMPING = 2.0 * math.pi * 14.0, 0.12  # rad/s, ratio
REVERSIBLE, SATURATING = 0.300, 150.0  # mm, V
SWITCHING = 0.125  # mm from all domains down to all up
BEFORE = 40.0  # s of which nothing is known


def _domains() -> tuple[Array, Array, Array]:
    """Return the voltages at which domains switch up and down [V], and how readily [1/(V s)]."""
    rng = np.random.default_rng(1935)
    soft, hard = 2000, 1100
    coercive = 5.0 * np.exp(0.55 * rng.standard_normal(soft))
    bias = 52.0 + 30.0 * rng.standard_normal(soft) + 1.5 * (coercive - 5.0)
    stiffer = 15.0 * np.exp(0.30 * rng.standard_normal(hard))
    tilted = 72.0 - 1.7 * (stiffer - 15.0) + (4.0 + 0.7 * stiffer) * rng.standard_normal(hard)
    coercive, bias = np.append(coercive, stiffer), np.append(bias, tilted)
    readily = 6.0 * np.exp(1.2 * rng.standard_normal(soft + hard))
    return bias + coercive, bias - coercive, readily


UP, DOWN, READILY = _domains()


@deferred
def _reversible(voltage: float) -> float:
    """Return the displacement that has no memory [mm]."""
    return REVERSIBLE * math.tanh(voltage / SATURATING)


@deferred
def _run(
    command: Array,
    up: Array,
    down: Array,
    readily: Array,
    step: float,
    substeps: int,
) -> Iterator[float]:
    domains = np.full(up.size, -1.0)
    voltage = x = v = 0.0
    last = _reversible(0.0)
    dt = step / substeps
    for k in range(command.size):
        yield x
        ahead = command[min(k + 1, command.size - 1)] - command[k]
        for j in range(substeps):
            asked = command[k] + ahead * (j + 0.5) / substeps
            before = voltage
            moved = (asked - voltage) * (1.0 - math.exp(-dt / AMPLIFIER))
            voltage += min(max(moved, -dt * SLEW), dt * SLEW)
            middle, total = 0.5 * (before + voltage), 0.0
            for i in range(up.size):
                if middle > up[i]:
                    domains[i] = min(domains[i] + dt * readily[i] * (middle - up[i]), 1.0)
                elif middle < down[i]:
                    domains[i] = max(domains[i] + dt * readily[i] * (middle - down[i]), -1.0)
                total += domains[i]
            goal = _reversible(voltage) + SWITCHING * (0.5 + 0.5 * total / up.size)
            x, v = _swung(x, v, last, goal, dt)
            last = goal


@deferred
def _swung(x: float, v: float, last: float, goal: float, dt: float) -> tuple[float, float]:
    """Return a step of Runge and Kutta's of a stage whose rest goes from one place to another."""
    middle = 0.5 * (last + goal)
    v1, a1 = v, _pushed(x, v, last)
    v2, a2 = v + 0.5 * dt * a1, _pushed(x + 0.5 * dt * v1, v + 0.5 * dt * a1, middle)
    v3, a3 = v + 0.5 * dt * a2, _pushed(x + 0.5 * dt * v2, v + 0.5 * dt * a2, middle)
    v4, a4 = v + dt * a3, _pushed(x + dt * v3, v + dt * a3, goal)
    x += dt / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
    return x, v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


@deferred
def _pushed(x: float, v: float, rest: float) -> float:
    return RESONANCE**2 * (rest - x) - 2.0 * DAMPING * RESONANCE * v


def _before(first: float) -> Array:
    """Return what nobody recorded [V]: some use, and then a way to the first voltage."""
    rng, step = np.random.default_rng(1992), BENCH.sample_time
    used = motions.wander(rng, BEFORE, step, 0.0, BENCH.high, (1.0, 5.0))
    way = np.linspace(used[-1], first, round(2.0 / step))
    return np.concatenate([used, way, np.full(round(1.0 / step), first)])


def move(pressures: Array, loads: Array) -> Motion:
    """Return displacements [mm], shape (n, 1), at voltages that are asked for [V]; no loads."""
    asked = BENCH.allowed(pressures[:, 0])
    before = _before(float(asked[0]))
    commands = np.append(before, asked)[:, None]
    outputs = _run(commands[:, 0], UP, DOWN, READILY, BENCH.sample_time, SUBSTEPS)
    return after(before.size, commands, outputs)


def facts() -> dict[str, Fact]:
    """Return what is so of a thing that has no friction and no stiffness of a muscle's."""
    low, high, middle = 0.13 * BENCH.high, 0.83 * BENCH.high, BENCH.middle
    # domains that a slow loop switches, and that are up at mid-range on one of its ways alone
    differ = [low < down < middle < up < high for up, down in zip(UP, DOWN, strict=True)]
    return {
        "identical_muscles": True,
        "friction_grows_with_pressure": False,
        "loop_width": SWITCHING * float(np.mean(differ)),
        "relaxation_times": (),
        "dead_zone": 0.0,
        "line_lag": AMPLIFIER,
        "density_is_a_product": False,
        "one_session": True,
    }


def runs(rng: np.random.Generator, record: Record) -> Runs:
    """Return what is recorded to fit and to check; nothing is known of what was before each run."""
    step, high = BENCH.sample_time, BENCH.high

    def wander(seconds: float, low: float, top: float) -> Array:
        return motions.wander(rng, seconds, step, low, top, (0.8, 4.0))

    def between(low: float = 0.0, top: float = high) -> Array:
        """Use the stage in a way that is not recorded."""
        return motions.wander(rng, float(rng.uniform(8.0, 20.0)), step, low, top, (0.5, 4.0))

    loops = 60.0 + motions.through([40.0, -35.0, 30.0, -28.0, 20.0, -15.0, 8.0], 45.0, step)
    ramps = 55.0 + motions.ramps(rng, 50.0, step, -35.0, 45.0, (8.0, 60.0), 1.5)
    fast = 58.0 + motions.waves(rng, 30.0, step, -30.0, 32.0, (0.5, 4.0))
    small = 38.0 + 7.0 * np.sin(2.0 * np.pi * np.cumsum(np.linspace(0.1, 1.0, 3000)) * step)
    parts = {
        "triangles": loops,
        "_1": between(),
        "ramps": ramps,
        "_2": between(),
        "wandering": wander(40.0, 20.0, 100.0),
        "_3": between(60.0),
        "small loops": small,
        "_4": between(),
        "steps": motions.stairs(rng, 40.0, step, 25.0, 95.0, (2.0, 6.0), step),
        "_5": between(),
        "fast waves": fast,
        "_6": between(0.0, 70.0),
        "whole range": wander(40.0, 0.0, high),
    }
    commands: list[Array] = []
    for part in parts.values():
        if commands:  # a way to where the next begins
            commands.append(np.linspace(commands[-1][-1], part[0], round(0.5 / step)))
        commands.append(part)
    session = record("session", np.concatenate(commands))
    ends = np.cumsum([command.size for command in commands])[::2]
    cut = {
        name: session.slice(int(end) - part.size, int(end)).with_meta(name=name)
        for end, (name, part) in zip(ends, parts.items(), strict=True)
    }
    train = (cut["triangles"], cut["ramps"])
    test = {
        "patterns": (cut["wandering"],),
        "small loops": (cut["small loops"],),
        "steps": (cut["steps"],),
        "fast": (cut["fast waves"],),
        "whole range": (cut["whole range"],),
    }
    return train, test
