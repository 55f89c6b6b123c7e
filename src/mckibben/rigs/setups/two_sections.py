"""A soft arm of two sections in series, each of contractile muscles round an extensor.

The distal section hangs from the lower disc of the proximal one and loads it with its weight, and with
a moment where it is bent aside; the tilt of the proximal disc turns gravity for all that hangs below.
See `mckibben.rigs.setups.arm`.

The open point of: Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for
Parallel Pneumatic Artificial Muscle-Driven Soft Manipulator, Section 6.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.rigs.recording import share
from mckibben.rigs.rig import Rig
from mckibben.rigs.setups.arm import Bundle, Hanging
from mckibben.signals.broadband import random_wave
from mckibben.signals.excitations import sine
from mckibben.signals.protocol import PlannedRun, Protocol, Role

MUSCLES = {"proximal": "123", "distal": "456"}
"""Numbers of the muscles of each section."""

EXTENSORS = ("pressure_extensor_1", "pressure_extensor_2")

HIGHEST, AT_REST = 2.5, 1.0
"""Of all pressures, and of the extensor of a section that is not driven [bar]."""

PERIOD, PEAKS = 50.0, (1.4, 1.4)
"""Of the sines that drive one muscle [s], [bar]."""

DURATION, RISE, STEP = 150.0, 20.0, 0.05
"""Of random runs, and in which their pressures set in from rest; between samples [s]."""

FASTEST, FASTEST_EXTENSOR = 0.05, 0.02
"""Highest frequencies of random pressures [Hz]."""

Levels = tuple[float, float] | None
"""Pressures of the extensors [bar]; None where they are random, too."""

TOGETHER: tuple[tuple[Role, Levels], ...] = (
    ("train", (0.4, 1.6)),
    ("train", (1.2, 0.8)),
    ("train", (2.0, 2.0)),
    ("train", None),
    ("train", None),
    ("validation", (0.8, 1.2)),
    ("validation", None),
    ("test", (0.6, 1.4)),
    ("test", (1.8, 0.6)),
    ("test", None),
)
"""Runs in which all muscles are random at once."""

ALONE: tuple[tuple[Role, float], ...] = (
    ("train", 0.4),
    ("train", 1.2),
    ("train", 2.0),
    ("validation", 0.8),
    ("test", 1.6),
)
"""Runs in which those of one section are: pressure of its extensor [bar]."""


class TwoSections(Hanging):
    """Two sections that load each other."""

    setup: Literal["two-sections"] = "two-sections"
    proximal: Bundle
    distal: Bundle

    @property
    def sections(self) -> tuple[Bundle, ...]:
        return self.proximal, self.distal


def two_sections(rig: Rig | None = None) -> Protocol:
    """Return all runs: every section alone, both together, every muscle alone.

    On another arm every pressure is in proportion to its highest.
    """
    alone: list[tuple[str, Role, Levels]] = [
        (section, role, (p0, AT_REST) if section == "proximal" else (AT_REST, p0))
        for section in MUSCLES
        for role, p0 in ALONE
    ]
    together = [("together", role, levels) for role, levels in TOGETHER]
    random = [_random(seed, *one) for seed, one in enumerate([*alone, *together])]
    runs = [*random, *map(_sines, "".join(MUSCLES.values()))]
    return Protocol(
        name="two-sections",
        rig="two-section-arm",
        source="Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for "
        "Parallel Pneumatic Artificial Muscle-Driven Soft Manipulator, Section 6 (open there)",
        runs=tuple(run if rig is None else _scaled(run, rig) for run in runs),
        notes="All of it is ours. Runs of a section alone are for a compensator of that section.",
    )


def _random(seed: int, driven: str, role: Role, levels: Levels) -> PlannedRun:
    """Return a run with random pressures in the muscles of a section, or of both."""
    time = np.arange(round(DURATION / STEP)) * STEP
    rise = np.minimum(time / RISE, 1.0)
    muscles = MUSCLES.get(driven, "".join(MUSCLES.values()))
    waves = {
        f"pressure_{k}": rise * random_wave(time, FASTEST, HIGHEST, seed=100 * seed + int(k))
        for k in muscles
    }
    for k, name in enumerate(EXTENSORS):
        wave = random_wave(time, FASTEST_EXTENSOR, HIGHEST, seed=100 * seed + 10 + k)
        waves[name] = wave if levels is None else np.full(time.size, levels[k])
    return _planned(f"{driven}-{role}-{seed}", role, waves, driven)


def _sines(muscle: str) -> PlannedRun:
    """Return a run that drives one muscle."""
    wave = sine(np.arange(round(len(PEAKS) * PERIOD / STEP)) * STEP, PERIOD, PEAKS)
    waves = {f"pressure_{muscle}": wave}
    waves |= {name: np.full(wave.size, AT_REST) for name in EXTENSORS}
    return _planned(f"muscle-{muscle}", "test", waves, muscle)


def _planned(name: str, role: Role, waves: dict[str, Array], driven: str) -> PlannedRun:
    """Return a run that begins at rest at its first pressures; muscles that are not driven have none."""
    still = np.zeros(len(waves[EXTENSORS[0]]))
    channels = [*(f"pressure_{k}" for numbers in MUSCLES.values() for k in numbers), *EXTENSORS]
    inputs = Recording({channel: waves.get(channel, still) for channel in channels}, STEP)
    start = {f"start.{channel}": float(inputs[channel][0]) for channel in EXTENSORS}
    return PlannedRun(name, role, inputs, start, {"driven": driven})


def _scaled(run: PlannedRun, rig: Rig) -> PlannedRun:
    """Return a run with every pressure in proportion to the highest of a rig."""
    factors = {name: share(rig, name, HIGHEST) for name in run.inputs.channels}
    waves = {name: factor * run.inputs[name] for name, factor in factors.items()}
    return _planned(run.name, run.role, waves, run.labels["driven"])
