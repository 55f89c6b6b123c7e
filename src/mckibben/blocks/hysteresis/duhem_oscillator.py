"""A mass-spring-damper with an element of unknown shape inside its loop: two curves of slopes.

m y'' + c y' + k y + z = u,
z' = r(z) y' while y rises, z' = s(z) y' while it falls.

This is Duhem's model with slopes that follow the force. r and s are straight between knots of z, and
constant beyond them: nothing is said of a shape but that the element has one number to remember.
A knot at z = 0 is worth having, for there loading turns into unloading. Bouc-Wen's element is that
whose curves are straight on either side of it.

Source: Visintin, "Differential models of hysteresis", 1994, on Duhem's model.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Ge
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel, Start
from mckibben.blocks.dynamics.repeating import Hold, Substeps
from mckibben.blocks.fields import DISPLACEMENT, FORCE, STRICT, ChannelField, StoredInitial, Vector
from mckibben.blocks.hysteresis.oscillator import Oscillator, Positive, oscillate, settle
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError


@kernel
def knot_before(z: float, numbers: Array, n: int) -> int:
    """Return the knot, of the n in front of the numbers, at which the piece about z begins."""
    j = 0
    while j < n - 2 and z >= numbers[j + 1]:
        j += 1
    return j


@kernel
def duhem_slope(z: float, velocity: float, numbers: Array) -> float:
    """Return dz/dy; numbers are [knots, slopes rising, slopes falling], as many each."""
    n = numbers.size // 3
    j = knot_before(z, numbers, n)
    share = (z - numbers[j]) / (numbers[j + 1] - numbers[j])
    share = min(max(share, 0.0), 1.0)
    j += n if velocity > 0.0 else 2 * n
    return numbers[j] + share * (numbers[j + 1] - numbers[j])


@step
def duhem_oscillator_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run the model; see `mckibben.blocks.hysteresis.oscillator`."""
    oscillate(duhem_slope, coefficients, state, inputs, outputs)


@kernel
def duhem_oscillator_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at rest."""
    settle(duhem_slope, coefficients, state, inputs, virgin)


@dataclass(frozen=True, config=STRICT)
class DuhemOscillator(Oscillator):
    """Mass, damper and spring with an element of any slopes, from force to displacement.

    Parameters
    ----------
    mass : float
        m, the moving mass [kg]; positive.
    damping : float
        c, force by velocity [N s/mm]; not negative.
    stiffness : float
        k, force by displacement [N/mm]; positive.
    rising, falling : sequence of float
        Slopes of the element's force by the displacement while that rises, or falls, at every knot
        [N/mm].
    knots : sequence of float
        Forces of the element [N], increasing, at least two.
    output_offset : float or None
        Added to the displacement [mm]; None for none.
    substeps : int
        Runge-Kutta steps from sample to sample.
    hold : {"first", "zero"}
        What the input does between samples: go on in a straight line, or stay.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest where the first input leads slowly, or at rest
        without any force, from which the input then goes to the first sample within one sample time.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "duhem-oscillator"
    kernel: ClassVar[Kernel] = duhem_oscillator_step
    start_kernel: ClassVar[Start] = duhem_oscillator_start
    increasing: ClassVar[tuple[str, ...]] = ("knots",)
    slope_by: ClassVar[Callable[[float, float, Array], float]] = staticmethod(duhem_slope)
    parameters: ClassVar[tuple[str, ...]] = (
        *("mass", "damping", "stiffness", "rising", "falling", "output_offset"),
    )
    notation: ClassVar[Notation] = Notation(
        r"m \ddot{q} + c \dot{q} + k q + z = u,\quad y = q + y_0",
        r"\dot{z} = \begin{cases} r(z)\, \dot{q} & q \text{ rises} \\ s(z)\, \dot{q} & q "
        r"\text{ falls} \end{cases}",
        r"r, s \text{ straight between the knots } \zeta_k,\; r(\zeta_k) = r_k,\; "
        r"s(\zeta_k) = s_k",
        mass="m [kg]",
        damping="c [N s/mm]",
        stiffness="k [N/mm]",
        knots=r"\zeta_k [N]",
        rising="r_k [N/mm]",
        falling="s_k [N/mm]",
        output_offset="y_0 [{y}]",
    )

    mass: Positive
    damping: Annotated[FiniteFloat, Ge(0)]
    stiffness: Positive
    rising: Vector
    falling: Vector
    knots: Vector
    output_offset: FiniteFloat | None = None
    substeps: Substeps = 10
    hold: Hold = "first"
    initial: StoredInitial = "first_sample"
    input: ChannelField = FORCE
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        n = len(self.knots)
        if (
            n < 2
            or not len(self.rising) == len(self.falling) == n
            or np.diff(self.knots).min() <= 0
        ):
            raise ModelError(
                f"{self.kind!r} has {n} knots, {len(self.rising)} slopes rising and "
                f"{len(self.falling)} falling. Remedy: give two knots or more, in increasing order, and "
                "a slope of either kind for each."
            )

    @property
    def element(self) -> Array:
        """[knots, slopes rising, slopes falling]."""
        return np.array([*self.knots, *self.rising, *self.falling])

    @classmethod
    def example(cls) -> Self:
        """Return an oscillator of 0.4 s whose element is stiffest just after a reversal."""
        rising = (0.5, 0.2, 0.25)
        return cls(2.0, 0.004, 0.3, rising, rising[::-1], (-2.0, 0.0, 2.0))
