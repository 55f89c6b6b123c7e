"""The isometric and isobaric tests of a fluidic muscle.

Source: A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical
Response of Pneumatic Artificial Muscles, Section 2: at held lengths the pressure rises (static force);
at held pressures of 1 to 6 bar the length is cycled (total force). Friction is identified at 4 bar.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.papers.recognising import Labels
from mckibben.recording import Recording
from mckibben.rigs import Rig, share
from mckibben.signals.excitations import irregular_triangle, triangle
from mckibben.signals.features import Features, grouped
from mckibben.signals.protocol import PlannedRun, Protocol, Role

SAMPLE_TIME, LONGEST, HIGHEST = 0.02, 200.0, 6.0
"""Time between samples [s]; length at rest [mm] and highest pressure [bar] of the paper's muscle."""

TAUT_PRESSURES = (0.0, 0.8, 1.2, 1.6, 1.9, 2.2, 2.4, 2.7, 3.0)
LENGTHS = dict(zip(np.arange(200.0, 183.0, -2.0).tolist(), TAUT_PRESSURES, strict=True))
"""Held in the isometric tests [mm], and the pressure from which each starts, where the muscle is just
taut [bar]: below, it would move. Shorter ones go slack while their friction is being released."""

SHORTEST = {1.0: 198.2, 2.0: 194.2, 3.0: 189.7, 4.0: 185.0, 5.0: 180.5, 6.0: 176.5}
"""Where each isobaric cycle turns [mm], by pressure [bar]: just before the muscle goes slack."""

IDENTIFIED_AT, SPEED, CYCLES = 4.0, 2.0, 3
"""Pressure whose loop identifies the friction [bar]; speed of the screw [mm/s], and cycles of a run."""

SWINGS, SWING, SWING_PERIOD = 12, 12.0, 10.0
"""Before an isometric run the length swings at the highest pressure, ever less, so that friction is left
near zero: number of swings, the first one's amplitude [mm], and their time [s]."""

VENTING, RISE = 10.0, 60.0
"""Times in which the pressure then falls to the first one, and rises again [s]."""


def multistate_friction(rig: Rig | None = None) -> Protocol:
    """Return the isometric runs, the isobaric cycles, and one with minor loops.

    On another test stand lengths are in proportion to its length at the start, pressures to its highest;
    one of less pressure contracts less, as far as the paper's muscle would at that pressure.
    """
    length_scale, pressure_scale = 1.0, 1.0
    if rig is not None:
        if "length" not in rig.inputs:
            remedy = "change a copy of the rig mas10-test-stand"
            problem = f"the rig {rig.name!r} does not impose it"
            raise DataError(problem, channel="length", remedy=remedy)
        length_scale = rig.start.get("length", rig.limits("length").high) / LONGEST
        pressure_scale = share(rig, "pressure", HIGHEST)
    runs = list[PlannedRun]()
    limited_pressure_scale = min(pressure_scale, 1.0)
    for kind, role, bars, lengths, lead_time in (
        *_isometric(limited_pressure_scale),
        *_isobaric(limited_pressure_scale),
    ):
        inputs = {"pressure": pressure_scale * bars, "length": length_scale * lengths}
        start = {f"start.{channel}": float(values[0]) for channel, values in inputs.items()}
        stage, held = ("static", "length") if lead_time else ("friction", "pressure")
        labels = {"stage": stage, held: start[f"start.{held}"]}
        name = kind.format(**{channel: values[-1] for channel, values in inputs.items()})
        runs.append(
            PlannedRun(name, role, Recording(inputs, SAMPLE_TIME), start, labels, lead_time)
        )
    return Protocol(
        name="multistate-friction",
        rig="mas10-test-stand",
        source="A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the "
        "Mechanical Response of Pneumatic Artificial Muscles, Section 2",
        runs=tuple(runs),
        notes="Lengths, speed and minor loops are ours: the paper prints none.",
    )


Planned = tuple[str, Role, Array, Array, float]
"""Name by its last pressure and length, role, pressures and lengths of the paper's muscle, lead time."""


def _isometric(limited_pressure_scale: float) -> Iterator[Planned]:
    """Yield the isometric runs of a stand whose pressure is that share of the paper's."""
    lead_time = SWINGS * SWING_PERIOD + VENTING
    time = _time(lead_time + RISE)
    swing_amplitude = SWING * np.clip(1.0 - time / (SWINGS * SWING_PERIOD), 0.0, 1.0)
    swinging = swing_amplitude * np.sin(2 * np.pi * time / SWING_PERIOD)
    depths = [LONGEST - length for length in LENGTHS]
    for first in LENGTHS.values():
        length = LONGEST - float(
            np.interp(limited_pressure_scale * first, [*LENGTHS.values()], depths)
        )
        rising = np.interp(
            time, (lead_time - VENTING, lead_time, lead_time + RISE), (HIGHEST, first, HIGHEST)
        )
        lengths = np.minimum(length + swinging, LONGEST)
        yield "isometric-{length:.4g}mm", "train", rising, lengths, lead_time


def _isobaric(limited_pressure_scale: float) -> Iterator[Planned]:
    """Yield the cycles at every pressure, and the minor loops."""
    turns = [0.0, *SHORTEST], [0.0, *(LONGEST - shortest for shortest in SHORTEST.values())]
    for bar in SHORTEST:
        depth = float(np.interp(limited_pressure_scale * bar, *turns))
        period = 2 * depth / SPEED
        shortening = triangle(_time(CYCLES * period), period, depth)
        role: Role = "train" if bar == IDENTIFIED_AT else "test"
        yield (
            "isobaric-{pressure:.3g}bar",
            role,
            np.full(shortening.size, bar),
            LONGEST - shortening,
            0.0,
        )
    depth = float(np.interp(limited_pressure_scale * IDENTIFIED_AT, *turns))
    shortening = irregular_triangle(_time(120.0), 13, depth, seed=4)
    held = np.full(shortening.size, IDENTIFIED_AT)
    yield "isobaric-minor-loops", "test", held, LONGEST - shortening, 0.0


def _time(duration: float) -> Array:
    return np.asarray(np.arange(round(duration / SAMPLE_TIME) + 1) * SAMPLE_TIME, dtype=float)


def recognised(runs: Sequence[Features]) -> list[Labels]:
    """Return stages by what moves; the friction is identified at two thirds of the highest pressure."""
    isometric = [run.moved("pressure") > run.moved("length") for run in runs]
    held_channels = ["length" if length_held else "pressure" for length_held in isometric]
    levels = [run.level(channel) for run, channel in zip(runs, held_channels, strict=True)]
    cycled = [k for k, run in enumerate(runs) if not isometric[k] and run.regular("length")]
    target = IDENTIFIED_AT / HIGHEST * max((levels[k] for k in cycled), default=0.0)
    training = min(cycled, key=lambda k: abs(levels[k] - target), default=None)
    tolerance = {channel: 0.02 * span for channel, span in runs[0].spans.items()}
    labels: list[Labels] = []
    for k, (length_held, channel) in enumerate(zip(isometric, held_channels, strict=True)):
        similar_levels = [
            level
            for level, other_channel in zip(levels, held_channels, strict=True)
            if other_channel == channel
        ]
        level = dict(zip(similar_levels, grouped(similar_levels, tolerance[channel]), strict=True))[
            levels[k]
        ]
        role: Role = "train" if length_held or k == training else "test"
        labels.append(
            Labels(role, {"stage": "static" if length_held else "friction", channel: level})
        )
    return labels
