"""A mass on a spring and a damper beside an element that remembers: hysteresis inside a dynamic loop.

m y'' + c y' + k y + z = u,
z' = f(z, y') y'.

The force u drives, the displacement y is given, and the force z of the element moves with y alone, at
whatever pace: its slope f looks at z and at the direction of y'. Models differ in f.

From sample to sample the input goes in a straight line (first-order hold) or stays (zero-order); the
equations are integrated by the classic Runge-Kutta method in substeps of equal length. f jumps only
where y' passes 0, so that z' has corners and no jumps; steps over these leave errors of second order.

Straight lines take (omega T)^2 / 12 off a sine of the input, T being the sample time: where that counts,
and the input is known beforehand, put samples between by a spline. A period of a recording can be run
with its input band-limited between samples, `Repeating.steady_state`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Gt
from pydantic import FiniteFloat

from mckibben.arrays import Array
from mckibben.blocks.base import Cost, Run, needs_sample_time
from mckibben.blocks.dynamics.repeating import Repeating
from mckibben.blocks.kernels import inlined
from mckibben.errors import ModelError

Positive = Annotated[FiniteFloat, Gt(0)]

HEAD = 7
"""Numbers before those of the element."""

SETTLING = 64
"""Steps in which a start at rest is reached."""

STABLE = 2.5
"""Radians of the fastest oscillation in a substep beyond which Runge-Kutta steps may grow."""


@inlined
def oscillate(slope: Any, coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run an oscillator whose element has ``slope(z, velocity, numbers)``.

    Coefficients are [substep, how many, 1 for zero-order hold, m, c, k, offset, numbers of the
    element]; the state is [y, y', z, last input].
    """
    h, n, held = coefficients[0], int(coefficients[1]), coefficients[2] > 0.0
    m, c, k, offset = coefficients[3], coefficients[4], coefficients[5], coefficients[6]
    own = coefficients[HEAD:]
    y, v, z = state[0], state[1], state[2]
    rise = 0.0 if held else (inputs[0] - state[3]) / n
    for s in range(n):
        u = state[3] + s * rise
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
    state[3] = inputs[0]
    outputs[0] = y + offset
    state[0], state[1], state[2] = y, v, z


@inlined
def settle(slope: Any, coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at rest: where the first input leads slowly from none, or, virgin, without force."""
    force = 0.0 if virgin else inputs[0]
    k, own = coefficients[5], coefficients[HEAD:]
    step = force / SETTLING
    z = 0.0
    for _ in range(SETTLING):
        share1 = _share(slope, z, force, k, own)
        share2 = _share(slope, z + 0.5 * step * share1, force, k, own)
        share3 = _share(slope, z + 0.5 * step * share2, force, k, own)
        share4 = _share(slope, z + step * share3, force, k, own)
        z += step / 6.0 * (share1 + 2.0 * share2 + 2.0 * share3 + share4)
    state[0], state[1], state[2], state[3] = (force - z) / k, 0.0, z, force


@inlined
def _share(slope: Any, z: float, force: float, k: float, own: Array) -> float:
    """Return the share of a slow input that the element takes."""
    stiffness = slope(z, force, own)
    return stiffness / (k + stiffness)


class Oscillator(Repeating):
    """A block with the fields of an oscillator, whose element a class adds."""

    rate_dependent: ClassVar[bool] = True
    slope_by: ClassVar[Callable[[float, float, Array], float]]
    """Slope of the element's force by y, from [force, velocity, `element`]; compiled."""

    mass: float
    damping: float
    stiffness: float
    output_offset: float | None
    initial: Any

    @property
    @abstractmethod
    def element(self) -> Array:
        """Numbers of the element, one-dimensional."""

    @property
    def n_states(self) -> int:
        """Displacement, velocity, force of the element, last input."""
        return 4

    @property
    def fastest(self) -> float:
        """Angular frequency of small motion about rest without force [rad/s]."""
        slopes = [type(self).slope_by(0.0, way, self.element) for way in (1.0, -1.0)]
        return float(np.sqrt((self.stiffness + max(*slopes, 0.0)) / self.inertia))

    @property
    def inertia(self) -> float:
        """The mass in N s^2/mm."""
        return 1e-3 * self.mass

    def coefficients(self, sample_time: float | None) -> Array:
        """Return what the kernel reads, for a sample time.

        Raises
        ------
        ModelError
            Without a sample time.
        """
        step = needs_sample_time(self.kind, sample_time)
        head = [step / self.substeps, self.substeps, self.hold == "zero"]
        springs = [self.inertia, self.damping, self.stiffness, self.output_offset or 0.0]
        return np.array([*head, *springs, *self.element])

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that runs the kernel in place.

        Raises
        ------
        ModelError
            Without a sample time, or where substeps are too few for it.
        """
        step = needs_sample_time(self.kind, sample_time)
        angle = self.fastest * step
        if not angle <= STABLE * self.substeps:
            raise ModelError(
                f"{self.kind!r} oscillates by {angle:.3g} rad in a sample of {step:g} s, too fast for "
                f"{self.substeps} substep(s). Remedy: at least {np.ceil(10 * angle):.0f} substeps, or a "
                "shorter sample time."
            )
        return super().bind(sample_time, state, inputs, outputs)

    def cost(self, sample_time: float | None) -> Cost:
        """Return what a step costs: four slopes a substep."""
        del sample_time
        operations = self.substeps * 4 * (18 + self.element.size)
        return Cost(operations, operations)
