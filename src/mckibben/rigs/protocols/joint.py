"""The experiments on an antagonistic joint.

Of no paper: what identification of a joint needs. Pressures are told by their mean, the co-contraction
c, and half their difference d: muscle 1 has c + d, muscle 2 has c - d. Loops of d at several c, with
smaller loops within; each muscle alone against a held one, down to a slack tendon; c alone; steps of d,
and a load let go at constant pressures; masses at the arm; and both pressures at random. On another rig
pressures are in proportion to its ranges, masses to its highest pressure, torques to its highest.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.rigs.recording import share
from mckibben.rigs.rig import Rig
from mckibben.signals.broadband import random_wave
from mckibben.signals.excitations import decaying_triangle, triangle
from mckibben.signals.loads import pulls
from mckibben.signals.protocol import PlannedRun, Protocol, Role
from mckibben.signals.steps import binary_steps, staircase

SAMPLE_TIME = 0.01
PERIOD, CYCLES = 16.0, 5
"""Of loops, each smaller than the one before [s]."""

HIGHEST = 6.0
"""Highest pressure of the rig [bar], and with it the range of all that follows."""

CO_CONTRACTIONS: dict[float, Role] = {1.5: "train", 3.0: "train", 4.5: "train", 2.2: "test"}
"""Mean pressures of loops [bar]; the difference goes as far as the range of pressures lets it."""

AGAINST = (0.0, 2.0)
"""Held pressures against which each muscle is driven alone [bar]; at 0 a tendon goes slack."""

MASSES: dict[float, Role] = {1.0: "train", 2.0: "train", 1.5: "test"}
"""At the arm, of loops at the middle co-contraction [kg]."""

STRONGEST, PULLED = 8.0, 5.0
"""Highest torque of the rig, and how far it is pulled [N m]."""

FASTEST, RANDOM_TIME = 0.3, 80.0
"""Highest frequency of random pressures [Hz], and how long they take [s]."""


def antagonistic_joint(rig: Rig | None = None) -> Protocol:
    """Return all runs; those with a torque only of a rig that can apply one."""
    runs = [_loops(c, role) for c, role in CO_CONTRACTIONS.items()]
    runs += [_alone(k, held) for k in (1, 2) for held in AGAINST]
    runs += [_co_contraction(), _steps()]
    runs += [_loops(HIGHEST / 2, role, mass) for mass, role in MASSES.items()]
    roles: tuple[Role, ...] = ("train", "train", "test")
    runs += [_random(seed, role) for seed, role in enumerate(roles, start=1)]
    runs += [_random(4, "train", mass=2.0), _random(5, "test", mass=1.5)]
    if rig is None or "torque" in rig.inputs:
        runs += [_let_go(c) for c in (1.5, 3.0)]
        runs += [_random(6, "train", pulled=PULLED), _random(7, "test", pulled=PULLED)]
    return Protocol(
        name="antagonistic-joint",
        rig="antagonistic-joint",
        source="of no paper: loops, co-contraction, loads and random motion of a joint",
        runs=tuple(runs if rig is None else (_scaled(run, rig) for run in runs)),
        notes="Names of runs have the pressures and masses of the package's rig.",
    )


def _scaled(run: PlannedRun, rig: Rig) -> PlannedRun:
    """Return a run with its pressures in proportion to the ranges of a rig."""
    waves, mass = dict(run.inputs.channels), run.labels["mass"] * share(rig, "pressure_1", HIGHEST)
    for name in ("pressure_1", "pressure_2"):
        limits = rig.limits(name)
        waves[name] = limits.low + (limits.high - limits.low) / HIGHEST * waves[name]
    if "torque" in waves:
        waves["torque"] = share(rig, "torque", STRONGEST) * waves["torque"]
    return _run(run.name, run.role, waves, **{**run.labels, "mass": mass})


def _run(
    name: str, role: Role, waves: dict[str, Array], mass: float = 0.0, **labels: Any
) -> PlannedRun:
    start = {f"start.{channel}": float(wave[0]) for channel, wave in waves.items()}
    inputs, settings = Recording(waves, SAMPLE_TIME), {"payload": mass, **start}
    return PlannedRun(name, role, inputs, settings, {**labels, "mass": mass})


def _opposed(c: Array | float, d: Array) -> dict[str, Array]:
    """Return both pressures: their mean plus and minus half their difference."""
    return {"pressure_1": c + d, "pressure_2": c - d}


def _time(duration: float) -> Array:
    return np.asarray(np.arange(round(duration / SAMPLE_TIME) + 1) * SAMPLE_TIME)


def _widest(c: float) -> float:
    """Return how far half the difference can go at a co-contraction."""
    return min(c, HIGHEST - c)


def _loops(c: float, role: Role, mass: float = 0.0) -> PlannedRun:
    d = decaying_triangle(_time(CYCLES * PERIOD), PERIOD, _widest(c), -_widest(c), CYCLES)
    name = f"loops-{c:g}bar" + (f"-{mass:g}kg" if mass else "")
    return _run(name, role, _opposed(c, d), mass, stage="loops", co_contraction=c)


def _alone(muscle: int, held: float) -> PlannedRun:
    wave = triangle(_time(3 * PERIOD), PERIOD, (HIGHEST, 0.7 * HIGHEST, 0.4 * HIGHEST))
    waves = {f"pressure_{k}": wave if k == muscle else 0.0 * wave + held for k in (1, 2)}
    name = f"alone-{muscle}-against-{held:g}bar"
    return _run(name, "train", waves, stage="alone", driven=str(muscle), held=held)


def _co_contraction() -> PlannedRun:
    c = triangle(_time(3 * PERIOD), PERIOD, 0.9 * HIGHEST, 0.1 * HIGHEST)
    return _run("co-contraction", "train", _opposed(c, 0.0 * c), stage="co-contraction")


def _steps() -> PlannedRun:
    d = binary_steps(_time(60.0), HIGHEST / 4, -HIGHEST / 4, hold=2.0)
    return _run("steps", "train", _opposed(HIGHEST / 2, d), stage="steps")


def _let_go(c: float) -> PlannedRun:
    """Return a run in which the arm is pulled and let go: it swings freely, and decays."""
    pulled = staircase(_time(36.0), [0.0, PULLED] * 3 + [0.0], hold=4.0, ramp=0.0)
    waves = _opposed(c, 0.0 * pulled) | {"torque": pulled}
    return _run(f"let-go-{c:g}bar", "train", waves, stage="let-go", co_contraction=c)


def _random(seed: int, role: Role, mass: float = 0.0, pulled: float = 0.0) -> PlannedRun:
    """Return a run with both pressures random, and a mass or pulls at the arm."""
    time = _time(RANDOM_TIME)
    first, second = (random_wave(time, FASTEST, HIGHEST, seed=10 * seed + k) for k in (1, 2))
    waves = {"pressure_1": first, "pressure_2": second}
    waves |= {"torque": pulls(time, pulled, 5)} if pulled else {}
    load = f"-{mass:g}kg" if mass else "-pulled" if pulled else ""
    return _run(f"random-{seed}{load}", role, waves, mass, stage="random")
