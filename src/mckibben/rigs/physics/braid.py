"""Braid geometry: area and volume.

The threads of the braid are inextensible, so that diameter and length go together. The pull is the
pressure times the change of volume with contraction (Chou and Hannaford 1996), in the form of Tondu
and Lopez (2000) with a factor for the end caps, where the muscle is not a cylinder:

    pull = p A [a (1 - k e)² - b],   a = 3/tan²(angle),   b = 1/sin²(angle),   A = pi (diameter/2)²

Below 54.7° braid angle a > b and the muscle pulls (contractile); above, it pushes (extensor).

At low pressure the bladder first has to reach the braid: what acts is p - c (1 - exp(-p/c)), c the
contact pressure. In a muscle that a load keeps narrower than at rest, the braid is on the bladder
anyway, and all of p acts. Pull and room come from one potential, so that no closed cycle makes work
of nothing.
"""

from __future__ import annotations

import math

from mckibben.rigs.physics.compiled import compiled

NEUTRAL_ANGLE = math.degrees(math.atan(math.sqrt(2.0)))
"""Braid angle at which a muscle neither pulls nor pushes [degrees]."""


def braid_constants(angle: float) -> tuple[float, float]:
    """Return a and b of a braid angle [degrees]."""
    radians = math.radians(angle)
    return 3.0 / math.tan(radians) ** 2, 1.0 / math.sin(radians) ** 2


@compiled
def braid_area(
    area: float, a: float, b: float, end_cap: float, length: float, x: float
) -> tuple[float, float]:
    """Return the change of volume with shortening ``x`` [mm²], and its own change with ``x`` [mm]."""
    rest = 1.0 - end_cap * x / length
    return area * (a * rest * rest - b), -2.0 * area * a * end_cap * rest / length


@compiled
def braid_volume(area: float, a: float, b: float, end_cap: float, length: float, x: float) -> float:
    """Return the volume gained since rest [mm³], the integral of `braid_area`."""
    rest = 1.0 - end_cap * x / length
    return area * (a * length * (1.0 - rest * rest * rest) / (3.0 * end_cap) - b * x)


@compiled
def unfolded(gained: float, width: float) -> tuple[float, float, float]:
    """Return the part of a gained volume that stretches the bladder [mm³], and slopes.

    All of it when the muscle is wider than at rest, none when it is narrower, counted from rest; the
    change from one to the other takes ``width`` [mm³].
    """
    root = math.sqrt(gained * gained + width * width)
    return (
        0.5 * (gained + root - width),
        0.5 * (1.0 + gained / root),
        0.5 * width * width / (root * root * root),
    )


@compiled
def acting_pressure(pressure: float, contact: float) -> tuple[float, float, float]:
    """Return the pressure on the braid [bar], its slope, and the slope's slope [1/bar].

    Below the atmosphere the bladder leaves the braid, and nothing does.
    """
    if pressure <= 0.0:
        return 0.0, 0.0, 0.0
    if contact <= 0.0:
        return pressure, 1.0, 0.0
    missing = math.exp(-pressure / contact)
    return pressure - contact * (1.0 - missing), 1.0 - missing, missing / contact
