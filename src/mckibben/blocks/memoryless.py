"""Blocks without memory: lines, polynomials, piecewise-linear maps, logarithms and contact dead zone.

Each rises or falls with its input, so each has an exact inverse, most of the same form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.inverse import Invertible, nothing_clipped
from mckibben.blocks.kernels import DERIVED, SLACK, improved, inlined, kernel, step
from mckibben.blocks.solving import newton
from mckibben.errors import ModelError

# -- lines -----------------------------------------------------------------------------------


@step
def affine_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Scale and shift; coefficients are [gain, offset]."""
    outputs[0] = coefficients[0] * inputs[0] + coefficients[1]


@dataclass(frozen=True, config=fields.STRICT)
class Affine(Block):
    """Gain and offset, y = gain u + offset.

    It scales a unit-free model to a muscle in "Analysis and modeling of a pneumatic artificial muscle
    system", Eq. (1).

    Parameters
    ----------
    gain : float
        Output per input; not zero where an inverse is wanted.
    offset : float
        Output at zero input.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "affine"
    kernel = affine_step
    is_linear = True
    parameters = ("gain", "offset")
    typical = (6.8, -1.5)
    formulas = ("y = K u + y_0",)

    gain: Annotated[FiniteFloat, "K [{y}/{u}]"]
    offset: Annotated[FiniteFloat, "y_0 [{y}]"] = 0.0
    input: fields.ChannelField = fields.DISPLACEMENT
    output: fields.ChannelField = fields.DISPLACEMENT

    def inverse(self) -> Affine:
        if self.gain == 0:
            raise ModelError(
                "'affine' of gain 0 has no inverse", remedy="give a gain that is not 0"
            )
        return Affine(1 / self.gain, -self.offset / self.gain, self.output, self.input)


@step
def negative_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Change the sign; there are no coefficients."""
    outputs[0] = -inputs[0]


@dataclass(frozen=True, config=fields.STRICT)
class Negative(Block):
    """y = -u, for outputs that decrease with the input, such as a muscle's length.

    Parameters
    ----------
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "negative"
    kernel = negative_step
    is_linear = True
    typical = ()
    formulas = ("y = -u",)

    input: fields.ChannelField = fields.DISPLACEMENT
    output: fields.ChannelField = fields.DISPLACEMENT

    def inverse(self) -> Negative:
        return Negative(self.output, self.input)


# -- straight pieces -------------------------------------------------------------------------


@kernel
def interpolate(x: float, knots: Array, values: Array) -> float:
    """Return the piecewise-linear function at ``x``, extrapolated beyond the knots."""
    low = 0
    high = knots.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x < knots[middle]:
            high = middle
        else:
            low = middle
    slope = (values[high] - values[low]) / (knots[high] - knots[low])
    if x - knots[low] < knots[high] - x:
        return values[low] + slope * (x - knots[low])
    return values[high] - slope * (knots[high] - x)


@step
def piecewise_linear_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Interpolate; coefficients are [knots, values]."""
    n = coefficients.size // 2
    outputs[0] = interpolate(inputs[0], coefficients[:n], coefficients[n:])


@dataclass(frozen=True, config=fields.STRICT)
class PiecewiseLinear(Block):
    """Piecewise-linear function with extrapolation.

    After a Prandtl-Ishlinskii model it makes the modified one (MPI).

    Parameters
    ----------
    knots : sequence of float, length K >= 2
        Inputs where lines meet, increasing.
    values : sequence of float, length K
        Outputs there, increasing.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "piecewise-linear"
    kernel = piecewise_linear_step
    increasing = same_length = ("knots", "values")
    parameters = ("values",)
    layout = ("knots", "values")
    typical = ((0.0, 5.0, 15.0, 25.0), (0.0, 8.0, 20.0, 24.0))
    formulas = (
        r"y = v_k + (v_{k+1} - v_k) \frac{u - \xi_k}{\xi_{k+1} - \xi_k},\quad \xi_k \le u "
        r"\le \xi_{k+1}",
    )

    knots: Annotated[fields.Knots, r"\xi_k [{u}]"]
    values: Annotated[fields.Vector, "v_k [{y}]"]
    input: fields.ChannelField = fields.DISPLACEMENT
    output: fields.ChannelField = fields.DISPLACEMENT

    def inverse(self) -> PiecewiseLinear:
        return PiecewiseLinear(self.values, self.knots, self.output, self.input)


# -- polynomials -----------------------------------------------------------------------------


@kernel
def horner(x: float, c: Array) -> float:
    """Return the polynomial with ascending coefficients ``c`` at ``x``."""
    y = 0.0
    for k in range(c.size - 1, -1, -1):
        y = y * x + c[k]
    return y


@inlined
def horner_slope(x: float, value: float, c: Array) -> float:
    """Return its derivative."""
    slope = 0.0
    for k in range(c.size - 1, 0, -1):
        slope = slope * x + k * c[k]
    return slope


@kernel
def polynomial_at(x: float, coefficients: Array, first: int, size: int) -> float:
    """Return the polynomial whose ascending coefficients start at ``first``."""
    return horner(x, coefficients[first : first + size])


def least_slope(
    polynomial: Sequence[float], centre: float, scale: float, limits: tuple[float, float]
) -> float:
    """Return the least derivative by the input over a range of inputs."""
    low, high = ((end - centre) / scale for end in limits)
    return float(np.min(slopes_at(polynomial, low, high))) / scale


def slopes_at(polynomial: Sequence[float], low: float, high: float) -> Array:
    """Return a polynomial's slopes at both ends of a range and at their extrema."""
    slope = np.polynomial.Polynomial(polynomial).deriv()
    turns = np.asarray(slope.deriv().roots(), dtype=np.complex128)
    return np.asarray(
        slope(np.array([low, high, *turns.real[np.abs(turns.imag) < 1e-9].clip(low, high)]))
    )


CENTRE, SCALE = range(2)
"""Places of the first coefficients of a polynomial."""


@step
def polynomial_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [centre, scale, ascending polynomial coefficients]."""
    outputs[0] = horner((inputs[0] - coefficients[CENTRE]) / coefficients[SCALE], coefficients[2:])


@step
def polynomial_inverse_step(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Invert an increasing polynomial; the state is the count of samples clipped.

    Coefficients are [centre, scale, lowest, highest argument, ascending coefficients].
    """
    low, high, c = coefficients[2], coefficients[3], coefficients[4:]
    bottom, top = horner(low, c), horner(high, c)
    y, slack = inputs[0], SLACK * (top - bottom)
    if not bottom < y < top:
        if y < bottom - slack or y > top + slack:
            state[0] += 1.0
        outputs[0] = coefficients[CENTRE] + coefficients[SCALE] * (low if y <= bottom else high)
        return
    x = newton(horner, horner_slope, y, low, high, 0.5 * (low + high), 0.0, c)
    if DERIVED:
        x = improved(horner, y, x, c)
    outputs[0] = coefficients[CENTRE] + coefficients[SCALE] * x


@dataclass(frozen=True, config=fields.STRICT)
class Polynomial(Invertible):
    """Polynomial of a centred and scaled input.

    After a Prandtl-Ishlinskii model it makes the modified one (MPI) of "High-Precision Displacement and
    Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D PI-NARMAX Model", Eq. (5), where centre
    is 0 and scale is 1.

    Parameters
    ----------
    polynomial : sequence of float
        Coefficients in ascending powers, at least one.
    centre : float
        Input that becomes argument 0.
    scale : float
        Input per argument; positive.
    input_range : (float, float), optional
        Where the polynomial holds; its inverse requires that it increases there, and clips there.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "polynomial"
    kernel = polynomial_step
    inverse_kernel = polynomial_inverse_step
    inverse_start_kernel = nothing_clipped
    parameters = ("polynomial",)
    layout = ("centre", "scale", "polynomial")
    typical = ((12.0, 20.0, 3.0, -4.0), 5.0, 5.0, (0.0, 10.0))
    formulas = (r"y = \sum_{k} c_k x^k,\quad x = \frac{u - m}{s}",)

    polynomial: Annotated[fields.PolynomialField, "c_k from 0 [{y}]"]
    centre: Annotated[FiniteFloat, "m [{u}]"] = 0.0
    scale: Annotated[fields.Positive, "s [{u}]"] = 1.0
    input_range: fields.InputRange | None = None
    input: fields.ChannelField = fields.DISPLACEMENT
    output: fields.ChannelField = fields.DISPLACEMENT

    def check_invertible(self) -> None:
        if self.input_range is None:
            raise ModelError(
                "'polynomial' has no inverse without it",
                parameter="input_range",
                remedy="give the lowest and highest input",
            )
        slopes = slopes_at(self.polynomial, *self._arguments())
        if slopes.min() < -1e-12 * np.abs(slopes).max() or slopes.max() <= 0:
            raise ModelError(
                "'polynomial' has no inverse: it does not increase over its whole input range",
                remedy="identify it with `settings[output_map]=polynomial`, which increases",
            )

    def inverse_numbers(self, own: Array) -> Array:
        """Return [centre, scale, lowest, highest argument, polynomial]."""
        return np.array([*own[:2], *self._arguments(), *own[2:]])

    def _arguments(self) -> tuple[float, float]:
        low, high = self.input_limits
        return (low - self.centre) / self.scale, (high - self.centre) / self.scale


# -- logarithm and exponential ---------------------------------------------------------------

FLOOR = 0.05
"""Value of u + offset below which the logarithm is continued by its tangent."""


@step
def logarithm_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Evaluate; coefficients are [offset]."""
    x = inputs[0] + coefficients[0]
    outputs[0] = math.log(x) if x > FLOOR else math.log(FLOOR) + (x - FLOOR) / FLOOR


@step
def exponential_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Invert the logarithm; coefficients are [offset]."""
    y = inputs[0]
    bend = math.log(FLOOR)
    x = math.exp(y) if y > bend else FLOOR + (y - bend) * FLOOR
    outputs[0] = x - coefficients[0]


@dataclass(frozen=True, config=fields.STRICT)
class Raised(Block):
    """A logarithm of a shifted input, or its inverse."""

    parameters = ("offset",)
    typical = (0.5,)

    offset: Annotated[FiniteFloat, "c [{u}]"] = 0.0
    input: fields.ChannelField = fields.PRESSURE
    output: fields.ChannelField = fields.PRESSURE


@dataclass(frozen=True, config=fields.STRICT)
class Logarithm(Raised):
    """Logarithm of a shifted input.

    Friction in a muscle grows in proportion to pressure, so play operators of constant threshold belong
    on the logarithm of pressure: a large offset makes the thresholds constant in the pressure itself,
    offset 0 makes them proportional to it.

    Parameters
    ----------
    offset : float
        Added to the input, in its unit.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "logarithm"
    kernel = logarithm_step
    formulas = (r"y = \ln(u + c)",)

    def inverse(self) -> Block:
        return Exponential(self.offset, self.output, self.input)


@dataclass(frozen=True, config=fields.STRICT)
class Exponential(Raised):
    """Inverse of a `Logarithm`.

    Parameters
    ----------
    offset : float
        Taken off the exponential.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "exponential"
    kernel = exponential_step
    formulas = ("y = e^{u} - c",)

    offset: Annotated[FiniteFloat, "c [{y}]"] = 0.0

    def inverse(self) -> Block:
        return Logarithm(self.offset, self.output, self.input)


# -- contact ---------------------------------------------------------------------------------

LOST = 0.95
"""Share of the smallest pressures without effect; so that the map remains invertible."""

MOST_STEPS = 60
"""Maximum number of Newton steps; four to eight are needed."""

SETTLED = 1e-16
"""Relative step at which Newton's method has converged."""

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
    """Invert the contact dead zone: the root of a convex increasing function."""
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


@dataclass(frozen=True, config=fields.STRICT)
class Contact(Invertible):
    """Dead zone at small pressures, which only press the bladder against the braid.

    Large pressures act as if less by about c.

    Parameters
    ----------
    pressure : float
        c, over which it fades, in the unit of the input; positive.
    input, output : Channel
        Channel driven, and what of it acts.
    """

    kind = "contact"
    kernel = contact_step
    inverse_kernel = contact_inverse_step
    counts_clipped = False
    parameters = ("pressure",)
    typical = (0.125,)
    formulas = (r"y = u - \frac{19}{20}\, c \left(1 - e^{-|u| / c}\right) \operatorname{sgn} u",)

    pressure: Annotated[fields.Positive, "c [{u}]"]
    input: Annotated[fields.ChannelField, "u"] = fields.PRESSURE
    output: Annotated[fields.ChannelField, "y"] = fields.PRESSURE
