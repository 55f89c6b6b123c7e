"""Activation pressure by contraction and force: a static cubic with a hysteresis in the rate.

p = y(e, F) + gamma phi(F) e',  y = b_0 + b_1 e + b_2 e^2 + b_3 e^3.

Source: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and
Particle Swarm Optimization". The cubic goes through four characteristic points (e_j, y_j), each of
whose coordinates is a cubic of the force (Eqs. (2) to (9)); gamma is linear in the frequency of the
excitation, and phi a cubic of the force (Eqs. (10) to (15)). That frequency is a property of a test
signal, so this model is bound to one; `ActivationMemory` needs none.

The rate e' goes through an optional first-order filter, for contractions that are measured and
noisy.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Ge
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel, Start, needs_sample_time
from mckibben.blocks.fields import (
    CONTRACTION,
    FORCE,
    PRESSURE,
    STRICT,
    ChannelField,
    StoredInitial,
    Vector,
)
from mckibben.blocks.force.activation import Activation
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError

POINTS = 4


@kernel
def cubic(coefficients: Array, first: int, x: float) -> float:
    """Return the cubic whose coefficients, highest power first, start at ``first``."""
    return (
        (coefficients[first] * x + coefficients[first + 1]) * x + coefficients[first + 2]
    ) * x + coefficients[first + 3]


@step
def activation_pressure_step(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Run the model; the state is [previous contraction, filtered rate].

    Coefficients are [smoothing, gain of the rate, gamma, phi (4), contractions (16), pressures
    (16)].
    """
    e, force = inputs[0], inputs[1]
    rate = coefficients[0] * state[1] + coefficients[1] * (e - state[0])
    y = 0.0
    for j in range(4):
        share = 1.0
        own = cubic(coefficients, 7 + 4 * j, force)
        for k in range(4):
            if k != j:
                other = cubic(coefficients, 7 + 4 * k, force)
                share *= (e - other) / (own - other)
        y += share * cubic(coefficients, 23 + 4 * j, force)
    outputs[0] = y + coefficients[2] * cubic(coefficients, 3, force) * rate
    state[0], state[1] = e, rate


@kernel
def activation_pressure_start(
    coefficients: Array, state: Array, inputs: Array, virgin: bool
) -> None:
    """Start at rest at the first contraction."""
    state[0], state[1] = inputs[0], 0.0


@dataclass(frozen=True, config=STRICT)
class ActivationPressure(Activation):
    """Pressure that gives a contraction under a force, at one frequency of excitation.

    Parameters
    ----------
    contractions : sequence of float, length 16
        Cubics of the force, a b c d with a of the third power, for e_1 to e_4: at the lowest point,
        the highest, the inflection and the tangent.
    pressures : sequence of float, length 16
        The same for y_1 to y_4 [bar].
    phi : sequence of float, length 4
        Cubic of the force [bar s].
    gamma : (float, float)
        Slope [1/Hz] and constant of gamma by frequency.
    frequency : float
        Of the excitation [Hz]; not negative.
    rate_time_constant : float
        Of the filter of the rate [s]; 0 for none.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest.
    input, force, output : Channel
        Contraction, force and pressure.
    """

    kind: ClassVar[str] = "activation-pressure"
    kernel: ClassVar[Kernel] = activation_pressure_step
    start_kernel: ClassVar[Start] = activation_pressure_start
    parameters: ClassVar[tuple[str, ...]] = ("contractions", "pressures", "phi", "gamma")
    notation: ClassVar[Notation] = Notation(
        r"p = \sum_{k=0}^{3} b_k(F)\, \epsilon^k + \gamma\, \phi(F)\, \dot{\epsilon}",
        r"\text{the cubic goes through } (\epsilon_j(F),\, y_j(F)),\; j = 1, \ldots, 4,\; "
        r"\text{each coordinate a cubic of } F",
        r"\gamma = \gamma_1 \nu + \gamma_2,\quad \phi(F) = \phi_1 F^3 + \phi_2 F^2 + "
        r"\phi_3 F + \phi_4",
        contractions=r"\epsilon_k [1/N^3|1/N^2|1/N|1]",
        pressures="y_k [bar/N^3|bar/N^2|bar/N|bar]",
        phi=r"\phi_k [bar s/N^3|bar s/N^2|bar s/N|bar s]",
        gamma=r"\gamma_k [1/Hz|1]",
        frequency=r"\nu [Hz]",
        rate_time_constant="T [s]",
        input=r"\epsilon",
        force="F",
        output="p",
    )

    contractions: Vector
    pressures: Vector
    phi: Vector
    gamma: tuple[FiniteFloat, FiniteFloat]
    frequency: Annotated[FiniteFloat, Ge(0)]
    rate_time_constant: Annotated[FiniteFloat, Ge(0)] = 0.0
    initial: StoredInitial = "first_sample"
    input: ChannelField = CONTRACTION
    force: ChannelField = FORCE
    output: ChannelField = PRESSURE

    def __post_init__(self) -> None:
        sizes = (len(self.contractions), len(self.pressures), len(self.phi))
        if sizes != (4 * POINTS, 4 * POINTS, 4):
            raise ModelError(
                f"{self.kind!r} has {sizes} coefficients of contractions, pressures and phi. Remedy: "
                f"give {4 * POINTS}, {4 * POINTS} and 4."
            )

    @property
    def n_states(self) -> int:
        """Previous contraction and filtered rate."""
        return 2

    def coefficients(self, sample_time: float | None) -> Array:
        """Return what the kernel reads.

        Raises
        ------
        ModelError
            Without a sample time.
        """
        step = needs_sample_time(self.kind, sample_time)
        gamma = self.gamma[0] * self.frequency + self.gamma[1]
        head = [*self.rate_filter(step), gamma]
        return np.array([*head, *self.phi, *self.contractions, *self.pressures])

    @classmethod
    def example(cls) -> Self:
        """Return a model for contractions and forces of a few units."""
        return cls(
            (
                *(0.0, 0.0, 0.0, -1.0),
                *(0.0, 0.0, 0.01, 6.0),
                *(0.0, 0, 0, 2.0),
                *(0, 0.001, 0, 4.0),
            ),
            (*(0.0, 0.0, 0.1, 0.2), *(0.0, 0.0, 0.1, 4.0), *(0.0, 0, 0.1, 1.0), *(0, 0, 0.1, 2.0)),
            (0.0, 0.0, 0.01, 0.3),
            (0.27, 0.67),
            1.0,
        )
