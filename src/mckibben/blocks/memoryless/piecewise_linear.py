"""Memoryless monotone piecewise-linear block: a superposition of dead zones, and its exact inverse.

Straight between knots, continued straight beyond the first and the last. After a Prandtl-Ishlinskii
model it makes the modified Prandtl-Ishlinskii (MPI) model with an inverse of the same form.
"""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Kernel
from mckibben.blocks.fields import DISPLACEMENT, STRICT, ChannelField, Vector
from mckibben.blocks.kernels import step
from mckibben.blocks.memoryless.interpolation import check_increasing, interpolate
from mckibben.blocks.notation import Notation


@step
def piecewise_linear_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Interpolate; coefficients are [knots, values]."""
    n = coefficients.size // 2
    outputs[0] = interpolate(inputs[0], coefficients[:n], coefficients[n:])


@dataclass(frozen=True, config=STRICT)
class PiecewiseLinear(Block):
    """Straight lines between knots.

    Parameters
    ----------
    knots : sequence of float, length K >= 2
        Inputs where lines meet, increasing.
    values : sequence of float, length K
        Outputs there, increasing.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "piecewise-linear"
    kernel: ClassVar[Kernel] = piecewise_linear_step
    increasing = ("knots", "values")
    parameters: ClassVar[tuple[str, ...]] = ("values",)
    notation: ClassVar[Notation] = Notation(
        r"y = v_k + (v_{k+1} - v_k) \frac{u - \xi_k}{\xi_{k+1} - \xi_k},\quad \xi_k \le u "
        r"\le \xi_{k+1}",
        knots=r"\xi_k [{u}]",
        values="v_k [{y}]",
    )

    knots: Vector
    values: Vector
    input: ChannelField = DISPLACEMENT
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        check_increasing(f"{self.kind} block", self.knots, self.values)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [knots, values]."""
        del sample_time
        return np.array([*self.knots, *self.values])

    def inverse(self) -> PiecewiseLinear:
        """Return the block with knots and values exchanged."""
        return PiecewiseLinear(self.values, self.knots, self.output, self.input)

    @classmethod
    def example(cls) -> Self:
        """Return a saturating curve."""
        return cls((0.0, 5.0, 15.0, 25.0), (0.0, 8.0, 20.0, 24.0))
