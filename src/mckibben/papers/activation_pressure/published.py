"""The data profile as printed.

Source: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and
Particle Swarm Optimization", Tables 1 and 2.
"""

from __future__ import annotations

from mckibben.blocks.force.activation import ActivationPressure

CONTRACTIONS = (
    *(-4.33e-9, 3.58e-6, -1.11e-3, 1.33e-1),
    *(-1.99e-9, 8.70e-7, -4.50e-4, 2.04e-1),
    *(-4.78e-9, 3.74e-6, -1.01e-3, 5.48e-2),
    *(6.98e-9, -3.03e-6, -3.61e-4, 3.03e-1),
)
"""Cubics of the force [N] for e_1 to e_4, Table 1, rows 1 to 4."""

PRESSURES_MPA = (
    *(-2.85e-9, 1.19e-6, 3.86e-4, 6.48e-2),
    *(-4.89e-9, -1.41e-7, 1.30e-3, 9.46e-2),
    *(3.96e-10, -1.84e-7, 2.53e-5, 2.77e-2),
    *(7.40e-11, 7.25e-8, -2.91e-5, 3.91e-1),
)
"""The same for y_1 to y_4 [MPa], rows 5 to 8."""

PHI_KPA = (-2.19e-6, 9.55e-4, -9.42e-3, 35.1)
"""Cubic of the force [kPa s], Table 2, row 10."""

GAMMA = (0.267, 0.667)
"""Slope [1/Hz] and constant, Table 2, row 9."""

BAR_PER_MPA, BAR_PER_KPA = 10.0, 0.01


def activation_pressure() -> ActivationPressure:
    """Return the paper's model at 1 Hz; set `frequency` for others (0.5 to 2 Hz)."""
    return ActivationPressure(
        contractions=CONTRACTIONS,
        pressures=tuple(BAR_PER_MPA * value for value in PRESSURES_MPA),
        phi=tuple(BAR_PER_KPA * value for value in PHI_KPA),
        gamma=GAMMA,
        frequency=1.0,
        frequency_range=(0.5, 2.0),
    )
