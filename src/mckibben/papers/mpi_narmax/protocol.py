"""The experiments on a muscle on a rail under an external force.

Source: High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model, Sections 2.2, 2.3 and 4: sines of 0.05 to 0.22 Hz between 0.1 and 10 V, without load,
with weights, and while a hand pulls three times; slow pulls at held voltages. Beside
these, runs of our own in which voltage and force vary at random, so that models are tested on motion
that training does not repeat.
"""

from __future__ import annotations

import numpy as np

from mckibben.recording import Recording
from mckibben.signals.broadband import random_wave
from mckibben.signals.excitations import sine, triangle
from mckibben.signals.loads import pulls, ramps
from mckibben.signals.protocol import Protocol, Role, Run

SAMPLE_TIME = 0.001
LOW, HIGH = 0.1, 10.0
"""Dead zone of the regulator and highest voltage [V]."""

TIME = 60.0
"""Of each run [s], but for those at 0.05 Hz."""

WEIGHT = 91.0
"""Constant load of Figure 2 [N]."""

GRAVITY = 9.81
HELD = (2.0, 4.0, 6.0, 8.0, 10.0)
"""Voltages held while the force is cycled [V]; the paper shows them in its Figure 3 only."""

RAMP, PULLED_FROM, HELD_CYCLE = 10.0, 20.0, 20.0
"""Time to the held voltage, time at which the force begins, and time of its cycles [s]."""

RANDOM: tuple[tuple[str, Role, int], ...] = (
    ("random-1", "train", 1),
    ("random-2", "train", 2),
    ("random-3", "test", 3),
)
"""Runs in which everything is random, their roles and seeds."""

FASTEST = 0.2
"""Frequency of random voltages and forces [Hz]."""

STRONGEST = 200.0
"""Force of random runs [N]: what status 3 carries."""


def mpi_narmax() -> Protocol:
    """Return statuses 1 to 4, the training pulls, the runs of Figures 1 to 3, and random ones."""
    runs = [
        _moving("status-1", "train", 0.1, status=1),
        _moving("status-2", "train", 0.2, mass=10.04, status=2),
        _moving("status-3", "train", 0.2, mass=21.75, status=3),
        _moving("training-pulls-100N", "train", 0.1, hand=100.0, stage="coupling"),
        _moving("status-4", "test", 0.22, hand=150.0, status=4),
    ]
    for frequency in (0.05, 0.1, 0.2):
        runs += [
            _moving(f"free-{frequency:g}Hz", "train", frequency, stage="figure"),
            _moving(
                f"weight-{frequency:g}Hz", "test", frequency, mass=WEIGHT / GRAVITY, stage="figure"
            ),
            _moving(f"hand-{frequency:g}Hz", "test", frequency, hand=100.0, stage="figure"),
        ]
    time = np.arange(round(TIME / SAMPLE_TIME)) * SAMPLE_TIME
    for volt in HELD:
        # From the lowest voltage on, so that a model knows how the muscle came there.
        channels = {
            "voltage": ramps(time, (0.0, RAMP), (LOW, volt)),
            "force": np.where(time < PULLED_FROM, 0.0, triangle(time, HELD_CYCLE, 150.0)),
        }
        runs.append(
            Run(
                name=f"held-{volt:g}V",
                role="test",
                inputs=Recording(channels, SAMPLE_TIME),
                labels={"stage": "force", "voltage": volt},
            )
        )
    for name, role, seed in RANDOM:
        channels = {
            "voltage": random_wave(time, FASTEST, HIGH, LOW, seed=seed),
            "force": random_wave(time, FASTEST, STRONGEST, seed=100 + seed),
        }
        runs.append(Run(name, role, Recording(channels, SAMPLE_TIME), labels={"stage": "random"}))
    return Protocol(
        name="mpi-narmax",
        rig="rail",
        source="High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle "
        "Using 3D PI-NARMAX Model, Sections 2 and 4",
        runs=tuple(runs),
        notes="How long and how the hand pulls is ours: the paper gives the peaks, and three pulls. So "
        "are the random runs.",
    )


def _moving(
    name: str,
    role: Role,
    frequency: float,
    mass: float = 0.0,
    hand: float = 0.0,
    **labels: object,
) -> Run:
    duration = max(TIME, 4 / frequency)
    time = np.arange(round(duration / SAMPLE_TIME)) * SAMPLE_TIME
    return Run(
        name=name,
        role=role,
        inputs=Recording(
            {
                "voltage": sine(time, 1 / frequency, HIGH, LOW),
                "force": pulls(time, hand, n_pulls=3, duration=duration / 6),
            },
            SAMPLE_TIME,
        ),
        settings={"payload": round(mass, 6)},
        labels={"frequency": frequency, "mass": mass, "hand": hand, **labels},
    )
