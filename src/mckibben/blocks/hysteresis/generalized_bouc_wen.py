"""Generalised (asymmetric) Bouc-Wen model with a reversible polynomial, and its inverse.

y = P(x) + weight z,  x = (u - centre) / scale,
dz/du = rate (1 - |z|^n psi),
psi = sgn(z du) + b2 sgn(x du) + b3 sgn(x z) + b4 sgn(du) + b5 sgn(z) + b6 sgn(x).

The first of the six shape numbers is 1: it only sets the size of z, which the weight sets too. Each
of the eight combinations of signs has a psi of its own, so the loop need not be symmetric.

Source: Song and Der Kiureghian, "Generalized Bouc-Wen model for highly asymmetric hysteresis",
2006; of pneumatic muscles: Schindele and Aschemann 2012.

z moves with the input, whatever its pace: the model is rate-independent, and for n = 1 and n = 2,
the exponents offered, it is integrated in closed form, in two pieces where the input passes the
centre.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.fields import (
    DISPLACEMENT,
    PRESSURE,
    STRICT,
    ChannelField,
    StoredInitial,
    Vector,
)
from mckibben.blocks.hysteresis.differential import bouc_wen_start, flow, loop_kernels
from mckibben.blocks.inverse import Invertible, check_input_range
from mckibben.blocks.kernels import kernel
from mckibben.blocks.memoryless.reversible import Reversible, least_slope, polynomial_at
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError


@kernel
def _psi(going: float, z: float, side: float, c: Array) -> float:
    return (
        going * z + c[6] * side * going + c[7] * side * z + c[8] * going + c[9] * z + c[10] * side
    )


@kernel
def _stretch(z: float, du: float, side: float, c: Array) -> float:
    """Return z after the input has moved by ``du`` on one side of the centre."""
    if du == 0.0:
        return z
    up = 1.0 if du > 0.0 else -1.0
    loading, unloading = _psi(up, up, side, c), _psi(up, -up, side, c)
    return up * flow(up * z, abs(c[0] * du), unloading, loading, int(c[1]))


@kernel
def _moved(u: float, c: Array, state: Array) -> float:
    """Return z after the input has gone on to ``u``.

    Coefficients are [rate, n, weight, centre, scale, 1, b2 to b6, polynomial].
    """
    z, before, centre = state[0], state[1], c[3]
    if (before - centre) * (u - centre) < 0.0:
        z = _stretch(z, centre - before, 1.0 if before > centre else -1.0, c)
        before = centre
    return _stretch(z, u - before, 1.0 if before + u > 2.0 * centre else -1.0, c)


@kernel
def _output(u: float, z: float, c: Array) -> float:
    return polynomial_at((u - c[3]) / c[4], c, 11, c.size - 11) + c[2] * z


@dataclass(frozen=True, config=STRICT)
class GeneralizedBoucWen(Invertible):
    """Generalised Bouc-Wen model with a reversible polynomial.

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
        Default memory before the first sample: z = 1, or z = 0.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "generalized-bouc-wen"
    solved = True
    inverse_remembers = "input"
    n_states = 2
    start_kernel = bouc_wen_start
    kernel, inverse_kernel, inverse_start_kernel = loop_kernels(_moved, _output, bouc_wen_start)
    parameters = ("polynomial", "weight", "rate", "shape")
    notation = Notation(
        r"y = \sum_k c_k x^k + w z,\quad x = \frac{u - m}{s}",
        r"\frac{dz}{du} = \rho \left(1 - |z|^n \psi\right)",
        r"\psi = \operatorname{sgn}(z\,du) + b_2 \operatorname{sgn}(x\,du) + b_3 "
        r"\operatorname{sgn}(x z) + b_4 \operatorname{sgn}(du) + b_5 "
        r"\operatorname{sgn}(z) + b_6 \operatorname{sgn}(x)",
        polynomial="c_k from 0 [{y}]",
        weight="w [{y}]",
        rate=r"\rho [1/{u}]",
        shape="b_k from 2",
        centre="m [{u}]",
        scale="s [{u}]",
    )

    polynomial: Reversible
    weight: FiniteFloat
    rate: Annotated[FiniteFloat, Gt(0)]
    shape: Vector
    exponent: Literal[1, 2] = 1
    centre: FiniteFloat = 0.0
    scale: Annotated[FiniteFloat, Gt(0)] = 1.0
    input_range: tuple[FiniteFloat, FiniteFloat] | None = None
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        check_input_range(self.kind, self.input_range)
        if len(self.shape) != 5 or not np.abs(self.shape).sum() < 1:
            raise ModelError(
                f"the shape of {self.kind!r} is {self.shape}. Remedy: give five numbers whose sizes add "
                "up to less than 1."
            )

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [rate, exponent, weight, centre, scale, 1, shape, polynomial]."""
        del sample_time
        head = [self.rate, self.exponent, self.weight, self.centre, self.scale, 1.0]
        return np.array([*head, *self.shape, *self.polynomial])

    def least_slope(self) -> float:
        """Return a lower bound of the slope of the output by the input."""
        away = (1.0 + self.asymmetry) * self.bound**self.exponent - 1.0
        shallowest = -self.rate * away
        reversible = least_slope(self.polynomial, self.centre, self.scale, self.input_limits)
        return reversible + min(self.weight * shallowest, self.weight * self.steepest, 0.0)

    @property
    def asymmetry(self) -> float:
        """Sum of the sizes of the shape numbers."""
        return float(np.abs(self.shape).sum())

    @property
    def steepest(self) -> float:
        """Largest slope of z by the input."""
        return self.rate * (1.0 + (1.0 + self.asymmetry) * self.bound**self.exponent)

    @property
    def bound(self) -> float:
        """Largest size of z: where it ends with the smallest psi of loading."""
        signs = [(s * g, s * g, g, g, s) for s in (1, -1) for g in (1, -1)]
        smallest = 1.0 + min(float(np.dot(self.shape, sign)) for sign in signs)
        return float(smallest ** (-1.0 / self.exponent))

    def peaks(self) -> Array:
        """Return peaks spread over the input range."""
        return np.linspace(*self.input_limits, 33)

    @classmethod
    def example(cls) -> Self:
        """Return a saturating loop over 0 to 5 bar."""
        polynomial, shape = (14.0, 16.0, -1.0, -1.0), (0.1, -0.1, 0.15, 0.05, -0.1)
        return cls(polynomial, -0.9, 1.2, shape, 1, 2.5, 2.5, (0.0, 5.0))
