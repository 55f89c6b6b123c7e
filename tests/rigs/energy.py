"""What is stored in a bladder, against which its force is checked."""

from __future__ import annotations


def bladder_energy(
    c10: float, c01: float, cos2: float, sin2: float, length: float, x: float
) -> float:
    """Return the energy stored since rest [N mm]; the force of the bladder is its slope."""
    s = (1.0 - x / length) ** 2
    q = (1.0 - s * cos2) / sin2
    return c10 * (s + q + 1.0 / (s * q) - 3.0) + c01 * (1.0 / s + 1.0 / q + s * q - 3.0)
