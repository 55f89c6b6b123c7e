"""The experiments on a self-made McKibben muscle that lifts weights.

Source: Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and Particle
Swarm Optimization, Section 4.1: forces of 0 to 300 N in steps of 50 N, sines of 0.5 to 2 Hz, then a
random wave with minor loops; before them, a slow cycle at every force for the static pressure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.papers.recognising import Labels
from mckibben.recording import Recording
from mckibben.rigs import Rig, share
from mckibben.signals.broadband import random_wave
from mckibben.signals.excitations import sine
from mckibben.signals.features import Features, grouped
from mckibben.signals.protocol import PlannedRun, Protocol, Role

SAMPLE_TIME = 0.005
"""Of all runs [s]."""

FORCES = (0.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0)
"""Weights hung on the muscle [N]."""

FREQUENCIES = (0.5, 1.0, 1.5, 2.0)
"""Of the sines [Hz]."""

LOWEST = (-2.85e-9, 1.19e-6, 3.86e-4, 6.48e-2)
HIGHEST = (-4.89e-9, -1.41e-7, 1.30e-3, 9.46e-2)
"""Pressures between which the sines go [MPa], as cubics of the force [N], highest power first: y_1 and
y_2 of Table 1.
"""

STATIC_PERIOD = 60.0
"""Time of the slow cycle [s]."""

STATIC_HIGH = 4.0
"""Its highest pressure [bar]."""

RANGE = 5.0
"""Highest pressure of the rig [bar]."""

SAME_FORCE = 0.03
"""Share of the forces' range below which forces of runs are one."""

SLOWEST_SHARE = 0.25
"""Highest frequency of a slow cycle, relative to the median of all."""

CYCLES = 8
"""Of every sine."""

RANDOM_TIME = 20.0
"""Of every random wave [s]."""

BAR_PER_MPA = 10


def activation_pressure(rig: Rig | None = None) -> Protocol:
    """Return slow cycles, sines and random waves at every force, in shares of the ranges of a rig."""
    force_share, pressure_share = share(rig, "force", FORCES[-1]), share(rig, "pressure", RANGE)
    bar = BAR_PER_MPA * pressure_share
    runs = []
    for paper_force in FORCES:
        force = force_share * paper_force
        low, high = (bar * float(np.polyval(cubic, paper_force)) for cubic in (LOWEST, HIGHEST))

        wave = sine(_times(STATIC_PERIOD), STATIC_PERIOD, pressure_share * STATIC_HIGH)
        runs.append(_run(f"static-{force:.0f}N", "train", wave, force, 0.0, "static"))
        for frequency in FREQUENCIES:
            wave = sine(_times(CYCLES / frequency), 1 / frequency, high, low)
            name = f"sine-{force:.0f}N-{frequency:.1f}Hz"
            runs.append(_run(name, "train", wave, force, frequency, "hysteresis"))
        for seed, frequency in enumerate(FREQUENCIES):
            wave = random_wave(_times(RANDOM_TIME), frequency, high, low, seed=seed)
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


def _times(duration: float) -> Array:
    """Return the times of samples, first and last included [s]."""
    return np.arange(round(duration / SAMPLE_TIME) + 1, dtype=np.float64) * SAMPLE_TIME


def _run(
    name: str, role: Role, wave: Array, force: float, frequency: float, stage: str
) -> PlannedRun:
    """Return a run at a constant force [N] that starts at the first pressure of its wave [bar]."""
    return PlannedRun(
        name=name,
        role=role,
        inputs=Recording({"pressure": wave, "force": np.full(wave.size, force)}, SAMPLE_TIME),
        settings={"start.pressure": float(wave[0]), "start.force": force},
        labels={"stage": stage, "force": force, "frequency": frequency},
    )


def recognised(runs: Sequence[Features]) -> list[Labels]:
    """Return stages by the shape and rate of the pressure, at the force that is held.

    A random wave has the frequency of the sine nearest to its highest.
    """
    forces = grouped([run.level("force") for run in runs], SAME_FORCE * runs[0].spans["force"])
    periodic = [run.regular("pressure") for run in runs]
    frequencies = [float(f"{run.frequency('pressure'):.2g}") for run in runs]
    of_periodic = [f for f, regular in zip(frequencies, periodic, strict=True) if regular]
    slow = SLOWEST_SHARE * float(np.median(of_periodic or [0.0]))
    of_sines = sorted({f for f in of_periodic if f >= slow})

    result: list[Labels] = []
    for run, force, regular, frequency in zip(runs, forces, periodic, frequencies, strict=True):
        if not regular:
            highest = run.highest_frequency("pressure")
            nearest = min(of_sines, key=lambda f: abs(f - highest), default=round(highest, 2))
            labels = {"stage": "random", "force": force, "frequency": nearest}
        elif frequency < slow:
            labels = {"stage": "static", "force": force, "frequency": 0.0}
        else:
            labels = {"stage": "hysteresis", "force": force, "frequency": frequency}
        result.append(Labels("train" if regular else "test", labels))
    return result
