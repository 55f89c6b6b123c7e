"""The Prandtl-Ishlinskii model of a Festo MAS-20-200N muscle lifting 20 kg, over 1.0 to 5.5 bar.

Source: "Analysis and modeling of a pneumatic artificial muscle system", Eqs. (12), (13), (16) and
(17): x = p_0 v + sum_{i=1..7} p_i F_{r_i}[v], with v the pressure.

Only the shape of the loop is meant: the paper scales x to each measured displacement afterwards (an
affine match, whose printed numbers are not usable), so x has no unit here. Put an `Affine` block
behind it to scale it to a muscle.
"""

from __future__ import annotations

from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.fields import PRESSURE, Channel
from mckibben.blocks.hysteresis.pi import PI

THRESHOLDS = (0.0, 0.3392, 0.6654, 0.9917, 1.3179, 1.6442, 1.9704)
"""r_1 to r_7 [bar], Eq. (16)."""

WEIGHTS = (0.3067, 0.1146, 0.0895, 0.0673, 0.0673, 0.0455, 0.0261, 0.0034)
"""p_0 to p_7 [1/bar], Eq. (17)."""

INPUT_RANGE = (1.0, 5.5)
"""Lowest and highest pressure of the experiment [bar], Section 3.1."""


def prandtl_ishlinskii() -> PI:
    """Return the paper's model from pressure [bar] to displacement before scaling [-].

    The reversible term p_0 v is a play operator without dead zone, and so is the first operator
    (r_1 = 0): their weights are one here.
    """
    reversible, first, *others = WEIGHTS
    return PI(
        THRESHOLDS,
        (reversible + first, *others),
        input_range=INPUT_RANGE,
        input=PRESSURE,
        output=Channel("unscaled_displacement", ""),
    )


def process_model() -> ProcessModel:
    """Return the paper's P2UZ model from pressure [bar] to displacement before scaling [-], Eq. (11)."""
    return ProcessModel(
        gain=6.7987,
        time_constants=(5.7018,),
        damping=9.1096,
        zero_time=156.3105,
        input_offset=INPUT_RANGE[0],
        input=PRESSURE,
        output=Channel("unscaled_displacement", ""),
    )
