"""The experiments on a soft arm of three contractile muscles round an extensor.

Source: Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator, Sections 2.2 and 5.

All signals are sines of 0.02 Hz. The paper's equation starts them in the middle of their range, with a
jump at every change of amplitude; here each cycle starts at its minimum.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mckibben.recording import Recording
from mckibben.signals.excitations import sine
from mckibben.signals.protocols.protocol import Protocol, Role, Run

PERIOD = 50.0
"""Of every sine [s]."""

PATTERNS: dict[str, tuple[int, ...]] = {"1": (1,), "2": (2,), "3": (3,), "123": (1, 2, 3)}
"""Which muscles are driven together; the others have no pressure."""

IDENTIFICATION_PEAKS = (1.0, 1.5, 2.0, 2.5)
"""Peak of each cycle when the hysteresis of a muscle is identified [bar], Eq. (22)."""

TRAINING_PEAKS = (1.5, 2.5)
"""Peaks of the two cycles that train the network [bar]; the paper does not print them."""

TRAINING = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.5)
VALIDATION = (0.1, 0.5, 0.7, 1.1, 1.5, 1.7, 2.3)
TEST = (0.3, 0.9, 1.3, 1.9, 2.1, 2.4)
"""Pressures of the extensor [bar] whose runs train, validate and test, Section 5.1."""

PREDICTION = (0.1, 1.5, 1.7)
"""Pressures of the extensor in the check of predictions [bar]."""


def sdchm() -> Protocol:
    """Return all runs: identification, coupling patterns, network data, prediction check."""
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
    return Protocol(
        name="sdchm",
        rig="soft-arm",
        source="Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for "
        "Parallel Pneumatic Artificial Muscle-Driven Soft Manipulator, Sections 2.2 and 5.1",
        runs=tuple(runs),
        notes=f"Sines start at their minimum; network runs have cycles of {TRAINING_PEAKS} bar.",
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
