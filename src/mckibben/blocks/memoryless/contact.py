"""Contact: the pressure that acts, once the bladder has met the braid, and its inverse.

y = u - c k (1 - exp(-u / c)), and odd: small pressures act little, as long as they only fill the bladder
towards the braid, large ones as if less by c k. Of the dead zone that is left, k, a twentieth of every
pressure still acts, so that every output has one input.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel
from mckibben.blocks.fields import PRESSURE, STRICT, ChannelField, Initial
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import step
from mckibben.blocks.notation import Notation

LOST = 0.95
"""Share of the smallest pressures that does not act."""

MOST_STEPS = 60
"""Of Newton's method, which comes from above and needs four to eight."""

SETTLED = 1e-16
"""Relative step below which it has come."""

SINGLE = {"SETTLED": 1e-7}


@step
def contact_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [pressure]."""
    c = coefficients[0]
    u = inputs[0]
    lost = LOST * c * (1.0 - math.exp(-abs(u) / c))
    outputs[0] = u - lost if u >= 0.0 else u + lost


@step
def contact_inverse_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Undo it: the root of a convex rising function."""
    c = coefficients[0]
    goal = abs(inputs[0])
    u = goal + LOST * c
    for _ in range(MOST_STEPS):
        faded = LOST * math.exp(-u / c)
        step = (u - c * (LOST - faded) - goal) / (1.0 - faded)
        u -= step
        if step <= SETTLED * u:
            break
    u = max(u, 0.0)
    outputs[0] = u if inputs[0] >= 0.0 else -u


@dataclass(frozen=True, config=STRICT)
class Contact(Invertible):
    """Dead zone of small pressures.

    Parameters
    ----------
    pressure : float
        c, over which it fades, in the unit of the input; positive.
    input, output : Channel
        Channel driven, and what of it acts.
    """

    kind: ClassVar[str] = "contact"
    kernel: ClassVar[Kernel] = contact_step
    inverse_kernel: ClassVar[Kernel] = contact_inverse_step
    counts_clipped: ClassVar[bool] = False
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

    @classmethod
    def example(cls) -> Self:
        """Return a dead zone of an eighth of a bar."""
        return cls(0.125)
