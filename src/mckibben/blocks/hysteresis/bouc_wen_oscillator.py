"""The Bouc-Wen oscillator: a mass-spring-damper with Bouc-Wen hysteresis inside its loop.

m y'' + c y' + k y + z = u,
z' = a y' - gamma |y'| z - delta y' |z|.

In the common form, z' = alpha y' - beta (gamma |y'| z + delta y' |z|), beta enters with gamma and
delta only: here they are its products, one number less, and none that the data cannot tell. Both
may have either sign; gamma is what makes loops, and where gamma + delta < 0 they harden.

Sources: Bouc 1967; Wen, "Method of random vibration of hysteretic systems", 1976; as a benchmark of
identification, Noel and Schoukens, "Hysteretic benchmark with a dynamic nonlinearity", 2016.
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
from mckibben.blocks.fields import DISPLACEMENT, FORCE, STRICT, ChannelField, StoredInitial
from mckibben.blocks.hysteresis.oscillator import Oscillator, Positive, oscillate, settle
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation


@kernel
def bouc_wen_slope(z: float, velocity: float, numbers: Array) -> float:
    """Return dz/dy; numbers are [slope, gamma, delta]."""
    along = z if velocity > 0.0 else -z
    return numbers[0] - numbers[1] * along - numbers[2] * abs(z)


@step
def bouc_wen_oscillator_step(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Run the model; see `mckibben.blocks.hysteresis.oscillator`."""
    oscillate(bouc_wen_slope, coefficients, state, inputs, outputs)


@kernel
def bouc_wen_oscillator_start(
    coefficients: Array, state: Array, inputs: Array, virgin: bool
) -> None:
    """Start at rest."""
    settle(bouc_wen_slope, coefficients, state, inputs, virgin)


@dataclass(frozen=True, config=STRICT)
class BoucWenOscillator(Oscillator):
    """Mass, damper and spring with a Bouc-Wen element, from force to displacement.

    Parameters
    ----------
    mass : float
        m, the moving mass [kg]; positive.
    damping : float
        c, force by velocity [N s/mm]; not negative.
    stiffness : float
        k, force by displacement [N/mm]; positive.
    slope : float
        Stiffness of the element about z = 0 [N/mm]; positive.
    gamma, delta : float
        Shape of the element: how fast it loses its stiffness, on the whole and by direction [1/mm].
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

    kind: ClassVar[str] = "bouc-wen-oscillator"
    kernel: ClassVar[Kernel] = bouc_wen_oscillator_step
    start_kernel: ClassVar[Start] = bouc_wen_oscillator_start
    slope_by: ClassVar[Callable[[float, float, Array], float]] = staticmethod(bouc_wen_slope)
    parameters: ClassVar[tuple[str, ...]] = (
        *("mass", "damping", "stiffness", "slope", "gamma", "delta", "output_offset"),
    )
    notation: ClassVar[Notation] = Notation(
        r"m \ddot{q} + c \dot{q} + k q + z = u,\quad y = q + y_0",
        r"\dot{z} = a \dot{q} - \gamma |\dot{q}| z - \delta \dot{q} |z|",
        mass="m [kg]",
        damping="c [N s/mm]",
        stiffness="k [N/mm]",
        slope="a [N/mm]",
        gamma=r"\gamma [1/mm]",
        delta=r"\delta [1/mm]",
        output_offset="y_0 [{y}]",
    )

    mass: Positive
    damping: Annotated[FiniteFloat, Ge(0)]
    stiffness: Positive
    slope: Positive
    gamma: FiniteFloat
    delta: FiniteFloat
    output_offset: FiniteFloat | None = None
    substeps: Substeps = 10
    hold: Hold = "first"
    initial: StoredInitial = "first_sample"
    input: ChannelField = FORCE
    output: ChannelField = DISPLACEMENT

    @property
    def element(self) -> Array:
        """[slope, gamma, delta]."""
        return np.array([self.slope, self.gamma, self.delta])

    @classmethod
    def example(cls) -> Self:
        """Return an oscillator of 0.4 s whose loops harden."""
        return cls(2.0, 0.004, 0.3, 0.2, 0.12, -0.15)
