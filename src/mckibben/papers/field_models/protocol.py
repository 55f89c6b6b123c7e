"""The experiments on a fluidic muscle with a hanging mass.

Source: Analysis and modeling of a pneumatic artificial muscle system, Sections 2.1 and 3.1: a 0.1 Hz
triangle whose amplitude falls each cycle, from 5.5 bar over 1.0 bar, to calibrate; a triangle with
irregular turning points to test.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.papers.recognising import Labels
from mckibben.recording import Recording
from mckibben.rigs import Rig, share
from mckibben.signals.excitations import irregular_triangle, triangle
from mckibben.signals.features import Features
from mckibben.signals.protocol import PlannedRun, Protocol, Role

SAMPLE_TIME = 0.02
PERIOD = 10.0
LOW, HIGH = 1.0, 5.5
PEAKS = tuple(np.linspace(HIGH, 1.5, 9).tolist())
"""Of each cycle [bar]; the paper shows them in its Figure 2 only."""

RANGE = 6.0
"""Highest pressure of the rig [bar]."""

TURNS, SEED = 17, 5
"""Turning points of the irregular triangle, and what they are drawn with."""


def field_models(rig: Rig | None = None) -> Protocol:
    """Return both runs; on another rig, pressures in proportion to its highest."""
    pressure_share = share(rig, "pressure", RANGE)
    time = np.arange(round(PERIOD * len(PEAKS) / SAMPLE_TIME) + 1) * SAMPLE_TIME
    falling = triangle(time, PERIOD, (*PEAKS, LOW), LOW)
    irregular = irregular_triangle(time, TURNS, HIGH, LOW, seed=SEED)
    return Protocol(
        name="field-models",
        rig="mas20-hanging",
        source="Analysis and modeling of a pneumatic artificial muscle system, Sections 2.1 and 3.1",
        runs=(
            _run("decaying-triangle", "train", pressure_share * falling),
            _run("irregular-triangle", "test", pressure_share * irregular),
        ),
        notes="Peaks and turning points are ours: the paper shows them in a figure only.",
    )


def _run(name: str, role: Role, wave: Array) -> PlannedRun:
    start = {"start.pressure": float(wave[0])}
    return PlannedRun(name, role, Recording({"pressure": wave}, SAMPLE_TIME), start)


def recognised(runs: Sequence[Features]) -> list[Labels]:
    """Return which run calibrates, by cycles of equal times, and which tests, by irregular ones."""
    roles: list[Role] = ["train" if run.regular("pressure") else "test" for run in runs]
    if len({*roles}) == 1:  # signals of other shapes, told apart by their names, or their order
        roles = [run.hint or ("test" if k else "train") for k, run in enumerate(runs)]
    return [Labels(role, {}) for role in roles]
