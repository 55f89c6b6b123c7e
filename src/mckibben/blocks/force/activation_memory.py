"""Activation pressure by contraction and force with nonlocal memory, bound to no frequency.

p = sum_ij c_ij x^i f^j + sum_k (a_k + b_k f) S_k[e] + (d_0 + d_1 f) e' + sum_m (g_m + h_m f) (x_m
- x),

x and f the centred and scaled contraction and force, S_k[e] = e - F_{r_k}[e] stop operators, and
x_m what follows x with the time constant tau_m, as a visco-elastic muscle relaxes. Ours,
beside the model of "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial
Parameterization and Particle Swarm Optimization": dry friction is carried by the operators, which
keep it while the muscle rests and through minor loops, so what is left for the rate is the same at
every frequency.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Ge, Interval
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


@step
def activation_memory_step(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Run the model; the state is [play operators, previous contraction, filtered rate, x_m].

    Coefficients are [smoothing, gain of the rate, contraction's centre and scale, force's centre
    and scale, degree by contraction, degree by force, number of x_m, c row by row, thresholds, a,
    b, d, g, h, decays of x_m].
    """
    degree, by_force, m = int(coefficients[6]), int(coefficients[7]), int(coefficients[8])
    n = state.size - 2 - m
    thresholds = 9 + (degree + 1) * (by_force + 1)
    surface, r = coefficients[9:thresholds], coefficients[thresholds:]
    friction = r[n:]
    viscosity = friction[2 * n :]
    relaxation = viscosity[2:]
    decays = relaxation[2 * m :]
    followers = state[n + 2 :]
    e = inputs[0]
    x = (e - coefficients[2]) / coefficients[3]
    f = (inputs[1] - coefficients[4]) / coefficients[5]
    rate = coefficients[0] * state[n + 1] + coefficients[1] * (e - state[n])
    p = 0.0
    for i in range(degree, -1, -1):
        row = 0.0
        for j in range(by_force, -1, -1):
            row = row * f + surface[i * (by_force + 1) + j]
        p = p * x + row
    for k in range(n):
        state[k] = min(max(state[k], e - r[k]), e + r[k])
        p += (friction[k] + f * friction[n + k]) * (e - state[k])
    p += (viscosity[0] + f * viscosity[1]) * rate
    for k in range(m):
        followers[k] = decays[k] * followers[k] + (1.0 - decays[k]) * x
        p += (relaxation[k] + f * relaxation[m + k]) * (followers[k] - x)
    state[n], state[n + 1] = e, rate
    outputs[0] = p


@kernel
def activation_memory_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start where the contraction has only risen to the first one, or has never moved."""
    m = int(coefficients[8])
    n = state.size - 2 - m
    thresholds = 9 + (int(coefficients[6]) + 1) * (int(coefficients[7]) + 1)
    e = inputs[0]
    for k in range(n):
        state[k] = e if virgin else e - coefficients[thresholds + k]
    state[n], state[n + 1] = e, 0.0
    state[n + 2 :] = (e - coefficients[2]) / coefficients[3]


@dataclass(frozen=True, config=STRICT)
class ActivationMemory(Activation):
    """Pressure that gives a contraction under a force, whatever the frequency.

    Parameters
    ----------
    surface : sequence of float, length (degree + 1) (force_degree + 1)
        c [bar], for every power of the contraction all powers of the force, ascending.
    thresholds : sequence of float, length K
        Of the operators, in contraction: 0 < r_0 < r_1 < ...
    friction : sequence of float, length 2 K
        a, then b [bar per contraction].
    viscosity : (float, float)
        d [bar s].
    relaxation : sequence of float, length 2 M
        g, then h [bar].
    time_constants : sequence of float, length M
        tau [s], positive.
    degree, force_degree : int
        Of the surface.
    input_scale, force_scale : (float, float)
        Centre and half the range of contraction and force [N]; the latter positive.
    rate_time_constant : float
        Of the filter of the rate [s]; 0 for none.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: the contraction has only risen, or has never moved.
    input, force, output : Channel
        Contraction, force and pressure.
    """

    kind: ClassVar[str] = "activation-memory"
    kernel: ClassVar[Kernel] = activation_memory_step
    start_kernel: ClassVar[Start] = activation_memory_start
    parameters: ClassVar[tuple[str, ...]] = ("surface", "friction", "viscosity", "relaxation")
    notation: ClassVar[Notation] = Notation(
        r"p = \sum_{ij} c_{ij} x^i f^j + \sum_k (a_k + b_k f) S_k[\epsilon] + (d_0 + d_1 "
        r"f) \dot{\epsilon} + \sum_m (g_m + h_m f)(x_m - x)",
        r"x = (\epsilon - \epsilon_1) / \epsilon_2,\quad f = (F - F_1) / F_2,\quad "
        r"S_k[\epsilon] = \epsilon - F_{r_k}[\epsilon],\quad \tau_m \dot{x}_m = x - x_m",
        surface="c_k [bar]",
        thresholds="r_k",
        friction="a_k [bar]",
        viscosity="d_k from 0 [bar s]",
        relaxation="g_k [bar]",
        time_constants=r"\tau_m [s]",
        input_scale=r"\epsilon_i",
        force_scale="F_i [N]",
        rate_time_constant="T [s]",
        input=r"\epsilon",
        force="F",
        output="p",
    )

    surface: Vector
    thresholds: Vector
    friction: Vector
    viscosity: tuple[FiniteFloat, FiniteFloat]
    relaxation: Vector
    time_constants: Vector
    degree: Annotated[int, Interval(ge=0, le=9)]
    force_degree: Annotated[int, Interval(ge=0, le=9)]
    input_scale: tuple[FiniteFloat, FiniteFloat]
    force_scale: tuple[FiniteFloat, FiniteFloat]
    rate_time_constant: Annotated[FiniteFloat, Ge(0)] = 0.0
    initial: StoredInitial = "first_sample"
    input: ChannelField = CONTRACTION
    force: ChannelField = FORCE
    output: ChannelField = PRESSURE

    def __post_init__(self) -> None:
        size = (self.degree + 1) * (self.force_degree + 1)
        r = np.array(self.thresholds)
        if len(self.surface) != size or len(self.friction) != 2 * r.size:
            raise ModelError(
                f"{self.kind!r} has {len(self.surface)} numbers in its surface and "
                f"{len(self.friction)} of friction. Remedy: give {size} and {2 * r.size}."
            )
        if r.size and (r[0] <= 0 or np.any(np.diff(r) <= 0)):
            raise ModelError(
                f"the thresholds of {self.kind!r} are not 0 < r_0 < r_1 < ... "
                "Remedy: sort them and drop repeated ones."
            )
        if len(self.relaxation) != 2 * len(self.time_constants) or any(
            tau <= 0 for tau in self.time_constants
        ):
            raise ModelError(
                f"{self.kind!r} has {len(self.relaxation)} numbers of relaxation and the time constants "
                f"{self.time_constants}. Remedy: give two to every positive time constant."
            )
        if not (self.input_scale[1] > 0 and self.force_scale[1] > 0):
            raise ModelError(
                f"{self.kind!r} has a scale that is not positive. Remedy: give (centre, half range)."
            )

    @property
    def n_states(self) -> int:
        """Operators, previous contraction, filtered rate, and what follows."""
        return len(self.thresholds) + 2 + len(self.time_constants)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return what the kernel reads.

        Raises
        ------
        ModelError
            Without a sample time.
        """
        step = needs_sample_time(self.kind, sample_time)
        head = [*self.rate_filter(step), *self.input_scale, *self.force_scale]
        counts = [self.degree, self.force_degree, len(self.time_constants)]
        decays = np.exp(-step / np.array(self.time_constants))
        tail = [*self.thresholds, *self.friction, *self.viscosity, *self.relaxation, *decays]
        return np.array([*head, *counts, *self.surface, *tail])

    @classmethod
    def example(cls) -> Self:
        """Return a model for contractions and forces of a few units."""
        return cls(
            surface=(2.0, 0.5, 1.5, 0.1, 0.2, 0.0),
            thresholds=(0.2, 0.8),
            friction=(0.3, 0.2, 0.1, 0.0),
            viscosity=(0.05, 0.01),
            relaxation=(0.1, 0.02),
            time_constants=(0.5,),
            degree=2,
            force_degree=1,
            input_scale=(2.5, 2.5),
            force_scale=(2.5, 2.5),
        )
