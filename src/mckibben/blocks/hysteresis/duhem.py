"""Duhem model (Coleman and Hodgdon's form) with polynomials, and its inverse.

dy/dx = alpha sgn(dx) (f(x) - y) + g(x),  x = (u - centre) / scale,

with polynomials f, the curve that the output tends to, and g, its slope right after a reversal.
Source: Coleman and Hodgdon, "A constitutive relation for rate-independent hysteresis in
ferromagnetically soft materials", 1986; the class of models is Duhem's.

While the input goes one way the equation is linear, with the particular solution P(x), a
polynomial: P_k = (s alpha f_k + g_k - (k + 1) P_{k+1}) / (s alpha), s the direction. Hence over any
stretch y = P(x) + (y_0 - P(x_0)) exp(-alpha |x - x_0|), exactly.
"""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from annotated_types import Gt
from numpy.typing import ArrayLike
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.fields import (
    DISPLACEMENT,
    PRESSURE,
    STRICT,
    ChannelField,
    StoredInitial,
)
from mckibben.blocks.hysteresis.differential import loop_kernels
from mckibben.blocks.inverse import Invertible, check_input_range
from mckibben.blocks.kernels import kernel
from mckibben.blocks.memoryless.reversible import Reversible, polynomial_at
from mckibben.blocks.notation import Notation


@kernel
def _moved(u: float, c: Array, state: Array) -> float:
    """Return the output after the input has gone on to ``u``.

    Coefficients are [alpha, centre, scale, P rising, P falling, f].
    """
    y, before = state[0], state[1]
    if u == before:
        return y
    size = (c.size - 3) // 3
    first = 3 if u > before else 3 + size
    x, x0 = (u - c[1]) / c[2], (before - c[1]) / c[2]
    kept = math.exp(-c[0] * abs(x - x0))
    return polynomial_at(x, c, first, size) + (y - polynomial_at(x0, c, first, size)) * kept


@kernel
def _output(u: float, y: float, c: Array) -> float:
    """Return the memory: it is the output."""
    return y


@kernel
def duhem_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start on the curve of inputs that have only risen, or on f."""
    x = (inputs[0] - coefficients[1]) / coefficients[2]
    size = (coefficients.size - 3) // 3
    state[0] = polynomial_at(x, coefficients, 3 + 2 * size if virgin else 3, size)
    state[1] = inputs[0]


def particular(alpha: float, target: ArrayLike, slope: ArrayLike, direction: float) -> Array:
    """Return P for the directions 1 or -1 of the input: all polynomials by ascending coefficients."""
    f, g = np.atleast_1d(np.asarray(target, float)), np.atleast_1d(np.asarray(slope, float))
    size = max(f.size, g.size)
    f, g = np.pad(f, (0, size - f.size)), np.pad(g, (0, size - g.size))
    found = np.zeros(size + 1)
    for k in range(size - 1, -1, -1):
        found[k] = f[k] + (g[k] - (k + 1) * found[k + 1]) / (direction * alpha)
    return found[:size]


@dataclass(frozen=True, config=STRICT)
class Duhem(Invertible):
    """Duhem model with a polynomial to tend to and a polynomial slope.

    Parameters
    ----------
    target : sequence of float
        Ascending coefficients of f, in the unit of the output; at least one.
    slope : sequence of float
        Ascending coefficients of g, output per scaled input; at least one.
    alpha : float
        How fast the output tends to f, per scaled input; positive.
    centre, scale : float
        Of the input; scale positive.
    input_range : (float, float), optional
        Lowest and highest input; the inverse needs it and clips there.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: on the curve of inputs that have only risen, or on
        f.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "duhem"
    solved = True
    inverse_remembers = "input"
    n_states = 2
    start_kernel = duhem_start
    kernel, inverse_kernel, inverse_start_kernel = loop_kernels(_moved, _output, duhem_start)
    parameters = ("target", "slope", "alpha")
    notation = Notation(
        r"\frac{dy}{dx} = \alpha \operatorname{sgn}(dx) \left(f(x) - y\right) + "
        r"g(x),\quad x = \frac{u - m}{s}",
        r"f(x) = \sum_k f_k x^k,\quad g(x) = \sum_k g_k x^k",
        target="f_k from 0 [{y}]",
        slope="g_k from 0 [{y}]",
        alpha=r"\alpha",
        centre="m [{u}]",
        scale="s [{u}]",
    )

    target: Reversible
    slope: Reversible
    alpha: Annotated[FiniteFloat, Gt(0)]
    centre: FiniteFloat = 0.0
    scale: Annotated[FiniteFloat, Gt(0)] = 1.0
    input_range: tuple[FiniteFloat, FiniteFloat] | None = None
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        check_input_range(self.kind, self.input_range)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [alpha, centre, scale, P rising, P falling, f], filled up to as many numbers as P."""
        del sample_time
        up, down = (particular(self.alpha, self.target, self.slope, way) for way in (1.0, -1.0))
        filled = [0.0] * (up.size - len(self.target))
        return np.array([self.alpha, self.centre, self.scale, *up, *down, *self.target, *filled])

    def least_slope(self) -> float:
        """Return a lower bound of the slope of the output by the input, on loops within the range.

        The output stays between the curves that it tends to when rising and when falling.
        """
        x = (np.linspace(*self.input_limits, 201) - self.centre) / self.scale
        value = np.polynomial.polynomial.polyval
        f, g = value(x, self.target), value(x, self.slope)
        ends = [value(x, particular(self.alpha, self.target, self.slope, s)) for s in (1.0, -1.0)]
        low, high = np.minimum(*ends), np.maximum(*ends)
        rising, falling = self.alpha * (f - high) + g, -self.alpha * (f - low) + g
        return float(min(rising.min(), falling.min())) / self.scale

    def peaks(self) -> Array:
        """Return peaks spread over the input range."""
        return np.linspace(*self.input_limits, 33)

    @classmethod
    def example(cls) -> Self:
        """Return a loop over 0 to 5 bar that saturates."""
        return cls((14.0, 16.0, -1.0), (12.0, -1.0), 1.5, 2.5, 2.5, (0.0, 5.0))
