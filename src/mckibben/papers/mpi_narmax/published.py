"""The modified Prandtl-Ishlinskii model of a muscle on a rail without load, driven by voltage.

Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using
3D PI-NARMAX Model", Eqs. (2) to (5) and Table 1: b = sum_i (k_i v + d_i) F_{r_i}[u] with u the
voltage and v its rate, then the displacement as a polynomial of b.

The table counts the polynomial's coefficients downwards, from b^9 to b^0: so the paper's excitation
gives loops of 1.6 to 48 mm. Read upwards from b^1, as Eq. (5) is written, it gives 10^5 mm.

The map folds: it turns at |b| = 4.134, at 48.8 mm, and falls beyond. At 0.05 and 0.1 Hz the paper's
excitation stays below; at 0.2 Hz the weights by rate lift b to 4.148, and the displacement falls while
the voltage still rises. So the model has no inverse, and is not one to be driven faster than it was
identified. It is printed for 0.1 Hz; at other rates it extrapolates.
"""

from __future__ import annotations

from mckibben.blocks.compose import Series
from mckibben.blocks.fields import DISPLACEMENT, Channel
from mckibben.blocks.hysteresis.pi import RateDependentPI
from mckibben.blocks.memoryless import Polynomial

THRESHOLDS = (0.0, 0.0101, 0.0296, 0.2596, 0.4318, 0.8309, 1.6003, 1.9544, 3.9537, 4.95)
"""r_i [V]."""

RATE_WEIGHTS = (
    3.5838,
    -3.8779,
    0.3084,
    0.1117,
    -0.0887,
    -0.0033,
    -0.0116,
    -0.0208,
    -0.0429,
    0.0315,
)
"""k_i [s/V^2], b per volt of input and volt per second of its rate."""

WEIGHTS = (-0.3435, 0.643, -0.1711, 0.1878, -0.0425, 0.0359, 0.046, 0.0461, -0.0298, 0.0698)
"""d_i [1/V]."""

POLYNOMIAL = (-8.97e-4, 0.0, 0.0411, 0.0, -0.6712, 0.0, 4.4945, 0.0, 2.3917, 0.0)
"""a_i [mm], in descending powers, b^9 to b^0."""

TURNING_POINT = 4.1343
"""The least positive b at which that polynomial turns."""

INPUT_RANGE = (0.0, 10.0)
"""Range of the pressure regulator valve [V], Section 2.2."""


def modified_prandtl_ishlinskii() -> Series:
    """Return the paper's model from voltage [V] to displacement [mm]; it needs a sample time.

    It starts virgin, so that a muscle that was never driven starts near 0 mm.
    """
    hysteresis = Channel("hysteresis", "")
    return Series(
        (
            RateDependentPI(
                THRESHOLDS,
                RATE_WEIGHTS,
                WEIGHTS,
                input_range=INPUT_RANGE,
                initial="virgin",
                input=Channel("voltage", "V"),
                output=hysteresis,
            ),
            Polynomial(POLYNOMIAL[::-1], input=hysteresis, output=DISPLACEMENT),
        )
    )
