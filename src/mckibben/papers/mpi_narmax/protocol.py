"""The experiments on a muscle on a rail under an external force.

Source: High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model, Sections 2.2, 2.3 and 4. Runs in which voltage and force vary at random are ours: motion
that training does not repeat.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.papers.recognising import Labels
from mckibben.recording import Recording
from mckibben.rigs import Rig, share
from mckibben.rigs.physics.compiled import GRAVITY
from mckibben.signals.broadband import random_wave
from mckibben.signals.excitations import sine, triangle
from mckibben.signals.features import Features
from mckibben.signals.loads import pulls, ramps
from mckibben.signals.protocol import PlannedRun, Protocol, Role

SAMPLE_TIME, TIME = 0.001, 60.0
"""Of all runs, and how long they are, but for those at 0.05 Hz [s]."""

LOW, HIGH = 0.1, 10.0
"""Dead zone of the regulator and highest voltage [V]."""

STRONGEST = 300.0
"""Highest force of the rig [N], of which weights and pulls are shares."""

VARYING = 4
"""Status in which the force varies."""

UNLOADED, STILL = 0.1, 0.05
"""Largest force of a run without load, relative to the largest of all; largest change of an
input that is held, relative to its range."""

PULLED_FROM = 20.0
"""At which the force begins while the voltage is held [s]."""


class Sine(NamedTuple):
    """A run with a sine: its frequency [Hz], a weight [kg], and the peaks of three pulls [N]."""

    name: str
    role: Role
    stage: str
    frequency: float
    mass: float = 0.0
    hand: float = 0.0
    status: int = 0


SINES = (
    Sine("status-1", "train", "status", 0.1, status=1),
    Sine("status-2", "train", "weight", 0.2, mass=10.04, status=2),
    Sine("status-3", "train", "weight", 0.2, mass=21.75, status=3),
    Sine("training-pulls-100N", "train", "pulls", 0.1, hand=100.0),
    Sine("status-4", "test", "pulls", 0.22, hand=150.0, status=VARYING),
    *(
        one
        for f in (0.05, 0.1, 0.2)
        for one in (
            Sine(f"free-{f:g}Hz", "train", "free", f),
            Sine(f"weight-{f:g}Hz", "test", "weight", f, mass=91 / GRAVITY),
            Sine(f"hand-{f:g}Hz", "test", "pulls", f, hand=100.0),
        )
    ),
)
"""Statuses, the training, and the runs of Figures 1 and 2."""


def mpi_narmax(rig: Rig | None = None) -> Protocol:
    """Return statuses 1 to 4, the training pulls, the runs of Figures 1 to 3, and random ones.

    On another rig voltages (or pressures, if these drive it) are in proportion to its highest, weights
    and pulls to its highest force.
    """
    drive = "voltage" if rig is None else rig.inputs[0]
    wide, strong = share(rig, drive, HIGH), share(rig, "force", STRONGEST)
    runs = list[PlannedRun]()

    def add(name: str, role: Role, volts: Array, newtons: Array, **labels: Any) -> None:
        inputs = Recording({drive: wide * volts, "force": strong * newtons}, SAMPLE_TIME)
        settings = {"payload": round(labels.get("mass", 0.0), 6), f"start.{drive}": wide * LOW}
        runs.append(PlannedRun(name, role, inputs, settings, labels))

    for name, role, stage, f, mass, hand, status in SINES:
        duration = max(TIME, 4 / f)
        time = np.arange(round(duration / SAMPLE_TIME)) * SAMPLE_TIME
        wave, pulled = sine(time, 1 / f, HIGH, LOW), pulls(time, hand, duration=duration / 6)
        labels = {"stage": stage, "frequency": f, "mass": strong * mass, "hand": strong * hand}
        add(name, role, wave, pulled, **labels, **({"status": status} if status else {}))
    time = np.arange(round(TIME / SAMPLE_TIME)) * SAMPLE_TIME
    pulled = np.where(time < PULLED_FROM, 0.0, triangle(time, 20.0, 150.0))
    for volt in (2.0, 4.0, 6.0, 8.0, 10.0):
        # From the lowest voltage on, so that a model knows how the muscle came there.
        wave, level = ramps(time, (0.0, 10.0), (LOW, volt)), wide * volt
        add(f"held-{volt:g}V", "test", wave, pulled, stage="held", level=level, start=PULLED_FROM)
    roles: tuple[Role, ...] = ("train", "train", "test")
    for seed, role in enumerate(roles, start=1):
        wave = random_wave(time, 0.2, HIGH, LOW, seed=seed)
        pulled = random_wave(time, 0.2, 200.0, seed=100 + seed)
        add(f"random-{seed}", role, wave, pulled, stage="random")
    source = "Actuators 2022, 11(2), 51, doi:10.3390/act11020051, Sections 2 and 4"
    notes = "How the hand pulls three times is ours: the paper gives the peaks. So are random runs."
    return Protocol("mpi-narmax", "rail", source, tuple(runs), notes)


def driven(recordings: Sequence[Recording]) -> str:
    """Return the input common to all recordings, besides displacement and force."""
    shared = [x for x in ("voltage", "pressure") if all(x in one for one in recordings)]
    if not shared:
        remedy = "add the voltage of the valve to all of them, or the pressure"
        raise DataError("the recordings share no input", channel="voltage", remedy=remedy)
    return shared[0]


def recognised(runs: Sequence[Features]) -> list[Labels]:
    """Return stages by drive and force, and the statuses: by weight, pull and frequency."""
    drive = driven([one.recording for one in runs])
    strongest = max(float(np.percentile(one.recording["force"], 99)) for one in runs)
    every = [_stage(one, drive, strongest) for one in runs]

    def marked(status: int, stage: str, rank: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """Mark the run of a stage that ranks highest, and return its labels."""
        those = [own for own in every if own["stage"] == stage and "status" not in own]
        chosen = max(those, key=rank, default={})
        chosen |= {"status": status} if chosen else {}
        return chosen

    heavy = marked(3, "weight", lambda own: (own["mass"], own["frequency"]))
    marked(
        2, "weight", lambda own: (own["mass"] < 0.9 * heavy["mass"], own["frequency"], own["mass"])
    )
    rates = sorted(own["frequency"] for own in every if own["stage"] == "free")
    usual = rates[len(rates) // 2] if rates else 0.0
    marked(1, "free", lambda own: -abs(own["frequency"] - usual))
    marked(VARYING, "pulls", lambda own: own["hand"])
    weaker = [own for own in every if own["stage"] == "pulls" and "status" not in own]
    learned = min(weaker, key=lambda own: abs(own["frequency"] - usual), default=None)
    *_, last = [None, *(own for own in every if own["stage"] == "random")]
    train = [
        own for own in every if own["stage"] in ("free", "random") or own.get("status") in (2, 3)
    ]
    train += [learned] if learned else []
    kept = {id(own) for own in train} - {id(last)}
    return [Labels("train" if id(own) in kept else "test", own) for own in every]


def _stage(one: Features, drive: str, strongest: float) -> dict[str, Any]:
    """Return the labels of a run by what moves in it."""
    u, force = one.recording[drive], one.recording["force"]
    level = float(np.median(u[len(u) // 2 :]))
    away = np.flatnonzero(np.abs(u - level) > STILL * one.spans[drive])
    start = 0 if not away.size else int(away[-1]) + 1
    if start < len(u) // 2 and one.moves("force"):
        pulled = np.abs(force[start:] - force[start]) > STILL * one.spans["force"]
        start += int(np.argmax(pulled))
        return {"stage": "held", "level": round(level, 2), "start": start * one.recording.step}
    if not one.regular(drive):
        return {"stage": "random"}
    labels = {"frequency": float(f"{one.frequency(drive):.2g}"), "mass": 0.0, "hand": 0.0}
    if one.moves("force"):
        return labels | {"stage": "pulls", "hand": float(np.percentile(force, 99))}
    if abs(one.level("force")) < UNLOADED * strongest:
        return labels | {"stage": "free"}
    return labels | {"stage": "weight", "mass": round(one.level("force") / GRAVITY, 2)}
