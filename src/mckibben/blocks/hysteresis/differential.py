"""Models with one hysteretic state z driven by the input: Bouc-Wen, generalized, and Duhem.

All are rate-independent and integrated in closed form, and their inverses are solved for.

Bouc-Wen in its normalised form, with a reversible polynomial P of x = (u - centre) / scale:
y = P(x) + weight z, dz/du = rate (1 - |z|^n [sigma sgn(z du) + 1 - sigma]). z lies within -1 and 1. In
the common form, z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n, it is A = rate D, beta = sigma rate
D^(1-n), gamma = (1 - sigma) rate D^(1-n) with z scaled by D, a number that data cannot identify.
Sources: Bouc 1967; Wen, "Method of random vibration of hysteretic systems", 1976; the normalised form is
that of Ikhouane and Rodellar, "Systems with Hysteresis", 2007.

Generalized, for asymmetric loops: dz/du = rate (1 - |z|^n psi),
psi = sgn(z du) + b2 sgn(x du) + b3 sgn(x z) + b4 sgn(du) + b5 sgn(z) + b6 sgn(x). The first of the six
shape numbers is 1, as the weight sets the size of z. Sources: Song and Der Kiureghian, "Generalized
Bouc-Wen model for highly asymmetric hysteresis", 2006; of pneumatic muscles: Schindele and Aschemann
2012.

Duhem in Coleman and Hodgdon's form, with polynomials: dy/dx = alpha sgn(dx) (f(x) - y) + g(x); f is the
curve that the output tends to, and g its slope right after a reversal. While the input goes one way the
equation is linear, with the particular solution P(x), a polynomial:
P_k = (s alpha f_k + g_k - (k + 1) P_{k+1}) / (s alpha), s the direction. Hence over any stretch
y = P(x) + (y_0 - P(x_0)) exp(-alpha |x - x_0|), exactly. Source: Coleman and Hodgdon, "A constitutive
relation for rate-independent hysteresis in ferromagnetically soft materials", 1986.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge
from numpy.typing import ArrayLike
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Start
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import Step, kernel, step
from mckibben.blocks.memoryless import least_slope, polynomial_at
from mckibben.blocks.solving import solved_inverse
from mckibben.errors import ModelError

Z, BEFORE = range(2)
"""Places of the state: hysteretic part (of a Duhem model the output), and previous input."""

RATE, CENTRE, SCALE, EXPONENT, WEIGHT, SHAPE = range(6)
"""Places of the coefficients: sigma, or b2 to b6, are from `SHAPE` on, then the polynomial."""

CURVES = 3
"""Place of the coefficients of P rising, P falling and f of a Duhem model, after its first three."""


def loop_kernels(
    moved: Callable[..., float], output: Callable[..., float], start: Start
) -> tuple[Step, Step, Start]:
    """Return the step of a model, and step and start of its inverse; the state is [z, input].

    The model gives two compiled functions: ``moved(u, coefficients, state)``, its memory after the input
    has gone on to u, and ``output(u, z, coefficients)``.
    """

    @kernel
    def advance(u: float, c: Array, state: Array) -> None:
        state[Z] = moved(u, c, state)
        state[BEFORE] = u

    @kernel
    def trial(u: float, memory: tuple[Array, Array]) -> float:
        c, state = memory
        return output(u, moved(u, c, state), c)

    @step
    def loop_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        """Advance the hysteretic state with the input; the state is [z, previous input]."""
        advance(inputs[0], coefficients, state)
        outputs[0] = output(inputs[0], state[Z], coefficients)

    return loop_step, *solved_inverse(trial, advance, start)


def many_peaks(model: Invertible) -> Array:
    """Return peaks over the whole range, as z has no thresholds."""
    return np.linspace(*model.input_limits, 33)


@kernel
def bouc_wen_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with z = 1, as after a long rise, or z = 0."""
    state[Z] = 0.0 if virgin else 1.0
    state[BEFORE] = inputs[0]


@kernel
def flow(v: float, tau: float, unloading: float, loading: float, n: int) -> float:
    """Return z along the direction of motion, v, after a monotonic input change ``tau``.

    With tau > 0 in units of the model's rate, dv/dtau = 1 - psi |v|^n; psi is ``unloading`` while v < 0,
    then ``loading``. For n = 1 the solutions are exponentials; for n = 2 they are tanh where psi > 0 and
    tan where psi < 0, by their addition formulas. No step size enters, so stretches add up exactly.
    Wants loading > 0 and unloading < 1 / |v|^n, so that v returns to zero and then stays bounded.
    """
    if v < 0.0:
        needed = way_to_zero(-v, unloading, n)
        if tau <= needed:
            return min(-shrunk(-v, tau, unloading, n), 0.0)
        v, tau = 0.0, tau - needed
    if n == 1:
        limit = 1.0 / loading
        return limit - (limit - v) * math.exp(-loading * tau)
    q = math.sqrt(loading)
    t = math.tanh(q * tau)
    return (v + t / q) / (1.0 + v * q * t)


@kernel
def way_to_zero(w: float, psi: float, n: int) -> float:
    """Return the input change after which w = |v| has decayed to zero."""
    if psi == 0.0:
        return w
    if n == 1:
        return -math.log1p(-psi * w) / psi
    q = math.sqrt(abs(psi))
    return math.atan(q * w) / q if psi < 0.0 else math.atanh(q * w) / q


@kernel
def shrunk(w: float, tau: float, psi: float, n: int) -> float:
    """Return w = |v| after the input change ``tau``."""
    if psi == 0.0:
        return w - tau
    if n == 1:
        grown = math.expm1(psi * tau)
        return w + grown * (w - 1.0 / psi)
    q = math.sqrt(abs(psi))
    if psi < 0.0:
        t = math.tan(q * tau)
        return (w - t / q) / (1.0 + w * q * t)
    t = math.tanh(q * tau)
    return (w - t / q) / (1.0 - w * q * t)


@kernel
def bouc_wen_moved(u: float, c: Array, state: Array) -> float:
    """Return z after the input has moved to ``u``."""
    du = u - state[BEFORE]
    if du == 0.0:
        return state[Z]
    up = 1.0 if du > 0.0 else -1.0
    return up * flow(up * state[Z], abs(c[RATE] * du), 1.0 - 2.0 * c[SHAPE], 1.0, int(c[EXPONENT]))


@kernel
def bouc_wen_output(u: float, z: float, c: Array) -> float:
    """Return the output of a hysteretic state."""
    x = (u - c[CENTRE]) / c[SCALE]
    return polynomial_at(x, c, SHAPE + 1, c.size - SHAPE - 1) + c[WEIGHT] * z


@dataclass(frozen=True, config=fields.STRICT)
class BoucWen(fields.WithMemory, Invertible):
    """Normalised Bouc-Wen model with a reversible polynomial.

    Parameters
    ----------
    polynomial : sequence of float
        Ascending coefficients of the reversible part, at least one; two for the classical model.
    weight : float
        Output per z; negative where the output lags the input, as a muscle's displacement lags
        pressure.
    rate : float
        How fast z moves with the input, per input; positive.
    sigma : float
        Shape of the loop, at least 0.5: the part of the decay that changes sign with the direction.
    exponent : {1, 2}
        n; how sharply z saturates.
    centre, scale : float
        Of the input in the polynomial; scale positive.
    input_range : (float, float), optional
        Lowest and highest input; the inverse needs it and clips there.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample, z = 1 or virgin z = 0.
    """

    kind = "bouc-wen"
    solved, inverse_memory, n_states = True, "input", 2
    peaks = many_peaks
    start_kernel = bouc_wen_start
    kernel, inverse_kernel, inverse_start_kernel = loop_kernels(
        bouc_wen_moved, bouc_wen_output, bouc_wen_start
    )
    parameters = ("polynomial", "weight", "rate", "sigma")
    layout = ("rate", "centre", "scale", "exponent", "weight", "sigma", "polynomial")
    typical = ((14.0, 16.0, -1.0, -1.0), -2.5, 1.2, 0.7, 1, 2.5, 2.5, (0.0, 5.0))
    formulas = (
        r"y = \sum_k c_k x^k + w z,\quad x = \frac{u - m}{s}",
        r"\frac{dz}{du} = \rho \left(1 - |z|^n \left[\sigma \operatorname{sgn}(z\, du) + "
        r"1 - \sigma\right]\right)",
    )

    polynomial: Annotated[fields.PolynomialField, "c_k from 0 [{y}]"]
    weight: Annotated[FiniteFloat, "w [{y}]"]
    rate: Annotated[fields.Positive, r"\rho [1/{u}]"]
    sigma: Annotated[FiniteFloat, Ge(0.5), r"\sigma"]
    exponent: Literal[1, 2] = 1
    centre: Annotated[FiniteFloat, "m [{u}]"] = 0.0
    scale: Annotated[fields.Positive, "s [{u}]"] = 1.0
    input_range: fields.InputRange | None = None

    def least_slope(self) -> float:
        steepest = self.rate * max(1.0, 2.0 * self.sigma)
        reversible = least_slope(self.polynomial, self.centre, self.scale, self.input_limits)
        return reversible + min(0.0, self.weight * steepest)


@kernel
def psi_of(going: float, z: float, side: float, c: Array) -> float:
    """Return psi for directions of motion, of the hysteretic state and of the input, 1 or -1."""
    b = c[SHAPE : SHAPE + 5]
    return going * z + b[0] * side * going + b[1] * side * z + b[2] * going + b[3] * z + b[4] * side


@kernel
def stretched(z: float, du: float, side: float, c: Array) -> float:
    """Return z after an input change ``du`` on one side of the centre."""
    if du == 0.0:
        return z
    up = 1.0 if du > 0.0 else -1.0
    loading, unloading = psi_of(up, up, side, c), psi_of(up, -up, side, c)
    return up * flow(up * z, abs(c[RATE] * du), unloading, loading, int(c[EXPONENT]))


@kernel
def generalized_moved(u: float, c: Array, state: Array) -> float:
    """Return z after the input has moved to ``u``."""
    z, before, centre = state[Z], state[BEFORE], c[CENTRE]
    if (before - centre) * (u - centre) < 0.0:
        z = stretched(z, centre - before, 1.0 if before > centre else -1.0, c)
        before = centre
    return stretched(z, u - before, 1.0 if before + u > 2.0 * centre else -1.0, c)


@kernel
def generalized_output(u: float, z: float, c: Array) -> float:
    """Return the output of a hysteretic state."""
    x = (u - c[CENTRE]) / c[SCALE]
    return polynomial_at(x, c, SHAPE + 5, c.size - SHAPE - 5) + c[WEIGHT] * z


@dataclass(frozen=True, config=fields.STRICT)
class GeneralizedBoucWen(fields.WithMemory, Invertible):
    """Generalized Bouc-Wen model with a reversible polynomial.

    Parameters
    ----------
    polynomial : sequence of float
        Ascending coefficients of the reversible part, at least one; two for the classical model.
    weight : float
        Output per z; negative where the output lags the input, as a muscle's displacement lags
        pressure.
    rate : float
        How fast z moves with the input, per input; positive.
    shape : sequence of float, length 5
        b2 to b6; their sizes may add up to less than 1, which keeps z bounded and lets it return.
    exponent : {1, 2}
        n; how sharply z saturates.
    centre, scale : float
        Of the input in the polynomial; scale positive.
    input_range : (float, float), optional
        Lowest and highest input; the inverse needs it and clips there.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample, z = 1 or virgin z = 0.
    """

    kind = "generalized-bouc-wen"
    solved, inverse_memory, n_states = True, "input", 2
    peaks = many_peaks
    start_kernel = bouc_wen_start
    kernel, inverse_kernel, inverse_start_kernel = loop_kernels(
        generalized_moved, generalized_output, bouc_wen_start
    )
    parameters = ("polynomial", "weight", "rate", "shape")
    layout = ("rate", "centre", "scale", "exponent", "weight", "shape", "polynomial")
    typical = (
        *((14.0, 16.0, -1.0, -1.0), -0.9, 1.2, (0.1, -0.1, 0.15, 0.05, -0.1)),
        *(1, 2.5, 2.5, (0.0, 5.0)),
    )
    formulas = (
        r"y = \sum_k c_k x^k + w z,\quad x = \frac{u - m}{s}",
        r"\frac{dz}{du} = \rho \left(1 - |z|^n \psi\right)",
        r"\psi = \operatorname{sgn}(z\,du) + b_2 \operatorname{sgn}(x\,du) + b_3 "
        r"\operatorname{sgn}(x z) + b_4 \operatorname{sgn}(du) + b_5 "
        r"\operatorname{sgn}(z) + b_6 \operatorname{sgn}(x)",
    )

    polynomial: Annotated[fields.PolynomialField, "c_k from 0 [{y}]"]
    weight: Annotated[FiniteFloat, "w [{y}]"]
    rate: Annotated[fields.Positive, r"\rho [1/{u}]"]
    shape: Annotated[fields.Vector, "b_k from 2"]
    exponent: Literal[1, 2] = 1
    centre: Annotated[FiniteFloat, "m [{u}]"] = 0.0
    scale: Annotated[fields.Positive, "s [{u}]"] = 1.0
    input_range: fields.InputRange | None = None

    def __post_init__(self) -> None:
        if len(self.shape) != 5 or not np.abs(self.shape).sum() < 1:
            raise ModelError(
                f"that of {self.kind!r} is {self.shape}",
                parameter="shape",
                remedy="give five numbers whose sizes add up to less than 1",
            )

    @property
    def bound(self) -> float:
        """Bound of |z|: its limit at the smallest psi of loading."""
        signs = [(s * g, s * g, g, g, s) for s in (1, -1) for g in (1, -1)]
        smallest = 1.0 + min(float(np.dot(self.shape, sign)) for sign in signs)
        return float(smallest ** (-1.0 / self.exponent))

    @property
    def steepest(self) -> float:
        """Largest slope of z by the input."""
        asymmetry = float(np.abs(self.shape).sum())
        return self.rate * (1.0 + (1.0 + asymmetry) * self.bound**self.exponent)

    def least_slope(self) -> float:
        reversible = least_slope(self.polynomial, self.centre, self.scale, self.input_limits)
        slopes = 2.0 * self.rate - self.steepest, self.steepest
        return reversible + min(*(self.weight * slope for slope in slopes), 0.0)


@kernel
def duhem_moved(u: float, c: Array, state: Array) -> float:
    """Return the output after the input has moved to ``u``.

    Coefficients are [alpha, centre, scale, P rising, P falling, f].
    """
    y, before = state[Z], state[BEFORE]
    if u == before:
        return y
    size = (c.size - CURVES) // 3
    first = CURVES if u > before else CURVES + size
    x, x0 = (u - c[CENTRE]) / c[SCALE], (before - c[CENTRE]) / c[SCALE]
    kept = math.exp(-c[RATE] * abs(x - x0))
    return polynomial_at(x, c, first, size) + (y - polynomial_at(x0, c, first, size)) * kept


@kernel
def duhem_output(u: float, y: float, c: Array) -> float:
    """Return the output, which is the hysteretic state."""
    return y


@kernel
def duhem_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start on the curve of monotonically risen inputs, or on f."""
    x = (inputs[0] - coefficients[CENTRE]) / coefficients[SCALE]
    size = (coefficients.size - CURVES) // 3
    state[Z] = polynomial_at(x, coefficients, CURVES + 2 * size if virgin else CURVES, size)
    state[BEFORE] = inputs[0]


def particular(alpha: float, target: ArrayLike, slope: ArrayLike, direction: float) -> Array:
    """Return P for input directions 1 or -1: polynomials with ascending coefficients."""
    f, g = np.atleast_1d(np.asarray(target, float)), np.atleast_1d(np.asarray(slope, float))
    size = max(f.size, g.size)
    f, g = np.pad(f, (0, size - f.size)), np.pad(g, (0, size - g.size))
    found = np.zeros(size + 1)
    for k in range(size - 1, -1, -1):
        found[k] = f[k] + (g[k] - (k + 1) * found[k + 1]) / (direction * alpha)
    return found[:size]


@dataclass(frozen=True, config=fields.STRICT)
class Duhem(fields.WithMemory, Invertible):
    """Duhem model with polynomial limit curve and polynomial slope.

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
        Default memory before the first sample: on the curve of inputs that have only risen, or on f.
    """

    kind = "duhem"
    solved, inverse_memory, n_states = True, "input", 2
    peaks = many_peaks
    start_kernel = duhem_start
    kernel, inverse_kernel, inverse_start_kernel = loop_kernels(
        duhem_moved, duhem_output, duhem_start
    )
    parameters = ("target", "slope", "alpha")
    typical = ((14.0, 16.0, -1.0), (12.0, -1.0), 1.5, 2.5, 2.5, (0.0, 5.0))
    formulas = (
        r"\frac{dy}{dx} = \alpha \operatorname{sgn}(dx) \left(f(x) - y\right) + "
        r"g(x),\quad x = \frac{u - m}{s}",
        r"f(x) = \sum_k f_k x^k,\quad g(x) = \sum_k g_k x^k",
    )

    target: Annotated[fields.PolynomialField, "f_k from 0 [{y}]"]
    slope: Annotated[fields.PolynomialField, "g_k from 0 [{y}]"]
    alpha: Annotated[fields.Positive, r"\alpha"]
    centre: Annotated[FiniteFloat, "m [{u}]"] = 0.0
    scale: Annotated[fields.Positive, "s [{u}]"] = 1.0
    input_range: fields.InputRange | None = None

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [alpha, centre, scale, P rising, P falling, f], padded to the length of P."""
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
