"""Memoryless polynomial block, y = sum_k c_k ((u - centre) / scale)^k, and its inverse.

After a Prandtl-Ishlinskii model it makes the modified Prandtl-Ishlinskii (MPI) model of
"High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model", Eq. (5), where centre is 0 and scale is 1.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel, Start
from mckibben.blocks.fields import DISPLACEMENT, STRICT, ChannelField, Coefficients, Initial
from mckibben.blocks.inverse import Invertible, check_input_range, nothing_clipped
from mckibben.blocks.kernels import DERIVED, SLACK, improved, kernel, step
from mckibben.blocks.notation import Notation, summed
from mckibben.errors import ModelError


@kernel
def horner(c: Array, x: float) -> float:
    """Return the polynomial with ascending coefficients ``c`` at ``x``."""
    y = 0.0
    for k in range(c.size - 1, -1, -1):
        y = y * x + c[k]
    return y


@step
def polynomial_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [centre, scale, ascending polynomial coefficients]."""
    x = (inputs[0] - coefficients[0]) / coefficients[1]
    outputs[0] = horner(coefficients[2:], x)


@kernel
def _value(x: float, c: Array) -> float:
    return horner(c, x)


@step
def polynomial_inverse_step(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Invert an increasing polynomial by Newton's method kept inside a shrinking bracket.

    Coefficients are [centre, scale, lowest, highest argument, ascending coefficients]; the state is
    the count of samples clipped. Ends when the bracket or the step cannot shrink any further.
    """
    centre, scale, lowest, highest = (
        coefficients[0],
        coefficients[1],
        coefficients[2],
        coefficients[3],
    )
    c = coefficients[4:]
    bottom, top = horner(c, lowest), horner(c, highest)
    slack = SLACK * (top - bottom)
    y = inputs[0]
    low, high = lowest, highest
    if not bottom < y < top:
        if y < bottom - slack or y > top + slack:
            state[0] += 1.0
        outputs[0] = centre + scale * (low if y <= bottom else high)
        return
    x = 0.5 * (low + high)
    for _ in range(200):
        error = horner(c, x) - y
        if error == 0.0:
            break
        if error > 0.0:
            high = x
        else:
            low = x
        slope = 0.0
        for k in range(c.size - 1, 0, -1):
            slope = slope * x + k * c[k]
        candidate = x - error / slope if slope > 0.0 else low
        if not low < candidate < high:
            candidate = 0.5 * (low + high)
        if candidate in (x, low, high):
            break
        x = candidate
    if DERIVED:
        x = improved(_value, y, x, c)
    outputs[0] = centre + scale * x


@dataclass(frozen=True, config=STRICT)
class Polynomial(Invertible):
    """Polynomial of a centred and scaled input.

    Parameters
    ----------
    polynomial : sequence of float
        Coefficients in ascending powers, at least one.
    centre : float
        Input that becomes argument 0.
    scale : float
        Input per argument; positive.
    input_range : (float, float), optional
        Where the polynomial holds; its inverse wants it to increase there, and clips there.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "polynomial"
    kernel: ClassVar[Kernel] = polynomial_step
    inverse_kernel: ClassVar[Kernel] = polynomial_inverse_step
    inverse_start_kernel: ClassVar[Start] = nothing_clipped
    parameters: ClassVar[tuple[str, ...]] = ("polynomial",)
    notation: ClassVar[Notation] = Notation(
        r"y = \sum_{k} c_k x^k,\quad x = \frac{u - m}{s}",
        polynomial="c_k from 0 [{y}]",
        centre="m [{u}]",
        scale="s [{u}]",
    )

    polynomial: Coefficients
    centre: FiniteFloat = 0.0
    scale: Annotated[FiniteFloat, Gt(0)] = 1.0
    input_range: tuple[FiniteFloat, FiniteFloat] | None = None
    input: ChannelField = DISPLACEMENT
    output: ChannelField = DISPLACEMENT

    initial: ClassVar[Initial] = "first_sample"

    def __post_init__(self) -> None:
        check_input_range(self.kind, self.input_range)
        if not self.polynomial:
            raise ModelError("a polynomial without coefficients. Remedy: give at least one.")

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [centre, scale, polynomial]."""
        del sample_time
        return np.array([self.centre, self.scale, *self.polynomial])

    def check_invertible(self) -> None:
        """Demand an input range over which the polynomial increases."""
        if self.input_range is None:
            raise ModelError(
                "'polynomial' has no inverse without an input range. Remedy: give input_range."
            )
        low, high = self._arguments()
        slope = np.polynomial.Polynomial(self.polynomial).deriv()
        turns = np.asarray(slope.deriv().roots(), dtype=np.complex128)
        slopes = slope(np.array([low, high, *turns.real[turns.imag == 0].clip(low, high)]))
        if slopes.min() < -1e-12 * np.abs(slopes).max() or slopes.max() <= 0:
            raise ModelError(
                "'polynomial' has no inverse: it does not increase over its whole input range. Remedy: "
                "identify it with --set output_map=piecewise-linear or monotone=true."
            )

    def inverse_numbers(self, own: Array) -> Array:
        """Return [centre, scale, lowest, highest argument, polynomial]."""
        return np.array([*own[:2], *self._arguments(), *own[2:]])

    def _arguments(self) -> tuple[float, float]:
        low, high = self.input_limits
        return (low - self.centre) / self.scale, (high - self.centre) / self.scale

    def worked(self) -> tuple[str, ...]:
        """Return the polynomial with its numbers."""
        powers = ["", "x", *(f"x^{{{k}}}" for k in range(2, len(self.polynomial)))]
        return (f"y = {summed(list(zip(self.polynomial, powers, strict=False)))}",)

    @classmethod
    def example(cls) -> Self:
        """Return a cubic that increases over 0 to 10."""
        return cls((12.0, 20.0, 3.0, -4.0), 5.0, 5.0, (0.0, 10.0))
