"""The experiments on a self-made McKibben muscle that lifts weights.

Source: Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and Particle
Swarm Optimization, Section 4.1: forces of 0 to 300 N in steps of 50 N, sines of 0.5 to 2 Hz, then a
random wave with minor loops; before them, a slow cycle at every force for the static pressure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.papers.recognising import Labels
from mckibben.recording import Recording
from mckibben.rigs import Rig, share
from mckibben.signals.broadband import random_wave
from mckibben.signals.excitations import sine
from mckibben.signals.features import Features, grouped
from mckibben.signals.protocol import PlannedRun, Protocol, Role

SAMPLE_TIME = 0.005
FORCES = (0.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0)
"""Weights hung on the muscle [N]."""

FREQUENCIES = (0.5, 1.0, 1.5, 2.0)
"""Of the sines [Hz]."""

LOWEST = (-2.85e-9, 1.19e-6, 3.86e-4, 6.48e-2)
HIGHEST = (-4.89e-9, -1.41e-7, 1.30e-3, 9.46e-2)
"""Pressures between which the sines go [MPa], as cubics of the force: y_1 and y_2 of Table 1."""

STATIC_PERIOD = 60.0
STATIC_HIGH = 4.0
"""Of the slow cycle: its time [s], and its highest pressure [bar]."""

RANGE = 5.0
"""Highest pressure of the rig [bar]."""

SLOW = 0.25
"""Highest frequency of a slow cycle, relative to the median of all."""

CYCLES = 8
RANDOM_TIME = 20.0


def activation_pressure(rig: Rig | None = None) -> Protocol:
    """Return slow cycles, sines and random waves at every force, in shares of the ranges of a rig."""
    stronger, wider = share(rig, "force", FORCES[-1]), share(rig, "pressure", RANGE)
    runs = []
    for paper_force in FORCES:
        force = stronger * paper_force
        low, high = (
            10 * wider * float(np.polyval(cubic, paper_force)) for cubic in (LOWEST, HIGHEST)
        )
        time = np.arange(round(STATIC_PERIOD / SAMPLE_TIME) + 1) * SAMPLE_TIME
        wave = sine(time, STATIC_PERIOD, wider * STATIC_HIGH)
        runs.append(_run(f"static-{force:.0f}N", "train", wave, force, 0.0, "static"))
        for frequency in FREQUENCIES:
            time = np.arange(round(CYCLES / frequency / SAMPLE_TIME) + 1) * SAMPLE_TIME
            wave = sine(time, 1 / frequency, high, low)
            name = f"sine-{force:.0f}N-{frequency:.1f}Hz"
            runs.append(_run(name, "train", wave, force, frequency, "hysteresis"))
        for i, frequency in enumerate(FREQUENCIES):
            time = np.arange(round(RANDOM_TIME / SAMPLE_TIME) + 1) * SAMPLE_TIME
            wave = random_wave(time, frequency, high, low, seed=i)
            name = f"random-{force:.0f}N-{frequency:.1f}Hz"
            runs.append(_run(name, "test", wave, force, frequency, "random"))
    return Protocol(
        name="activation-pressure",
        rig="mckibben-530",
        source="Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and "
        "Particle Swarm Optimization, Section 4.1",
        runs=tuple(runs),
        notes="Sines go between the pressures y_1 and y_2 of Table 1; the random waves' highest "
        "frequency is that of the sine. Slow cycles are ours. Loads are forces: hanging weights "
        "would resonate with the muscle (at 1.8 Hz with 300 N), which the paper does not show.",
    )


def _run(
    name: str, role: Role, wave: np.ndarray, force: float, frequency: float, stage: str
) -> PlannedRun:
    return PlannedRun(
        name=name,
        role=role,
        inputs=Recording({"pressure": wave, "force": np.full(wave.size, force)}, SAMPLE_TIME),
        settings={"start.pressure": float(wave[0]), "start.force": force},
        labels={"stage": stage, "force": force, "frequency": frequency},
    )


def recognised(runs: Sequence[Features]) -> list[Labels]:
    """Return stages by the shape and rate of the pressure, at the force that is held."""
    apart = 0.03 * runs[0].spans["force"]
    forces = grouped([one.level("force") for one in runs], apart)
    regular = [one.regular("pressure") for one in runs]
    rates = [float(f"{one.frequency('pressure'):.2g}") for one in runs]
    usual = float(np.median([f for f, sine_ in zip(rates, regular, strict=True) if sine_] or [0.0]))
    known = sorted(
        {f for f, sine_ in zip(rates, regular, strict=True) if sine_ and f >= SLOW * usual}
    )
    found: list[Labels] = []
    for one, force, sine_, rate in zip(runs, forces, regular, rates, strict=True):
        if not sine_:  # of the sine whose frequency is its highest
            highest = one.highest_frequency("pressure")
            rate = min(known, key=lambda f: abs(f - highest), default=round(highest, 2))
        stage = "random" if not sine_ else "static" if rate < SLOW * usual else "hysteresis"
        labels = {"stage": stage, "force": force, "frequency": 0.0 if stage == "static" else rate}
        found.append(Labels("train" if sine_ else "test", labels))
    return found
