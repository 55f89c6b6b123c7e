"""Contact: the pressure that acts, once the bladder has met the braid, and its inverse.

y = u - c k (1 - exp(-u / c)), and odd: small pressures act little, as long as they only fill the bladder
towards the braid, large ones as if less by c k. Of the dead zone that is left, k, a twentieth of every
pressure still acts, so that every output has one input.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.core.block import Kernel
from mckibben.blocks.core.fields import PRESSURE, STRICT, ChannelField, Initial, Rule
from mckibben.blocks.core.inverse import Invertible
from mckibben.blocks.core.kernels import kernel
from mckibben.blocks.core.notation import Notation
from mckibben.blocks.core.single_channel import Memoryless

LOST = 0.95
"""Share of the smallest pressures that does not act."""

MOST_STEPS = 60
"""Of Newton's method, which comes from above and needs four to eight."""


@kernel
def contact_kernel(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [pressure]."""
    c = coefficients[0]
    for t in range(inputs.shape[0]):
        u = inputs[t, 0]
        lost = LOST * c * (1.0 - math.exp(-abs(u) / c))
        outputs[t, 0] = u - lost if u >= 0.0 else u + lost


@kernel
def contact_inverse_kernel(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Undo it: the root of a convex rising function."""
    c = coefficients[0]
    for t in range(inputs.shape[0]):
        goal = abs(inputs[t, 0])
        u = goal + LOST * c
        for _ in range(MOST_STEPS):
            faded = LOST * math.exp(-u / c)
            step = (u - c * (LOST - faded) - goal) / (1.0 - faded)
            u -= step
            if step <= 1e-16 * u:
                break
        u = max(u, 0.0)
        outputs[t, 0] = u if inputs[t, 0] >= 0.0 else -u


@dataclass(frozen=True, config=STRICT)
class Contact(Memoryless, Invertible):
    """Dead zone of small pressures.

    Parameters
    ----------
    pressure : float
        c, over which it fades, in the unit of the input; positive.
    input, output : Channel
        Channel driven, and what of it acts.
    """

    kind: ClassVar[str] = "contact"
    kernel: ClassVar[Kernel] = contact_kernel
    inverse_kernel: ClassVar[Kernel] = contact_inverse_kernel
    parameters: ClassVar[tuple[str, ...]] = ("pressure",)
    initial: ClassVar[Initial] = "first_sample"
    notation: ClassVar[Notation] = Notation(
        r"y = u - \frac{19}{20}\, c \left(1 - e^{-|u| / c}\right) \operatorname{sgn} u",
        pressure="c [{u}]",
        output="y",
        input="u",
    )

    pressure: Annotated[FiniteFloat, Gt(0)]
    input: ChannelField = PRESSURE
    output: ChannelField = PRESSURE

    def inverse_start(self, first: Array, start: Rule) -> Array:
        """Return no state."""
        return np.empty(0)

    @classmethod
    def example(cls) -> Self:
        """Return a dead zone of an eighth of a bar."""
        return cls(0.125)
