"""Compressed air: a proportional pressure regulator that fills and vents a muscle.

The flow through an opening is that of ISO 6358: choked below the critical pressure ratio, an ellipse
above, and a straight line where pressures are nearly equal. Filling and venting openings differ. The
valve follows its controller with a lag and not within a dead band; the chamber is the muscle, whose
room changes as it moves, and dead volume. Changes of state are polytropic.

Between regulator and muscle there may be a line. The flow through it is turbulent, so the pressure that
it takes grows with the square of the flow; what the regulator and its sensor feel is the pressure at
their own end.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mckibben.rigs.physics.compiled import ATMOSPHERE, compiled

LAMINAR_RATIO = 0.98
"""Ratio of pressures above which flow is taken as proportional to their difference."""

SUBSTEPS = 4
"""Air moves faster than muscles: substeps of every mechanical step."""

MM3_PER_LITRE = 1e6

FLOW_TOLERANCE = 1e-6
"""Between what goes through the valve and through the line [bar l/s]."""

MOST_ATTEMPTS = 60


AIR = np.dtype(
    [
        ("supply", "f8"),  # bar above the atmosphere
        ("fill", "f8"),  # l/(s bar)
        ("vent", "f8"),
        ("critical_ratio", "f8"),
        ("valve_time", "f8"),  # s
        ("gain", "f8"),  # 1/bar
        ("dead_band", "f8"),  # bar
        ("line", "f8"),  # resistance [s bar/l]; 0 is no line
        ("dead_room", "f8"),  # mm³
        ("polytropic", "f8"),
    ],
    align=True,
)
"""One regulator and its line, as the compiled physics reads it."""


@compiled
def flow(conductance: float, upstream: float, downstream: float, critical_ratio: float) -> float:
    """Return the flow through an opening [bar l/s] between absolute pressures [bar]; never negative.

    ``conductance`` in l/(s bar), as ISO 6358 defines it.
    """
    ratio = downstream / upstream
    if ratio <= critical_ratio:
        return conductance * upstream
    if ratio >= 1.0:
        return 0.0
    width = 1.0 - critical_ratio
    if ratio < LAMINAR_RATIO:
        off = (ratio - critical_ratio) / width
        return conductance * upstream * math.sqrt(1.0 - off * off)
    off = (LAMINAR_RATIO - critical_ratio) / width
    return (
        conductance * upstream * math.sqrt(1.0 - off * off) * (1.0 - ratio) / (1.0 - LAMINAR_RATIO)
    )


@compiled
def valve_flow(air: Any, opening: float, pressure: float) -> float:
    """Return the flow into the muscle [bar l/s]; an opening above 0 fills, below 0 vents.

    What is open lets air through both ways.
    """
    inside = pressure + ATMOSPHERE
    outside = air.supply + ATMOSPHERE if opening > 0.0 else ATMOSPHERE
    conductance = air.fill * opening if opening > 0.0 else -air.vent * opening
    if outside > inside:
        return flow(conductance, outside, inside, air.critical_ratio)
    return -flow(conductance, inside, outside, air.critical_ratio)


@compiled
def line_flow(air: Any, outlet: float, pressure: float) -> float:
    """Return the flow into the muscle [bar l/s] from the pressure at the regulator's outlet [bar].

    It goes with the root of the difference of the squares of the absolute pressures, as a long
    pipe's does: an opening that never chokes.
    """
    near, far = outlet + ATMOSPHERE, pressure + ATMOSPHERE
    if near > far:
        return flow(1.0 / air.line, near, far, 0.0)
    return -flow(1.0 / air.line, far, near, 0.0)


@compiled
def through(air: Any, opening: float, pressure: float) -> tuple[float, float]:
    """Return the flow into the muscle [bar l/s], and the pressure at the regulator's outlet [bar].

    The valve's flow falls as that pressure rises and the line's grows: by false position.
    """
    if air.line == 0.0:
        return valve_flow(air, opening, pressure), pressure
    near, far = pressure, air.supply if opening > 0.0 else 0.0
    at_near = valve_flow(air, opening, near)
    at_far = valve_flow(air, opening, far) - line_flow(air, far, pressure)
    outlet = near
    for _ in range(MOST_ATTEMPTS):
        if abs(at_near) <= FLOW_TOLERANCE or at_near * at_far >= 0.0:
            break
        outlet = near - at_near * (far - near) / (at_far - at_near)
        excess = valve_flow(air, opening, outlet) - line_flow(air, outlet, pressure)
        if abs(excess) <= FLOW_TOLERANCE:
            break
        if excess * at_far < 0.0:
            near, at_near = far, at_far
        else:
            at_near *= 0.5
        far, at_far = outlet, excess
    return line_flow(air, outlet, pressure), outlet


@compiled
def valve_target(air: Any, command: float, pressure: float) -> float:
    """Return the valve opening commanded by the regulator, within -1 (vent) and 1 (fill)."""
    error = command - pressure
    if abs(error) <= air.dead_band:
        return 0.0
    error -= math.copysign(air.dead_band, error)
    return min(max(air.gain * error, -1.0), 1.0)
