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

SAMPLE_TIME = 0.001
"""Of all runs [s]."""

TIME = 60.0
"""Duration of runs, but for those at 0.05 Hz [s]."""

LOW, HIGH = 0.1, 10.0
"""Dead zone of the regulator and highest voltage [V]."""

STRONGEST = 300.0
"""Highest force of the rig [N], of which weights and pulls are shares."""

VARYING = 4
"""Status in which the force varies."""

UNLOADED = 0.1
"""Largest force of a run without load, relative to the largest of all."""

STILL = 0.05
"""Largest change of an input that is held, relative to its range."""

PULLED_FROM = 20.0
"""Time at which the force begins while the voltage is held [s]."""

LIGHTER = 0.9
"""Largest weight of status 2, relative to that of status 3."""


class Sine(NamedTuple):
    """A run with a sine: its frequency [Hz], a weight [kg], the peaks of three pulls [N], its status."""

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
        run
        for f in (0.05, 0.1, 0.2)
        for run in (
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
    drive_share, force_share = share(rig, drive, HIGH), share(rig, "force", STRONGEST)
    runs = list[PlannedRun]()

    def add(name: str, role: Role, volts: Array, newtons: Array, **labels: Any) -> None:
        channels = {drive: drive_share * volts, "force": force_share * newtons}
        mass = round(labels.get("mass", 0.0), 6)
        settings = {"payload": mass, f"start.{drive}": drive_share * LOW}
        runs.append(PlannedRun(name, role, Recording(channels, SAMPLE_TIME), settings, labels))

    for name, role, stage, f, mass, hand, status in SINES:
        duration = max(TIME, 4 / f)
        time = _times(duration)
        volts, newtons = sine(time, 1 / f, HIGH, LOW), pulls(time, hand, duration=duration / 6)
        labels = {
            "stage": stage,
            "frequency": f,
            "mass": force_share * mass,
            "hand": force_share * hand,
        }
        add(name, role, volts, newtons, **labels, **({"status": status} if status else {}))

    time = _times(TIME)
    newtons = np.where(time < PULLED_FROM, 0.0, triangle(time, 20.0, 150.0))
    for volt in (2.0, 4.0, 6.0, 8.0, 10.0):
        # from the lowest voltage on, so that a model has the memory of how the muscle came there
        volts, level = ramps(time, (0.0, 10.0), (LOW, volt)), drive_share * volt
        labels = {"stage": "held", "level": level, "start": PULLED_FROM}
        add(f"held-{volt:g}V", "test", volts, newtons, **labels)

    roles: tuple[Role, ...] = ("train", "train", "test")
    for seed, role in enumerate(roles, start=1):
        volts = random_wave(time, 0.2, HIGH, LOW, seed=seed)
        newtons = random_wave(time, 0.2, 200.0, seed=100 + seed)
        add(f"random-{seed}", role, volts, newtons, stage="random")
    source = "Actuators 2022, 11(2), 51, doi:10.3390/act11020051, Sections 2 and 4"
    notes = "How the hand pulls three times is ours: the paper gives the peaks. So are random runs."
    return Protocol("mpi-narmax", "rail", source, tuple(runs), notes)


def _times(duration: float) -> Array:
    """Return the times of samples, without the end [s]."""
    return np.arange(round(duration / SAMPLE_TIME), dtype=np.float64) * SAMPLE_TIME


def driven(recordings: Sequence[Recording]) -> str:
    """Return the input common to all recordings, besides displacement and force."""
    shared = [x for x in ("voltage", "pressure") if all(x in run for run in recordings)]
    if not shared:
        remedy = "add the voltage of the valve to all of them, or the pressure"
        raise DataError("the recordings share no input", channel="voltage", remedy=remedy)
    return shared[0]


def recognised(runs: Sequence[Features]) -> list[Labels]:
    """Return stages by drive and force, and the statuses: by weight, pull and frequency.

    Status 3 is the heaviest weight, 2 the fastest lighter one, 1 the run without load at the usual
    frequency, and 4 the strongest pulls. Training are statuses 2 and 3, runs without load, random runs
    but the last, and of the weaker pulls those at the usual frequency.
    """
    drive = driven([run.recording for run in runs])
    strongest = max(float(np.percentile(run.recording["force"], 99)) for run in runs)
    labels = [_stage(run, drive, strongest) for run in runs]
    frequencies = sorted(entry["frequency"] for entry in labels if entry["stage"] == "free")
    usual = frequencies[len(frequencies) // 2] if frequencies else 0.0

    def unmarked(stage: str) -> list[dict[str, Any]]:
        """Return the labels of the runs of a stage that have no status."""
        return [entry for entry in labels if entry["stage"] == stage and "status" not in entry]

    def mark(status: int, stage: str, rank: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """Give a status to the run of a stage that ranks highest; return its labels."""
        highest_ranked: dict[str, Any] = max(unmarked(stage), key=rank, default={})
        highest_ranked |= {"status": status} if highest_ranked else {}
        return highest_ranked

    heavy = mark(3, "weight", lambda entry: (entry["mass"], entry["frequency"]))

    def lighter_and_fast(entry: dict[str, Any]) -> tuple[bool, float, float]:
        return (entry["mass"] < LIGHTER * heavy["mass"], entry["frequency"], entry["mass"])

    mark(2, "weight", lighter_and_fast)
    mark(1, "free", lambda entry: -abs(entry["frequency"] - usual))
    mark(VARYING, "pulls", lambda entry: entry["hand"])

    train = [entry for entry in labels if entry["stage"] == "free" or entry.get("status") in (2, 3)]
    train += unmarked("random")[:-1]
    train += sorted(unmarked("pulls"), key=lambda entry: abs(entry["frequency"] - usual))[:1]
    ids = {id(entry) for entry in train}
    return [Labels("train" if id(entry) in ids else "test", entry) for entry in labels]


def _stage(run: Features, drive: str, strongest: float) -> dict[str, Any]:
    """Return the labels of a run by what moves in it; ``strongest`` is the largest force of all [N]."""
    u, force = run.recording[drive], run.recording["force"]
    level = float(np.median(u[len(u) // 2 :]))
    last_changes = np.flatnonzero(np.abs(u - level) > STILL * run.spans[drive])
    start = 0 if not last_changes.size else int(last_changes[-1]) + 1
    if start < len(u) // 2 and run.moves("force"):
        is_pulled = np.abs(force[start:] - force[start]) > STILL * run.spans["force"]
        start += int(np.argmax(is_pulled))
        return {"stage": "held", "level": round(level, 2), "start": start * run.recording.step}
    if not run.regular(drive):
        return {"stage": "random"}

    labels = {"frequency": float(f"{run.frequency(drive):.2g}"), "mass": 0.0, "hand": 0.0}
    if run.moves("force"):
        return labels | {"stage": "pulls", "hand": float(np.percentile(force, 99))}
    if abs(run.level("force")) < UNLOADED * strongest:
        return labels | {"stage": "free"}
    return labels | {"stage": "weight", "mass": round(run.level("force") / GRAVITY, 2)}
