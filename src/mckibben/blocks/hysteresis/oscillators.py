"""A mass with spring, damper and a hysteretic element inside the dynamic loop.

m y'' + c y' + k y + z = u,
z' = f(z, y') y'.

The force u drives, the displacement y is given, and the force z of the element moves with y alone, at
whatever pace: its slope f depends on z and on the direction of y'. Models differ in f.

The Bouc-Wen element has f = a - gamma sgn(y') z - delta |z|; of the common form,
z' = alpha y' - beta (gamma |y'| z + delta y' |z|), gamma and delta are the products with beta. Both may
have either sign; gamma makes loops, and where gamma + delta < 0 they harden.

Duhem's element has f = r(z) while y rises, and s(z) while it falls, straight between knots of z, and
constant beyond them. A knot at z = 0 is useful, where loading turns into unloading.

Sources: Bouc 1967; Wen, "Method of random vibration of hysteretic systems", 1976; as a benchmark of
identification, Noel and Schoukens, "Hysteretic benchmark with a dynamic nonlinearity", 2016; on Duhem's
model, Visintin, "Differential models of hysteresis", 1994.

From sample to sample the input goes in a straight line (first-order hold) or stays (zero-order); the
equations are integrated by the classic Runge-Kutta method in substeps of equal length. f jumps only
where y' passes 0, so that z' has corners and no jumps; steps over these leave errors of second order.
No estimator makes these models: they are for systems whose equations are known, and for saved files.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block, Start
from mckibben.blocks.kernels import Step, kernel, step
from mckibben.blocks.parameters import gathered
from mckibben.blocks.sample_times import needs_sample_time

HEAD = 7
SUBSTEP, SUBSTEPS, HOLDS, MASS, DAMPING, STIFFNESS, OFFSET = range(HEAD)
"""Places of the coefficients before those of the hysteretic element; `SUBSTEP` is its length [s], and
`HOLDS` 1 for zero-order hold.
"""

Y, VELOCITY, Z, FORCE = range(4)
"""Places of the state; Z is the element's force, and FORCE the last input."""

SETTLING = 64
"""Number of steps in which an initial equilibrium is reached."""


def oscillator_kernels(slope: Callable[[float, float, Array], float]) -> tuple[Step, Start]:
    """Return step and start of an oscillator with ``slope(z, velocity, numbers)``."""

    def oscillator_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        """Advance an oscillator in Runge-Kutta substeps."""
        h, n, held = coefficients[SUBSTEP], int(coefficients[SUBSTEPS]), coefficients[HOLDS] > 0.0
        m, c, k = coefficients[MASS], coefficients[DAMPING], coefficients[STIFFNESS]
        own = coefficients[HEAD:]
        y, v, z = state[Y], state[VELOCITY], state[Z]
        rise = 0.0 if held else (inputs[0] - state[FORCE]) / n
        for s in range(n):
            u = state[FORCE] + s * rise
            v1 = v
            a1 = (u - c * v1 - k * y - z) / m
            z1 = v1 * slope(z, v1, own)
            u += 0.5 * rise
            v2 = v + 0.5 * h * a1
            x = z + 0.5 * h * z1
            a2 = (u - c * v2 - k * (y + 0.5 * h * v1) - x) / m
            z2 = v2 * slope(x, v2, own)
            v3 = v + 0.5 * h * a2
            x = z + 0.5 * h * z2
            a3 = (u - c * v3 - k * (y + 0.5 * h * v2) - x) / m
            z3 = v3 * slope(x, v3, own)
            u += 0.5 * rise
            v4 = v + h * a3
            x = z + h * z3
            a4 = (u - c * v4 - k * (y + h * v3) - x) / m
            z4 = v4 * slope(x, v4, own)
            y += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            z += h / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4)
        state[FORCE] = inputs[0]
        outputs[0] = y + coefficients[OFFSET]
        state[Y], state[VELOCITY], state[Z] = y, v, z

    @kernel
    def share(z: float, force: float, k: float, own: Array) -> float:
        """Return the element's share of a slowly applied force."""
        stiffness = slope(z, force, own)
        return stiffness / (k + stiffness)

    def oscillator_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
        """Start in equilibrium with the first force, or, virgin, without force."""
        force = 0.0 if virgin else inputs[0]
        k, own = coefficients[STIFFNESS], coefficients[HEAD:]
        step = force / SETTLING
        z = 0.0
        for _ in range(SETTLING):
            share1 = share(z, force, k, own)
            share2 = share(z + 0.5 * step * share1, force, k, own)
            share3 = share(z + 0.5 * step * share2, force, k, own)
            share4 = share(z + step * share3, force, k, own)
            z += step / 6.0 * (share1 + 2.0 * share2 + 2.0 * share3 + share4)
        state[Y], state[VELOCITY], state[Z], state[FORCE] = (force - z) / k, 0.0, z, force

    return step(oscillator_step), kernel(oscillator_start)


@dataclass(frozen=True, config=fields.STRICT)
class Oscillator(fields.WithMemory, Block):
    """Mass, damper and spring with a hysteretic element of a subclass, from force to displacement.

    Parameters
    ----------
    mass : float
        m, the moving mass [kg]; positive.
    damping : float
        c, force by velocity [N s/mm]; not negative.
    stiffness : float
        k, force by displacement [N/mm]; positive.
    output_offset : float or None
        Added to the displacement [mm]; None for none.
    substeps : int
        Runge-Kutta steps from sample to sample.
    hold : {"first", "zero"}
        Input between samples: linear, or constant.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest where the first input leads slowly, or at rest
        without any force, from which the input then goes to the first sample within one sample time.
    """

    rate_dependent = True
    n_states = 4  # displacement, velocity, force of the element, last input
    elements: ClassVar[tuple[str, ...]]
    """Fields of the hysteretic element."""

    mass: Annotated[fields.Positive, "m [kg]"]
    damping: Annotated[fields.NotNegative, "c [N s/mm]"]
    stiffness: Annotated[fields.Positive, "k [N/mm]"]
    output_offset: Annotated[FiniteFloat | None, "y_0 [{y}]"] = Field(default=None, kw_only=True)
    substeps: fields.Substeps = Field(default=10, kw_only=True)
    hold: fields.Hold = Field(default="first", kw_only=True)
    input: fields.ChannelField = Field(default=fields.FORCE, kw_only=True)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the coefficients from `SUBSTEP` on; the mass in N s^2/mm."""
        step = needs_sample_time(self.kind, sample_time)
        head = [step / self.substeps, self.substeps, self.hold == "zero"]
        springs = [1e-3 * self.mass, self.damping, self.stiffness, self.output_offset or 0.0]
        return np.array([*head, *springs, *gathered(self, self.elements)])


@kernel
def bouc_wen_slope(z: float, velocity: float, numbers: Array) -> float:
    """Return dz/dy; numbers are [slope, gamma, delta]."""
    along = z if velocity > 0.0 else -z
    return numbers[0] - numbers[1] * along - numbers[2] * abs(z)


@dataclass(frozen=True, config=fields.STRICT)
class BoucWenOscillator(Oscillator):
    """Mass, damper and spring with a Bouc-Wen element, from force to displacement.

    Parameters
    ----------
    slope : float
        Stiffness of the element about z = 0 [N/mm]; positive.
    gamma, delta : float
        Shape of the element: how fast it loses its stiffness, on the whole and by direction [1/mm].
    """

    kind = "bouc-wen-oscillator"
    kernel, start_kernel = oscillator_kernels(bouc_wen_slope)
    elements = ("slope", "gamma", "delta")
    parameters = ("mass", "damping", "stiffness", "slope", "gamma", "delta", "output_offset")
    typical = (2.0, 0.004, 0.3, 0.2, 0.12, -0.15)
    formulas = (
        r"m \ddot{q} + c \dot{q} + k q + z = u,\quad y = q + y_0",
        r"\dot{z} = a \dot{q} - \gamma |\dot{q}| z - \delta \dot{q} |z|",
    )

    slope: Annotated[fields.Positive, "a [N/mm]"]
    gamma: Annotated[FiniteFloat, r"\gamma [1/mm]"]
    delta: Annotated[FiniteFloat, r"\delta [1/mm]"]


@kernel
def duhem_slope(z: float, velocity: float, numbers: Array) -> float:
    """Return dz/dy; numbers are [knots, rising slopes, falling slopes], equally many."""
    n, j = numbers.size // 3, 0
    while j < n - 2 and z >= numbers[j + 1]:
        j += 1
    share = (z - numbers[j]) / (numbers[j + 1] - numbers[j])
    share = min(max(share, 0.0), 1.0)
    j += n if velocity > 0.0 else 2 * n
    return numbers[j] + share * (numbers[j + 1] - numbers[j])


@dataclass(frozen=True, config=fields.STRICT)
class DuhemOscillator(Oscillator):
    """Mass, damper and spring with a piecewise hysteretic element, from force to displacement.

    Parameters
    ----------
    rising, falling : sequence of float
        Slopes of the element's force by the displacement while that rises, or falls, at every knot
        [N/mm].
    knots : sequence of float
        Forces of the element [N], increasing, at least two.
    """

    kind = "duhem-oscillator"
    kernel, start_kernel = oscillator_kernels(duhem_slope)
    increasing = ("knots",)
    same_length = ("knots", "rising", "falling")
    elements = ("knots", "rising", "falling")
    typical = (2.0, 0.004, 0.3, (0.5, 0.2, 0.25), (0.25, 0.2, 0.5), (-2.0, 0.0, 2.0))
    parameters = ("mass", "damping", "stiffness", "rising", "falling", "output_offset")
    formulas = (
        r"m \ddot{q} + c \dot{q} + k q + z = u,\quad y = q + y_0",
        r"\dot{z} = \begin{cases} r(z)\, \dot{q} & q \text{ rises} \\ s(z)\, \dot{q} & q "
        r"\text{ falls} \end{cases}",
        r"r, s \text{ straight between the knots } \zeta_k,\; r(\zeta_k) = r_k,\; "
        r"s(\zeta_k) = s_k",
    )

    rising: Annotated[fields.Vector, "r_k [N/mm]"]
    falling: Annotated[fields.Vector, "s_k [N/mm]"]
    knots: Annotated[fields.Knots, r"\zeta_k [N]"]
