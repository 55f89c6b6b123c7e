"""The modified Prandtl-Ishlinskii model of a muscle on a rail without load, driven by voltage.

Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using
3D PI-NARMAX Model", Eqs. (2) to (5) and Table 1, identified at 0.1 Hz. The table counts the
coefficients downwards, from b^9 to b^0: so the paper's input gives loops of 1.6 to 48 mm. Read upwards
from b^1, as Eq. (5) is written, it gives 10^5 mm. The map turns at |b| = 4.134 (48.8 mm) and falls
beyond, where the weights by rate lift b at 0.2 Hz: the model has no inverse.
"""

from __future__ import annotations

from mckibben.blocks.compose import Series
from mckibben.blocks.fields import DISPLACEMENT, Channel
from mckibben.blocks.hysteresis.pi import RateDependentPI
from mckibben.blocks.memoryless import Polynomial

THRESHOLDS = (0.0, 0.0101, 0.0296, 0.2596, 0.4318, 0.8309, 1.6003, 1.9544, 3.9537, 4.95)
BY_RATE = (3.5838, -3.8779, 0.3084, 0.1117, -0.0887, -0.0033, -0.0116, -0.0208, -0.0429, 0.0315)
WEIGHTS = (-0.3435, 0.643, -0.1711, 0.1878, -0.0425, 0.0359, 0.046, 0.0461, -0.0298, 0.0698)
"""r_i [V]; k_i [s/V^2], b per volt of input and volt per second of its rate; d_i [1/V]."""

POLYNOMIAL = (-8.97e-4, 0.0, 0.0411, 0.0, -0.6712, 0.0, 4.4945, 0.0, 2.3917, 0.0)
"""a_i [mm], in descending powers, b^9 to b^0."""

TURNING_POINT = 4.1343
"""The least positive b at which that polynomial turns."""


def modified_prandtl_ishlinskii() -> Series:
    """Return the paper's model from voltage (0 to 10 V) to displacement [mm]; it starts virgin, at 0."""
    u, b = Channel("voltage", "V"), Channel("hysteresis", "")
    pi = RateDependentPI(THRESHOLDS, BY_RATE, WEIGHTS, 0.0, 0.0, (0.0, 10.0), "virgin", u, b)
    return Series((pi, Polynomial(POLYNOMIAL[::-1], input=b, output=DISPLACEMENT)))
