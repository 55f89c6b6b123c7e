"""Bladder elasticity: a rubber tube that follows the braid.

A Mooney-Rivlin tube of constant volume (Rivlin and Saunders 1951), stretched by 1 - e along the axis
and round it by as much as the braid opens. Near the length where the threads lie along the axis the
tube is squeezed without limit, which is what stops a muscle from being pulled any longer.
"""

from __future__ import annotations

from mckibben.rigs.physics.compiled import compiled


@compiled
def bladder_force(
    c10: float, c01: float, cos2: float, sin2: float, length: float, x: float
) -> tuple[float, float]:
    """Return the tube's resistance to shortening by ``x`` [N], and its slope [N/mm].

    ``c10`` and ``c01`` are the two constants times the volume of rubber [N mm]; ``cos2`` and ``sin2``
    are of the braid angle at rest.
    """
    axial = 1.0 - x / length
    s = axial * axial
    tilt = cos2 / sin2
    q = (1.0 - s * cos2) / sin2  # square of the stretch round the axis
    g = s * q
    slope = q - tilt * s
    bend = -2.0 * tilt
    first = 1.0 - tilt - slope / (g * g)
    second = -1.0 / (s * s) + tilt / (q * q) + slope
    first_slope = -bend / (g * g) + 2.0 * slope * slope / (g * g * g)
    second_slope = 2.0 / (s * s * s) + 2.0 * tilt * tilt / (q * q * q) + bend
    change = c10 * first + c01 * second
    change_slope = c10 * first_slope + c01 * second_slope
    return (
        -2.0 * axial / length * change,
        (2.0 * change + 4.0 * s * change_slope) / (length * length),
    )
