"""Bouc-Wen model in its normalised form, with a reversible polynomial, and its inverse.

y = P((u - centre) / scale) + weight z,
dz/du = rate (1 - |z|^n [sigma sgn(z du) + 1 - sigma]).

z lies within -1 and 1. In the common form, z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n, it
is A = rate D, beta = sigma rate D^(1-n), gamma = (1 - sigma) rate D^(1-n) with z scaled by D: one
number less, and none that the data cannot tell.

Sources: Bouc 1967; Wen, "Method of random vibration of hysteretic systems", 1976; the normalised
form is that of Ikhouane and Rodellar, "Systems with Hysteresis", 2007.

z moves with the input, whatever its pace: the model is rate-independent, and for n = 1 and n = 2,
the exponents offered, it is integrated in closed form.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from annotated_types import Ge, Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.fields import DISPLACEMENT, PRESSURE, STRICT, ChannelField, StoredInitial
from mckibben.blocks.hysteresis.differential import bouc_wen_start, flow, loop_kernels
from mckibben.blocks.inverse import Invertible, check_input_range
from mckibben.blocks.kernels import kernel
from mckibben.blocks.memoryless.reversible import Reversible, least_slope, polynomial_at
from mckibben.blocks.notation import Notation


@kernel
def _moved(u: float, c: Array, state: Array) -> float:
    """Return z after the input has gone on to ``u``."""
    du = u - state[1]
    if du == 0.0:
        return state[0]
    up = 1.0 if du > 0.0 else -1.0
    return up * flow(up * state[0], abs(c[0] * du), 1.0 - 2.0 * c[1], 1.0, int(c[2]))


@kernel
def _output(u: float, z: float, c: Array) -> float:
    return polynomial_at((u - c[4]) / c[5], c, 6, c.size - 6) + c[3] * z


@dataclass(frozen=True, config=STRICT)
class BoucWen(Invertible):
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
        Default memory before the first sample: z = 1, or z = 0.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "bouc-wen"
    solved = True
    inverse_remembers = "input"
    n_states = 2
    start_kernel = bouc_wen_start
    kernel, inverse_kernel, inverse_start_kernel = loop_kernels(_moved, _output, bouc_wen_start)
    parameters = ("polynomial", "weight", "rate", "sigma")
    notation = Notation(
        r"y = \sum_k c_k x^k + w z,\quad x = \frac{u - m}{s}",
        r"\frac{dz}{du} = \rho \left(1 - |z|^n \left[\sigma \operatorname{sgn}(z\, du) + "
        r"1 - \sigma\right]\right)",
        polynomial="c_k from 0 [{y}]",
        weight="w [{y}]",
        rate=r"\rho [1/{u}]",
        sigma=r"\sigma",
        centre="m [{u}]",
        scale="s [{u}]",
    )

    polynomial: Reversible
    weight: FiniteFloat
    rate: Annotated[FiniteFloat, Gt(0)]
    sigma: Annotated[FiniteFloat, Ge(0.5)]
    exponent: Literal[1, 2] = 1
    centre: FiniteFloat = 0.0
    scale: Annotated[FiniteFloat, Gt(0)] = 1.0
    input_range: tuple[FiniteFloat, FiniteFloat] | None = None
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        check_input_range(self.kind, self.input_range)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [rate, sigma, exponent, weight, centre, scale, polynomial]."""
        del sample_time
        head = [self.rate, self.sigma, self.exponent, self.weight, self.centre, self.scale]
        return np.array([*head, *self.polynomial])

    def least_slope(self) -> float:
        """Return a lower bound of the slope of the output by the input."""
        steepest = self.rate * max(1.0, 2.0 * self.sigma)
        reversible = least_slope(self.polynomial, self.centre, self.scale, self.input_limits)
        return reversible + min(0.0, self.weight * steepest)

    def peaks(self) -> Array:
        """Return peaks spread over the input range."""
        return np.linspace(*self.input_limits, 33)

    @classmethod
    def example(cls) -> Self:
        """Return a saturating loop over 0 to 5 bar."""
        return cls((14.0, 16.0, -1.0, -1.0), -2.5, 1.2, 0.7, 1, 2.5, 2.5, (0.0, 5.0))
