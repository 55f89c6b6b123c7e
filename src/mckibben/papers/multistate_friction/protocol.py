"""The isometric and isobaric tests of a fluidic muscle.

Source: A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical
Response of Pneumatic Artificial Muscles, Section 2: at held lengths the pressure rises (static force);
at held pressures of 1 to 6 bar the length is cycled (total force). Friction is identified at 4 bar.
"""

from __future__ import annotations

import numpy as np

from mckibben.recording import Recording
from mckibben.signals.excitations import irregular_triangle, triangle
from mckibben.signals.protocol import Protocol, Run

SAMPLE_TIME = 0.02
LENGTHS = {
    200.0: 0.0,
    198.0: 0.8,
    196.0: 1.2,
    194.0: 1.6,
    192.0: 1.9,
    190.0: 2.2,
    188.0: 2.4,
    186.0: 2.7,
    184.0: 3.0,
}
"""Held in the isometric tests [mm], and the pressure from which each starts, where the muscle is just
taut [bar]: below, it would move. Shorter ones go slack while their friction is being released."""

SHORTEST = {1.0: 198.2, 2.0: 194.2, 3.0: 189.7, 4.0: 185.0, 5.0: 180.5, 6.0: 176.5}
"""Where each isobaric cycle turns [mm], by pressure [bar]: just before the muscle goes slack."""

LONGEST = 200.0
SPEED = 2.0
"""Of the screw [mm/s]."""

CYCLES = 3
RISE = 60.0
"""Time in which the pressure rises to 6 bar [s]."""

SWINGS, SWING, SWING_PERIOD = 12, 12.0, 10.0
"""Before an isometric run the length swings at 6 bar, ever less, so that friction is left near zero:
number of swings, the first one's amplitude [mm], and their time [s]."""

VENTING = 10.0
"""Time in which the pressure then falls to the first one [s]."""

IDENTIFIED_AT = 4.0
"""Pressure whose loop identifies the friction [bar]."""


def multistate_friction() -> Protocol:
    """Return the isometric runs, the isobaric cycles, and one with minor loops."""
    runs = []
    lead = SWINGS * SWING_PERIOD + VENTING
    time = np.arange(round((lead + RISE) / SAMPLE_TIME) + 1) * SAMPLE_TIME
    swung = np.clip(1.0 - time / (SWINGS * SWING_PERIOD), 0.0, 1.0)
    swinging = SWING * swung * np.sin(2 * np.pi * time / SWING_PERIOD)
    for length, first in LENGTHS.items():
        rising = np.interp(time, (lead - VENTING, lead, lead + RISE), (6.0, first, 6.0))
        runs.append(
            Run(
                name=f"isometric-{length:.0f}mm",
                role="train",
                inputs=_inputs(rising, np.minimum(length + swinging, LONGEST)),
                settings={"start.length": length, "start.pressure": 6.0},
                labels={"stage": "static", "length": length},
                lead=lead,
            )
        )
    for pressure, shortest in SHORTEST.items():
        period = 2 * (LONGEST - shortest) / SPEED
        time = np.arange(round(CYCLES * period / SAMPLE_TIME) + 1) * SAMPLE_TIME
        gone = triangle(time, period, LONGEST - shortest)
        runs.append(_isobaric(f"isobaric-{pressure:.0f}bar", pressure, LONGEST - gone))
    shortest = SHORTEST[IDENTIFIED_AT]
    time = np.arange(round(120.0 / SAMPLE_TIME) + 1) * SAMPLE_TIME
    gone = irregular_triangle(time, 13, LONGEST - shortest, seed=4)
    runs.append(_isobaric("isobaric-minor-loops", IDENTIFIED_AT, LONGEST - gone, minor=True))
    return Protocol(
        name="multistate-friction",
        rig="mas10-test-stand",
        source="A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the "
        "Mechanical Response of Pneumatic Artificial Muscles, Section 2",
        runs=tuple(runs),
        notes="Lengths, speed and minor loops are ours: the paper prints none.",
    )


def _isobaric(name: str, pressure: float, length: np.ndarray, minor: bool = False) -> Run:
    identifies = pressure == IDENTIFIED_AT and not minor
    return Run(
        name=name,
        role="train" if identifies else "test",
        inputs=_inputs(np.full(length.size, pressure), length),
        settings={"start.pressure": pressure, "start.length": LONGEST},
        labels={"stage": "friction", "pressure": pressure},
    )


def _inputs(pressure: np.ndarray, length: np.ndarray) -> Recording:
    return Recording({"pressure": pressure, "length": length}, SAMPLE_TIME)
