"""The experiments on a soft arm of three contractile muscles round an extensor.

Source: Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator, Sections 2.2 and 5.

The paper's signals are sines of 0.02 Hz, on one muscle at a time or on all three alike. Its equation
starts them in the middle of their range, with a jump at every change of amplitude; here each cycle
starts at its minimum.

Runs in which all pressures are random at once are ours: the paper's patterns visit but a few lines among
all combinations of pressures, and a model can be close along them and anything at all beside.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mckibben.recording import Recording
from mckibben.signals.broadband import random_wave
from mckibben.signals.excitations import sine
from mckibben.signals.protocol import Protocol, Role, Run

PERIOD = 50.0
"""Of every sine [s]."""

PATTERNS: dict[str, tuple[int, ...]] = {"1": (1,), "2": (2,), "3": (3,), "123": (1, 2, 3)}
"""Which muscles are driven together; the others have no pressure."""

IDENTIFICATION_PEAKS = (1.0, 1.5, 2.0, 2.5)
"""Peak of each cycle when the hysteresis of a muscle is identified [bar], Eq. (22)."""

TRAINING_PEAKS = (1.5, 2.5)
"""Peaks of the two cycles that train the network [bar]; the paper does not say which of Eq. (22)'s."""

TRAINING = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.5)
VALIDATION = (0.1, 0.5, 0.7, 1.1, 1.5, 1.7, 2.3)
TEST = (0.3, 0.9, 1.3, 1.9, 2.1, 2.4)
"""Pressures of the extensor [bar] whose runs train, validate and test, Section 5.1."""

PREDICTION = (0.1, 1.5, 1.7)
"""Pressures of the extensor in the check of predictions [bar]; all belong to the validation set."""

JOINT: dict[Role, tuple[float | None, ...]] = {
    "train": (0.4, 1.2, 2.0, None, None),
    "validation": (0.5, 1.7, None, None),
    "test": (0.3, 1.1, 1.9, None, None),
}
"""Pressures of the extensor in runs with all pressures random [bar]; None where it moves too."""

JOINT_TIME, JOINT_FREQUENCY, EXTENSOR_FREQUENCY = 150.0, 0.05, 0.02
"""Of those runs [s], and highest frequencies of the muscles' pressures and the extensor's [Hz]."""

JOINT_START = 20.0
"""Time in which the muscles' random pressures set in from rest [s], where the patterns start too."""

HIGHEST = 2.5
"""Pressure that all muscles withstand [bar], Table 1."""


def sdchm() -> Protocol:
    """Return all runs: identification, network, prediction, coupling patterns, joint random."""
    runs = [
        _run(f"gpi-{k}", "train", (k,), 0.0, IDENTIFICATION_PEAKS, 50.0, stage="hysteresis")
        for k in (1, 2, 3)
    ]
    roles: Iterable[tuple[Role, tuple[float, ...]]] = (
        ("train", TRAINING),
        ("validation", VALIDATION),
        ("test", TEST),
    )
    for role, pressures in roles:
        for p0 in pressures:
            for pattern, driven in PATTERNS.items():
                name = f"network-p0-{p0:.1f}-drive-{pattern}"
                runs.append(_run(name, role, driven, p0, TRAINING_PEAKS, 20.0, stage="network"))
    for p0 in PREDICTION:
        for pattern, driven in PATTERNS.items():
            name = f"prediction-p0-{p0:.1f}-drive-{pattern}"
            runs.append(_run(name, "test", driven, p0, (1.4, 1.4), 20.0, stage="prediction"))
    for pattern, driven in PATTERNS.items():
        name = f"coupling-drive-{pattern}"
        runs.append(_run(name, "test", driven, 1.0, (1.3, 1.3), 20.0, stage="coupling"))
    for p0 in (0.0, 0.5, 1.0, 1.5, 2.0, 2.5):
        name = f"stiffness-p0-{p0:.1f}"
        runs.append(_run(name, "test", (1,), p0, (0.7, 0.7), 20.0, stage="stiffness"))
    for role in JOINT:
        runs += _joint(role)
    return Protocol(
        name="sdchm",
        rig="soft-arm",
        source="Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for "
        "Parallel Pneumatic Artificial Muscle-Driven Soft Manipulator, Sections 2.2 and 5.1",
        runs=tuple(runs),
        notes=f"Sines start at their minimum; network runs have cycles of {TRAINING_PEAKS} bar. "
        "Runs with all pressures random are ours.",
    )


def _run(
    name: str,
    role: Role,
    driven: tuple[int, ...],
    p0: float,
    peaks: tuple[float, ...],
    rate: float,
    *,
    stage: str,
) -> Run:
    time = np.arange(round(PERIOD * len(peaks) * rate)) / rate
    wave = sine(time, PERIOD, peaks)
    channels = {f"pressure_{k}": wave if k in driven else 0.0 * wave for k in (1, 2, 3)}
    channels["pressure_extensor"] = np.full(time.size, p0)
    return Run(
        name=name,
        role=role,
        inputs=Recording(channels, 1 / rate),
        settings={"start.pressure_extensor": p0},
        labels={"stage": stage, "p0": p0, "driven": "".join(map(str, driven))},
    )


def _joint(role: Role) -> list[Run]:
    """Return the runs of a role with all pressures random at once."""
    first = 1000 * list(JOINT).index(role)
    time = np.arange(round(JOINT_TIME * 20.0)) / 20.0
    runs = []
    for number, p0 in enumerate(JOINT[role]):
        seed = first + 10 * number
        channels = {
            f"pressure_{k}": np.minimum(time / JOINT_START, 1.0)
            * random_wave(time, JOINT_FREQUENCY, HIGHEST, seed=seed + k)
            for k in (1, 2, 3)
        }
        channels["pressure_extensor"] = (
            random_wave(time, EXTENSOR_FREQUENCY, HIGHEST, seed=seed)
            if p0 is None
            else np.full(time.size, p0)
        )
        start = float(channels["pressure_extensor"][0])
        extensor = "moving" if p0 is None else "constant"
        name = f"moving-{number}" if p0 is None else f"p0-{p0:.1f}"
        runs.append(
            Run(
                name=f"joint-{role}-{name}",
                role=role,
                inputs=Recording(channels, 1 / 20.0),
                settings={"start.pressure_extensor": start},
                labels={"stage": "joint", "p0": start, "driven": "123", "extensor": extensor},
            )
        )
    return runs
