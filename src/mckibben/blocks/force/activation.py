"""Activation pressure: the pressure for a contraction under a scheduling force.

Both models add a static pressure and a hysteresis, with the rate of the contraction, measured and
noisy, through an optional first-order filter. The published one has all its hysteresis in the rate,
and is bound to the frequency of a test signal; ours carries dry friction by operators, and is bound to
none.

Kernels are written in the subset of Python of docs/kernels.md; fields are in the order of saved files.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.sample_times import needs_sample_time, rate_filter
from mckibben.errors import ModelError

FILTERED = r"\dot{\epsilon} \text{ is filtered with the time constant } T"
"""What all equations of these models end with."""


@dataclass(frozen=True, kw_only=True, config=fields.STRICT)
class Activation(Block):
    """Fields of a model of the pressure for a contraction under a force.

    Parameters
    ----------
    rate_time_constant : float
        Of the filter of the rate [s]; 0 for none.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest.
    input, force, output : Channel
        Contraction, force and pressure.
    """

    settable: ClassVar[Mapping[str, str | None]] = {"rate_time_constant": None}
    ports = ("input",), ("force",), ("output",)
    rate_dependent = True
    no_inverse = "has no inverse here: it already computes the pressure for a contraction"
    instead = "use it as the compensator, or fit pressure to contraction by another model"

    rate_time_constant: Annotated[fields.NotNegative, "T [s]"] = 0.0
    initial: fields.StoredInitial = "first_sample"
    input: Annotated[fields.ChannelField, r"\epsilon"] = fields.CONTRACTION
    force: Annotated[fields.ChannelField, "F"] = fields.FORCE
    output: Annotated[fields.ChannelField, "p"] = fields.PRESSURE


# -- the published model ---------------------------------------------------------------------

POINTS = 4

SMOOTHING, RATE_GAIN, GAMMA, PHI, CONTRACTIONS, PRESSURES = 0, 1, 2, 3, 7, 23
"""Places of the coefficients: those of the filter of the rate, gamma, and cubics of the force: phi, four
contractions, and the pressures at these.
"""

E, RATE = range(2)
"""Places of the state: previous contraction, and filtered rate."""


@kernel
def cubic(coefficients: Array, first: int, x: float) -> float:
    """Return the cubic with coefficients from ``first``, highest power first."""
    return (
        (coefficients[first] * x + coefficients[first + 1]) * x + coefficients[first + 2]
    ) * x + coefficients[first + 3]


@kernel
def lagrange(e: float, own: float, one: float, two: float, three: float) -> float:
    """Return the polynomial that is 1 at ``own`` and 0 at three other points."""
    return (e - one) / (own - one) * ((e - two) / (own - two)) * ((e - three) / (own - three))


@step
def published_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the model."""
    e, force = inputs[0], inputs[1]
    rate = coefficients[SMOOTHING] * state[RATE] + coefficients[RATE_GAIN] * (e - state[E])
    one = cubic(coefficients, CONTRACTIONS, force)
    two = cubic(coefficients, CONTRACTIONS + 4, force)
    three = cubic(coefficients, CONTRACTIONS + 8, force)
    four = cubic(coefficients, CONTRACTIONS + 12, force)
    y = lagrange(e, one, two, three, four) * cubic(coefficients, PRESSURES, force)
    y += lagrange(e, two, one, three, four) * cubic(coefficients, PRESSURES + 4, force)
    y += lagrange(e, three, one, two, four) * cubic(coefficients, PRESSURES + 8, force)
    y += lagrange(e, four, one, two, three) * cubic(coefficients, PRESSURES + 12, force)
    outputs[0] = y + coefficients[GAMMA] * cubic(coefficients, PHI, force) * rate
    state[E], state[RATE] = e, rate


@kernel
def published_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at rest at the first contraction."""
    state[E], state[RATE] = inputs[0], 0.0


@dataclass(frozen=True, config=fields.STRICT)
class ActivationPressure(Activation):
    """Pressure for a contraction under a force, at one frequency of excitation.

    Source: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and
    Particle Swarm Optimization", Eqs. (2) to (15).

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
    frequency_range : (float, float), optional
        Lowest and highest frequency that it was identified at [Hz].
    """

    kind = "activation-pressure"
    added: ClassVar[Mapping[str, int]] = {"frequency_range": 2}
    settable: ClassVar[Mapping[str, str | None]] = {
        "frequency": "frequency_range",
        "rate_time_constant": None,
    }
    kernel = published_step
    start_kernel = published_start
    parameters = ("contractions", "pressures", "phi", "gamma")
    typical = (
        (  # contractions
            *(0.0, 0.0, 0.0, -1.0),
            *(0.0, 0.0, 0.01, 6.0),
            *(0.0, 0.0, 0.0, 2.0),
            *(0.0, 0.001, 0.0, 4.0),
        ),
        (  # pressures
            *(0.0, 0.0, 0.1, 0.2),
            *(0.0, 0.0, 0.1, 4.0),
            *(0.0, 0.0, 0.1, 1.0),
            *(0.0, 0.0, 0.1, 2.0),
        ),
        (0.0, 0.0, 0.01, 0.3),  # phi
        (0.27, 0.67),  # gamma
        1.0,  # frequency
    )
    n_states = 2  # previous contraction and filtered rate
    formulas = (
        r"p = \sum_{k=0}^{3} b_k(F)\, \epsilon^k + \gamma\, \phi(F)\, \dot{\epsilon}",
        r"\text{the cubic goes through } (\epsilon_j(F),\, y_j(F)),\; j = 1, \ldots, 4",
        r"\epsilon_j(F) = \sum_{k=0}^{3} e_{jk} F^k,\quad y_j(F) = \sum_{k=0}^{3} h_{jk} F^k",
        r"\gamma = \gamma_1 \nu + \gamma_2,\quad \phi(F) = \phi_1 F^3 + \phi_2 F^2 + "
        r"\phi_3 F + \phi_4",
        FILTERED,
    )

    contractions: Annotated[fields.Vector, "e_{jk} [1/N^3|1/N^2|1/N|1]"]
    pressures: Annotated[fields.Vector, "h_{jk} [bar/N^3|bar/N^2|bar/N|bar]"]
    phi: Annotated[fields.Vector, r"\phi_k [bar s/N^3|bar s/N^2|bar s/N|bar s]"]
    gamma: Annotated[tuple[FiniteFloat, FiniteFloat], r"\gamma_k [1/Hz|1]"]
    frequency: Annotated[fields.NotNegative, r"\nu [Hz]"]
    frequency_range: tuple[fields.NotNegative, fields.NotNegative] | None = None

    def __post_init__(self) -> None:
        sizes = (len(self.contractions), len(self.pressures), len(self.phi))
        if sizes != (4 * POINTS, 4 * POINTS, 4):
            raise ModelError(
                f"{self.kind!r} has {sizes} coefficients of contractions, pressures and phi",
                remedy=f"give {4 * POINTS}, {4 * POINTS} and 4",
            )

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number: cubics have their point and the power of the force."""
        if field in ("contractions", "pressures"):
            letter = {"contractions": "e", "pressures": "h"}[field]
            point, place = divmod(index[0], POINTS)
            return f"{letter}_{{{point + 1},{3 - place}}}"
        return super().symbol_of(field, index)

    def coefficients(self, sample_time: float | None) -> Array:
        step = needs_sample_time(self.kind, sample_time)
        rate = rate_filter(self.rate_time_constant, step)
        gamma = self.gamma[0] * self.frequency + self.gamma[1]
        return np.array([*rate, gamma, *self.phi, *self.contractions, *self.pressures])


# -- the model with memory -------------------------------------------------------------------

CENTRE, SCALE, FORCE_CENTRE, FORCE_SCALE, DEGREE, FORCE_DEGREE, N_SLOW, SURFACE = range(2, 10)
"""Places of the coefficients after those of the filter of the rate."""


@step
def remembering_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the model.

    The state is [n play operators, previous contraction, filtered rate, n_slow slow contractions x_m].
    Coefficients from `SURFACE` on are c row by row, thresholds, a, b, d, g, h and decays of x_m.
    """
    degree, force_degree = int(coefficients[DEGREE]), int(coefficients[FORCE_DEGREE])
    n_slow = int(coefficients[N_SLOW])
    n = state.size - 2 - n_slow
    first_threshold = SURFACE + (degree + 1) * (force_degree + 1)
    first_friction = first_threshold + n
    first_viscosity = first_friction + 2 * n
    first_relaxation = first_viscosity + 2
    first_decay = first_relaxation + 2 * n_slow
    surface = coefficients[SURFACE:first_threshold]
    thresholds = coefficients[first_threshold:first_friction]
    friction = coefficients[first_friction:first_viscosity]
    viscosity = coefficients[first_viscosity:first_relaxation]
    relaxation = coefficients[first_relaxation:first_decay]
    decays = coefficients[first_decay : first_decay + n_slow]
    slow = state[n + 2 :]

    e = inputs[0]
    x = (e - coefficients[CENTRE]) / coefficients[SCALE]
    f = (inputs[1] - coefficients[FORCE_CENTRE]) / coefficients[FORCE_SCALE]
    rate = coefficients[SMOOTHING] * state[n + 1] + coefficients[RATE_GAIN] * (e - state[n])

    p = 0.0
    for i in range(degree, -1, -1):
        row = 0.0
        for j in range(force_degree, -1, -1):
            row = row * f + surface[i * (force_degree + 1) + j]
        p = p * x + row
    for k in range(n):
        state[k] = min(max(state[k], e - thresholds[k]), e + thresholds[k])
        p += (friction[k] + f * friction[n + k]) * (e - state[k])
    p += (viscosity[0] + f * viscosity[1]) * rate
    for k in range(n_slow):
        slow[k] = decays[k] * slow[k] + (1.0 - decays[k]) * x
        p += (relaxation[k] + f * relaxation[n_slow + k]) * (slow[k] - x)

    state[n], state[n + 1] = e, rate
    outputs[0] = p


@kernel
def remembering_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start as if the contraction had only risen to the first one, or never moved."""
    degree, force_degree = int(coefficients[DEGREE]), int(coefficients[FORCE_DEGREE])
    first_threshold = SURFACE + (degree + 1) * (force_degree + 1)
    n = state.size - 2 - int(coefficients[N_SLOW])
    e = inputs[0]
    for k in range(n):
        state[k] = e if virgin else e - coefficients[first_threshold + k]
    state[n], state[n + 1] = e, 0.0
    state[n + 2 :] = (e - coefficients[CENTRE]) / coefficients[SCALE]


@dataclass(frozen=True, config=fields.STRICT)
class ActivationMemory(Activation):
    """Pressure for a contraction under a force, at any frequency.

    Dry friction is carried by stop operators, which keep it while the muscle rests and through minor
    loops; what follows the contraction relaxes as a visco-elastic muscle does.

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
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: the contraction has only risen, or has never moved.
    """

    kind = "activation-memory"
    increasing = ("thresholds",)
    kernel = remembering_step
    start_kernel = remembering_start
    parameters = ("surface", "friction", "viscosity", "relaxation")
    typical = (
        (2.0, 0.5, 1.5, 0.1, 0.2, 0.0),  # surface
        (0.2, 0.8),  # thresholds
        (0.3, 0.2, 0.1, 0.0),  # friction
        (0.05, 0.01),  # viscosity
        (0.1, 0.02),  # relaxation
        (0.5,),  # time_constants
        2,  # degree
        1,  # force_degree
        (2.5, 2.5),  # input_scale
        (2.5, 2.5),  # force_scale
    )
    formulas = (
        r"p = \sum_{ij} c_{ij} x^i f^j + \sum_k (a_k + b_k f) S_k[\epsilon] + (d_0 + d_1 "
        r"f) \dot{\epsilon} + \sum_m (g_m + h_m f)(x_m - x)",
        r"x = (\epsilon - \epsilon_1) / \epsilon_2,\quad f = (F - F_1) / F_2,\quad "
        r"S_k[\epsilon] = \epsilon - F_{r_k}[\epsilon],\quad \tau_m \dot{x}_m = x - x_m",
        FILTERED,
    )

    surface: Annotated[fields.Vector, "c_k [bar]"]
    thresholds: Annotated[fields.PositiveVector, "r_k"]
    friction: Annotated[fields.Vector, "a_k [bar]"]
    viscosity: Annotated[tuple[FiniteFloat, FiniteFloat], "d_k from 0 [bar s]"]
    relaxation: Annotated[fields.Vector, "g_k [bar]"]
    time_constants: Annotated[fields.PositiveVector, r"\tau_m [s]"]
    degree: Annotated[int, Interval(ge=0, le=9)]
    force_degree: Annotated[int, Interval(ge=0, le=9)]
    input_scale: Annotated[fields.Scale, r"\epsilon_i"]
    force_scale: Annotated[fields.Scale, "F_i [N]"]

    def __post_init__(self) -> None:
        size = (self.degree + 1) * (self.force_degree + 1)
        n = 2 * len(self.thresholds)
        if len(self.surface) != size or len(self.friction) != n:
            raise ModelError(
                f"{self.kind!r} has {len(self.surface)} numbers in its surface and "
                f"{len(self.friction)} of friction",
                remedy=f"give {size} and {n}",
            )
        if len(self.relaxation) != 2 * len(self.time_constants):
            raise ModelError(
                f"{self.kind!r} has {len(self.relaxation)} numbers of relaxation and the "
                f"time constants {self.time_constants}",
                remedy="give two to every time constant",
            )

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number: fields of two letters have all of one, then the other."""
        halves = {"friction": "ab", "relaxation": "gh"}
        if field in halves:
            second, place = divmod(index[0], len(getattr(self, field)) // 2)
            return f"{halves[field][second]}_{{{place + 1}}}"
        if field == "surface":
            power, of_force = divmod(index[0], self.force_degree + 1)
            return f"c_{{{power},{of_force}}}"
        return super().symbol_of(field, index)

    @property
    def n_states(self) -> int:
        return len(self.thresholds) + 2 + len(self.time_constants)

    def coefficients(self, sample_time: float | None) -> Array:
        step = needs_sample_time(self.kind, sample_time)
        rate = rate_filter(self.rate_time_constant, step)
        scales = [*self.input_scale, *self.force_scale]
        counts = [self.degree, self.force_degree, len(self.time_constants)]
        operators = [*self.thresholds, *self.friction]
        decays = np.exp(-step / np.array(self.time_constants))
        slow = [*self.viscosity, *self.relaxation, *decays]
        return np.array([*rate, *scales, *counts, *self.surface, *operators, *slow])
