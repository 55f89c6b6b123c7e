"""Equilibrium of a braided muscle: pressure against load and elasticity; and its inverse.

p A g(e) = load + stiffness e + hardening e^3,  g(e) = a (1 - e)^2 - b,
displacement = rest_length e + offset,

with A, a and b of the braid (`mckibben.blocks.force.laws.braid`). Sources: Chou and Hannaford 1996;
Tondu and Lopez 2000 (braid geometry). The balance gives the pressure of a contraction in closed form,
so it is the inverse that is explicit; forward it is solved for every sample.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from annotated_types import Interval
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.force.laws import braid
from mckibben.blocks.inverse import Invertible, nothing_clipped
from mckibben.blocks.kernels import DERIVED, SLACK, improved, kernel, step
from mckibben.blocks.solving import newton

LARGEST_SHARE = 0.995
"""Largest contraction of the muscle, relative to the contraction at which the braid's pull is zero.
"""

LEAST_CONTRACTION = -0.1
"""Smallest contraction modelled."""

CONVERGED = 1e-16
"""Change of the contraction at which the iteration has converged."""

SINGLE = {"CONVERGED": 1e-8}


LOAD, STIFFNESS, HARDENING, PER_BAR, A, B, LOW, HIGH, REST_LENGTH, OFFSET = range(10)
"""Places of the coefficients; `LOW` and `HIGH` are the least and the largest contraction."""


@kernel
def balance(e: float, c: Array) -> float:
    """Return the pressure in equilibrium at a contraction."""
    pull = c[PER_BAR] * (c[A] * (1.0 - e) ** 2 - c[B])
    return (c[LOAD] + e * (c[STIFFNESS] + c[HARDENING] * e * e)) / pull


@kernel
def balance_slope(e: float, p: float, c: Array) -> float:
    """Return the slope of that pressure by the contraction."""
    pull = c[PER_BAR] * (c[A] * (1.0 - e) ** 2 - c[B])
    stiffness = c[STIFFNESS] + 3.0 * c[HARDENING] * e * e
    return (stiffness + p * 2.0 * c[PER_BAR] * c[A] * (1.0 - e)) / pull


@step
def braid_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Solve for the displacement."""
    c = coefficients
    p = inputs[0]
    low, high = c[LOW], c[HIGH]
    if p <= balance(low, c):
        e = low
    elif p >= balance(high, c):
        e = high
    else:
        start = min(max(0.0, low), high)
        e = newton(balance, balance_slope, p, low, high, start, CONVERGED, c)
        if DERIVED:
            e = improved(balance, p, e, c)
    outputs[0] = c[REST_LENGTH] * e + c[OFFSET]


@step
def braid_inverse_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Compute the pressure of a displacement; the state is the clip count."""
    c = coefficients
    e = (inputs[0] - c[OFFSET]) / c[REST_LENGTH]
    inside = min(max(e, c[LOW]), c[HIGH])
    if abs(e - inside) > SLACK:
        state[0] += 1.0
    outputs[0] = balance(inside, c)


@dataclass(frozen=True, config=fields.STRICT)
class BraidEquilibrium(Invertible):
    """Equilibrium displacement of a loaded, braided muscle under a pressure.

    Parameters
    ----------
    load : float
        Force that stretches the muscle [N]; positive.
    stiffness : float
        Of the bladder and braid, per contraction [N]; not negative.
    hardening : float
        Cubic part of it [N]; not negative.
    braid_angle : float
        Between braid and axis at rest [rad], between 0.1 and 0.95 (54.7 degrees pull no more).
    rest_length : float
        Displacement per contraction [mm]; positive.
    offset : float
        Displacement at contraction 0 [mm].
    diameter : float
        Of the muscle at rest [mm]; positive. It only scales the forces.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "braid-equilibrium"
    kernel = braid_step
    inverse_kernel = braid_inverse_step
    inverse_start_kernel = nothing_clipped
    parameters = (
        "load",
        "stiffness",
        "hardening",
        "braid_angle",
        "rest_length",
        "offset",
    )
    typical = (196.0, 150.0, 900.0, 0.45, 200.0)
    formulas = (
        r"p A \left(a (1 - \epsilon)^2 - b\right) = F + k \epsilon + h \epsilon^3,\quad A "
        r"= \frac{\pi d^2}{4}",
        r"a = \frac{3}{\tan^2 \alpha},\quad b = \frac{1}{\sin^2 \alpha},\quad y = l_0 "
        r"\epsilon + y_0",
    )

    load: Annotated[fields.Positive, "F [N]"]
    stiffness: Annotated[fields.NotNegative, "k [N]"]
    hardening: Annotated[fields.NotNegative, "h [N]"]
    braid_angle: Annotated[FiniteFloat, Interval(ge=0.1, le=0.95), r"\alpha [rad]"]
    rest_length: Annotated[fields.Positive, "l_0 [mm]"]
    offset: Annotated[FiniteFloat, "y_0 [{y}]"] = 0.0
    diameter: Annotated[fields.Positive, "d [mm]"] = 20.0
    input: Annotated[fields.ChannelField, "p"] = fields.PRESSURE
    output: fields.ChannelField = fields.DISPLACEMENT

    @property
    def input_range(self) -> tuple[float, float]:
        c = self.coefficients(None)
        return float(balance(c[LOW], c)), float(balance(c[HIGH], c))

    def coefficients(self, sample_time: float | None) -> Array:
        area, a, b = braid(self.braid_angle, self.diameter)
        largest = LARGEST_SHARE * (1.0 - math.sqrt(b / a))
        # below, the bladder would have to pull harder than the load
        least = LEAST_CONTRACTION
        if self.stiffness > 0:
            least = max(least, -0.9 * self.load / (self.stiffness + 0.01 * self.hardening))
        head = [self.load, self.stiffness, self.hardening, area, a, b, least, largest]
        return np.array([*head, self.rest_length, self.offset])

    def reachable(self) -> tuple[Array, Array]:
        c = self.coefficients(None)
        low, high = (np.array([c[REST_LENGTH] * end + c[OFFSET]]) for end in (c[LOW], c[HIGH]))
        return low, high

    def inverse_numbers(self, own: Array) -> Array:
        return own
