"""Coupling gains of Table 3 as printed.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Table 3.
"""

from __future__ import annotations

from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.fields import Channel


def coupling() -> Coupling:
    """Return the gains: row i is what muscle i gives to muscles 1, 2 and 3.

    Eq. (30) prints the transpose, which multiplies v: h_1 = v_1 + 0.1521 v_2 + 0.5368 v_3.
    """
    channels = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2, 3))
    gains = ((1.0, 0.1124, 0.0356), (0.1521, 1.0, 0.2153), (0.5368, 0.6321, 1.0))
    return Coupling(gains, channels, channels)
