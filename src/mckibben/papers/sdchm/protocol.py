"""The experiments on a soft arm of three muscles round an extensor.

Source: Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator, Sections 2.2 and 5.

The paper's signals are sines of 0.02 Hz, on one muscle at a time or on all three alike. Its equation
starts them in the middle of their range, with a jump at every change of amplitude; here each cycle
starts at its minimum. Runs in which all pressures are random at once are ours: the paper's patterns
cover few of the combinations of pressures, and a model that is accurate on them may be wrong elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mckibben.channels import by_name
from mckibben.errors import DataError
from mckibben.papers.recognising import EXTENSOR, Labels
from mckibben.recording import Recording
from mckibben.rigs import Rig, share
from mckibben.rigs.setups.arm import Arm
from mckibben.signals.broadband import random_wave
from mckibben.signals.excitations import sine
from mckibben.signals.features import Features, grouped
from mckibben.signals.protocol import PlannedRun, Protocol, Role

PERIOD, HIGHEST, DIAMETER = 50.0, 2.5, 30.0
"""Of every sine [s]; the pressure that all muscles withstand [bar], and the diameter of those that
contract [mm], Table 1."""

PATTERNS = ("1", "2", "3", "123")
"""Muscles that are driven together; the others have no pressure."""

TRAINING = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.5)
VALIDATION, TEST = (0.1, 0.5, 0.7, 1.1, 1.5, 1.7, 2.3), (0.3, 0.9, 1.3, 1.9, 2.1, 2.4)

STAGES: tuple[tuple[str, Role, Sequence[str], Sequence[float], Sequence[float]], ...] = (
    ("hysteresis", "train", "123", (0.0,), (1.0, 1.5, 2.0, 2.5)),
    ("network", "train", PATTERNS, TRAINING, (1.5, 2.5)),
    ("network", "validation", PATTERNS, VALIDATION, (1.5, 2.5)),
    ("network", "test", PATTERNS, TEST, (1.5, 2.5)),
    ("prediction", "test", PATTERNS, (0.1, 1.5, 1.7), (1.4, 1.4)),
    ("coupling", "test", PATTERNS, (1.0,), (1.3, 1.3)),
    ("stiffness", "test", "1", (0.0, 0.5, 1.0, 1.5, 2.0, 2.5), (0.7, 0.7)),
)
"""Stage, role, muscles driven, pressures of the extensor, and peak of each cycle [bar]: Eq. (22),
Sections 5.1 and 2.2. Which of Eq. (22)'s cycles train the network the paper does not say."""

NAMES = {
    "hysteresis": "gpi-{d}",
    "coupling": "coupling-drive-{d}",
    "stiffness": "stiffness-p0-{p0}",
}
"""Of the runs of a stage; others have both."""

JOINT: dict[Role, tuple[float | None, ...]] = {
    "train": (0.4, 1.2, 2.0, None, None),
    "validation": (0.5, 1.7, None, None),
    "test": (0.3, 1.1, 1.9, None, None),
}
"""Pressures of the extensor in runs with all pressures random [bar]; None where it moves too."""

JOINT_TIME, JOINT_START = 150.0, 20.0
"""Of those runs, and in which the muscles' pressures set in from rest, as patterns do [s]."""

QUICK = {"hysteresis": 2.0, "joint": 1.5}
"""Periods of each run that the quick run records, else 1: the last; the first of joint runs."""

QUICK_RUNS = (
    *("gpi", "network-p0-0.0", "network-p0-1.2", "network-p0-2.5", "network-p0-1.3"),
    *("prediction-p0-0.1", "coupling", "stiffness-p0-0", "stiffness-p0-1.0"),
    *("joint-validation-p0-0.5", "joint-test-p0-1.1", "joint-test-moving-3"),
)
"""How names of runs begin that the quick run records."""


def sdchm(rig: Rig | None = None) -> Protocol:
    """Return all runs: identification, network, prediction, coupling, stiffness, joint random.

    On another arm pressures are in proportion to its highest, that of the extensor to its own.
    """
    runs = [
        _sines(stage, role, d, p0, peaks)
        for stage, role, patterns, levels, peaks in STAGES
        for p0 in levels
        for d in patterns
    ]
    runs += [_joint(role, number, p0) for role in JOINT for number, p0 in enumerate(JOINT[role])]
    shares = share(rig, "pressure_1", HIGHEST), share(rig, EXTENSOR, HIGHEST)
    return Protocol(
        name="sdchm",
        rig="soft-arm",
        source="Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for "
        "Parallel Pneumatic Artificial Muscle-Driven Soft Manipulator, Sections 2.2 and 5.1",
        runs=tuple(_scaled(run, *shares) for run in runs),
        notes="Sines start at their minimum; network runs have cycles of (1.5, 2.5) bar. "
        "Runs with all pressures random are ours.",
    )


def _scaled(run: PlannedRun, of_muscles: float, of_extensor: float) -> PlannedRun:
    """Return a run with its pressures in proportion; its name has the paper's."""
    factors = dict.fromkeys(run.inputs.channels, of_muscles) | {EXTENSOR: of_extensor}
    waves = {name: factor * run.inputs[name] for name, factor in factors.items()}
    p0 = of_extensor * run.labels["p0"]
    labels, start = {**run.labels, "p0": p0}, {f"start.{EXTENSOR}": p0}
    return replace(run, inputs=Recording(waves, run.inputs.step), settings=start, labels=labels)


def strength(rig: Rig) -> float:
    """Return the force of an arm's muscles by that of the paper's: pressure by cross-section."""
    diameter_ratio = rig.muscle.diameter / DIAMETER if isinstance(rig, Arm) else 1.0
    return share(rig, "pressure_1", HIGHEST) * diameter_ratio**2


def quick(rig: Rig | None = None) -> tuple[Protocol, list[str]]:
    """Return the protocol with shortened runs, and the names of the runs of a quick run."""
    protocol = sdchm(rig)
    names = [run.name for run in protocol.runs if run.name.startswith(QUICK_RUNS)]
    return replace(protocol, name="sdchm-quick", runs=tuple(map(_shortened, protocol.runs))), names


def _shortened(run: PlannedRun) -> PlannedRun:
    stage, inputs = run.labels["stage"], run.inputs
    n = round(QUICK.get(stage, 1.0) * PERIOD / inputs.step)
    piece = inputs.slice(0, n) if stage == "joint" else inputs.slice(len(inputs) - n, len(inputs))
    return replace(run, inputs=replace(piece, start_time=0.0))


def _sines(stage: str, role: Role, driven: str, p0: float, peaks: Sequence[float]) -> PlannedRun:
    rate = 50.0 if stage == "hysteresis" else 20.0
    wave = sine(np.arange(round(PERIOD * len(peaks) * rate)) / rate, PERIOD, peaks)
    channels = {f"pressure_{k}": wave if k in driven else 0.0 * wave for k in "123"}
    inputs = Recording(channels | {EXTENSOR: np.full(wave.size, p0)}, 1 / rate)
    name = NAMES.get(stage, f"{stage}-p0-{{p0}}-drive-{{d}}").format(d=driven, p0=p0)
    labels = {"stage": stage, "p0": p0, "driven": driven}
    return PlannedRun(name, role, inputs, {}, labels)


def _joint(role: Role, number: int, p0: float | None) -> PlannedRun:
    """Return a run with all pressures random: muscles up to 0.05 Hz, the extensor to 0.02 Hz."""
    time = np.arange(round(JOINT_TIME * 20.0)) / 20.0
    seed, rise = 1000 * list(JOINT).index(role) + 10 * number, np.minimum(time / JOINT_START, 1.0)
    waves = {k: rise * random_wave(time, 0.05, HIGHEST, seed=seed + k) for k in (1, 2, 3)}
    moving = random_wave(time, 0.02, HIGHEST, seed=seed)
    extensor = moving if p0 is None else np.full(time.size, p0)
    channels = {f"pressure_{k}": wave for k, wave in waves.items()}
    inputs = Recording(channels | {EXTENSOR: extensor}, 1 / 20.0)
    start, kind = float(extensor[0]), "moving" if p0 is None else "constant"
    name = f"joint-{role}-moving-{number}" if p0 is None else f"joint-{role}-p0-{p0}"
    labels = {"stage": "joint", "p0": start, "driven": "123", "extensor": kind}
    return PlannedRun(name, role, inputs, {}, labels)


SAME = 0.02
"""Largest difference of pressures that are meant to be equal, relative to the highest."""


def recognised(runs: Sequence[Features]) -> list[Labels]:
    """Return stages by the muscles that move and their peaks, at the pressure of the extensor.

    Pressures of the extensor train, validate and test as the paper's do where they are these, relative
    to the highest; else every other one trains.
    """
    muscles = [name for name in by_name([runs[0].recording])[0] if name != EXTENSOR]
    if not muscles:
        remedy = "name the columns of its muscles with `columns[pressure_1]=COLUMN` and so on"
        raise DataError("no muscle beside the extensor has a pressure", remedy=remedy)
    highest = max(float(np.percentile(run.recording[name], 99)) for run in runs for name in muscles)
    tolerance = SAME * highest
    levels = grouped([run.level(EXTENSOR) for run in runs], tolerance)
    labels = [_moving(run, muscles, p0, tolerance) for run, p0 in zip(runs, levels, strict=True)]
    single_runs = [entry for entry in labels if entry["stage"] == "single"]
    peaks = grouped([entry["peaks"][0] for entry in single_runs], tolerance)
    for entry, peak in zip(single_runs, peaks, strict=True):
        entry["peaks"] = [peak]
    for entry in single_runs:
        is_weak = entry["peaks"][0] < max(peaks)
        is_single = {
            len(other["driven"]) for other in single_runs if other["peaks"] == entry["peaks"]
        } == {1}
        entry["stage"] = (
            "stiffness" if is_weak and is_single else "coupling" if is_weak else "prediction"
        )
    roles = _roles({entry["p0"] for entry in labels if entry["stage"] == "network"}, max(levels))
    joint_runs = [k for k, entry in enumerate(labels) if entry["stage"] == "joint"]
    result: list[Labels] = []
    for k, (run, entry) in enumerate(zip(runs, labels, strict=True)):
        alike = [j for j in joint_runs if labels[j].get("extensor") == entry.get("extensor")]
        role: Role = "train" if entry["stage"] == "hysteresis" else "test"
        role = roles[entry["p0"]] if entry["stage"] == "network" else role
        if k in joint_runs:  # which are all alike: the last third tests
            share_after = alike[::-1].index(k) / len(alike)
            role = run.hint or (
                "test" if share_after < 1 / 3 else "validation" if share_after < 1 / 2 else "train"
            )
        result.append(Labels(role, entry))
    return result


def _moving(run: Features, muscles: Sequence[str], p0: float, tolerance: float) -> dict[str, Any]:
    """Return the labels of a run by the muscles that move in it."""
    moving = [name for name in muscles if run.moves(name)]
    driven = "".join(name.rpartition("_")[2] for name in moving)
    labels: dict[str, Any] = {"p0": p0, "driven": driven}
    if not moving:
        return labels | {"stage": "rest"}
    waves = [run.recording[name] for name in moving]
    alike = all(np.percentile(np.abs(wave - waves[0]), 90) < 2 * tolerance for wave in waves)
    if run.moves(EXTENSOR) or not alike or not run.regular(moving[0]):
        extensor = "moving" if run.moves(EXTENSOR) else "constant"
        return labels | {"stage": "joint", "extensor": extensor}
    peaks = sorted({*grouped(run.peaks(moving[0]), tolerance)})
    rising = len(peaks) > 2 and len(moving) == 1
    stage = "single" if len(peaks) == 1 else "hysteresis" if rising else "network"
    return labels | {"stage": stage, "peaks": peaks}


def _roles(levels: set[float], highest: float) -> dict[float, Role]:
    """Return the role of every pressure of the extensor."""
    printed: dict[float, Role] = dict.fromkeys(TRAINING, "train")
    validation: Role = "validation"
    test: Role = "test"
    printed |= dict.fromkeys(VALIDATION, validation) | dict.fromkeys(TEST, test)
    scaled = {p0: p0 / (highest or 1.0) * HIGHEST for p0 in levels}
    nearest = {
        p0: min(printed, key=lambda printed_level: abs(printed_level - level))
        for p0, level in scaled.items()
    }
    roles = {p0: printed[printed_level] for p0, printed_level in nearest.items()}
    if {*roles.values()} == {*printed.values()}:
        return roles
    alternating = test, validation
    ascending = sorted(levels)
    alternate_roles: dict[float, Role] = {
        p0: alternating[k // 2 % 2] for k, p0 in enumerate(ascending)
    }
    return alternate_roles | dict.fromkeys((*ascending[::2], *ascending[-1:]), "train")
