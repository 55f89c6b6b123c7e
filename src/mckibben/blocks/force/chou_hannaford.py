"""Chou and Hannaford's static force law: the geometry of an inextensible braid.

f = p (3 l^2 - b^2) / (4 pi n^2), with the thread's length b and its number of turns n, plus friction or
elasticity as a constant. Source: Chou and Hannaford, "Measurement and modeling of McKibben pneumatic
artificial muscles", 1996.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel
from mckibben.blocks.fields import FORCE, LENGTH, PRESSURE, STRICT, ChannelField
from mckibben.blocks.force.braid_equilibrium import NEWTONS_PER_BAR
from mckibben.blocks.force.law import ForceLaw
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation


@step
def chou_hannaford_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [force per bar and square length, square of b / 3, constant]."""
    pull = inputs[0] * inputs[0] - coefficients[1]
    outputs[0] = inputs[1] * coefficients[0] * pull + coefficients[2]


@kernel
def chou_hannaford_terms(length: float, c: Array) -> tuple[float, float]:
    """Return force per pressure, and force without any."""
    return c[0] * (length * length - c[1]), c[2]


@dataclass(frozen=True, config=STRICT)
class ChouHannaford(ForceLaw):
    """Force of an inextensible braid.

    Parameters
    ----------
    thread_length : float
        b [mm], positive.
    turns : float
        n, positive.
    constant : float
        Added [N].
    input, pressure, output : Channel
        Length, pressure and force.
    """

    kind: ClassVar[str] = "chou-hannaford"
    kernel: ClassVar[Kernel] = chou_hannaford_step
    terms_kernel = chou_hannaford_terms
    parameters: ClassVar[tuple[str, ...]] = ("thread_length", "turns", "constant")
    notation: ClassVar[Notation] = Notation(
        r"f = p\, \frac{3 l^2 - b^2}{4 \pi n^2} + c",
        thread_length="b [mm]",
        turns="n",
        constant="c [N]",
        input="l",
        pressure="p",
        output="f",
    )

    thread_length: Annotated[FiniteFloat, Gt(0)]
    turns: Annotated[FiniteFloat, Gt(0)]
    constant: FiniteFloat = 0.0
    input: ChannelField = LENGTH
    pressure: ChannelField = PRESSURE
    output: ChannelField = FORCE

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [force per bar and square length, square of b / 3, constant]."""
        del sample_time
        per_bar = 3 * NEWTONS_PER_BAR / (4 * math.pi * self.turns**2)
        return np.array([per_bar, self.thread_length**2 / 3, self.constant])

    @classmethod
    def example(cls) -> Self:
        """Return a law for lengths of a few millimetres."""
        return cls(6.0, 0.5, -1.0)
