"""Models of Section 4 as printed: static force and friction.

Source: "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the
Mechanical Response of Pneumatic Artificial Muscles", Tables 1 and 2.
"""

from __future__ import annotations

from mckibben.blocks.force.laws import PolynomialForce
from mckibben.blocks.force.multistate_friction import ELEVEN, MultistateFriction


def static_force() -> PolynomialForce:
    """Return the bilinear-quadratic law, Eq. (3) and Table 1: a_1 + a_3 l, and a_0 + a_2 l + a_4 l^2."""
    return PolynomialForce(per_bar=(-136.6, 1.176), elastic=(7596.0, -93.14, 0.2758))


def multistate_friction() -> MultistateFriction:
    """Return the friction at 4 bar, Eqs. (4) to (6) and Table 2, in mm instead of m."""
    return MultistateFriction(
        elements=ELEVEN,
        values=(
            *(18.214, 4.987e-3, 128.795, 3.982e-3, 103.096),
            *(34.738, 1.006e-3, 13.431, 0.100e-3, 0.988e-3, 1.256),
        ),
        reference_pressure=4.0,
    )
