"""Maxwell-slip model, symmetric and modified (asymmetric), with a reversible polynomial.

y = P((u - centre) / scale) + sum_i w_i s_i,

where s_i is the deflection of spring i, whose far end slips once the spring is stretched by its
limit: rising inputs stretch it, s <- min(s + du, r_i); falling ones press it, s <- max(s + kappa
du, -lambda r_i). kappa = lambda = 1 is the Maxwell-slip model, whose elements are stop operators.

Sources: Goldfarb and Celanovic 1997 (Maxwell-slip); Vo-Minh et al. 2011 (of pneumatic muscles); Liu
et al. 2016 (the modified model, here with one ratio of each for all elements).
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import MinLen
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import accumulate, kernel, step
from mckibben.blocks.memoryless import least_slope, polynomial_at
from mckibben.blocks.parameters import one_per
from mckibben.blocks.solving import solve_input, solved_start

KAPPA, LAMBDA, CENTRE, SCALE, LIMITS = range(5)
"""Places of the coefficients: ratios of stiffness and of limits, those of the polynomial's input, and
limits, weights and polynomial from the last on.
"""


@kernel
def stretch(du: float, stiffness: float) -> float:
    """Return the deflection of springs that do not slip for an input change ``du``."""
    return du if du >= 0.0 else stiffness * du


@kernel
def slip(s: float, du: float, limit: float, ratio: float) -> float:
    """Return the remaining deflection of a slipping spring."""
    return min(s, limit) if du >= 0.0 else max(s, -ratio * limit)


@kernel
def slip_matrix(
    u: Array, limits: Array, stiffness: float, ratio: float, s: Array, deflections: Array
) -> None:
    """Run springs in parallel: ``deflections[t, i]`` is that of spring i after sample t.

    Shapes: u (n,), limits and s (N,), deflections (n, N). Changes the deflections ``s`` at the start.
    """
    before = u[0]
    for t in range(u.size):
        du = u[t] - before
        change = stretch(du, stiffness)
        for i in range(limits.size):
            s[i] = slip(s[i] + change, du, limits[i], ratio)
            deflections[t, i] = s[i]
        before = u[t]


@kernel
def maxwell_slip_advance(u: float, c: Array, state: Array, lost: Array) -> None:
    """Update the deflections to an input."""
    n = state.size - 1
    du = u - state[n]
    change = stretch(du, c[KAPPA])
    for i in range(n):
        moved = accumulate(state[i], change, lost, i)
        state[i] = slip(moved, du, c[LIMITS + i], c[LAMBDA])
    state[n] = u


@kernel
def maxwell_slip_output(u: float, memory: tuple[Array, Array]) -> float:
    """Return the output at an input."""
    c, state = memory
    n = state.size - 1
    du = u - state[n]
    change = stretch(du, c[KAPPA])
    y = polynomial_at((u - c[CENTRE]) / c[SCALE], c, LIMITS + 2 * n, c.size - LIMITS - 2 * n)
    for i in range(n):
        y += c[LIMITS + n + i] * slip(state[i] + change, du, c[LIMITS + i], c[LAMBDA])
    return y


@step
def maxwell_slip_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Run the model; the state is [deflections, previous input]."""
    c, n = coefficients, state.size - 1
    maxwell_slip_advance(inputs[0], c, state, scratch)
    y = polynomial_at(
        (inputs[0] - c[CENTRE]) / c[SCALE], c, LIMITS + 2 * n, c.size - LIMITS - 2 * n
    )
    for i in range(n):
        y += c[LIMITS + n + i] * state[i]
    outputs[0] = y


@step
def maxwell_slip_inverse_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Solve for the input; see `mckibben.blocks.solving`."""
    u = solve_input(maxwell_slip_output, coefficients, state, inputs)
    maxwell_slip_advance(u, coefficients[:-2], state[:-2], scratch)
    outputs[0] = u


@kernel
def maxwell_slip_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with all springs slipping upwards, or undeflected."""
    n = state.size - 1
    for i in range(n):
        state[i] = 0.0 if virgin else coefficients[LIMITS + i]
    state[n] = inputs[0]


@dataclass(frozen=True, config=fields.STRICT)
class MaxwellSlip(fields.WithMemory, Invertible):
    """Slipping springs in parallel with a reversible polynomial.

    Parameters
    ----------
    breakaways : sequence of float, length N
        Deflections at which rising inputs make the springs slip: 0 < r_0 < r_1 < ..., in the unit
        of the input.
    weights : sequence of float, length N
        Stiffnesses, output per input; negative where the output lags the input.
    polynomial : sequence of float
        Ascending coefficients of the reversible part, at least one.
    stiffness_ratio : float
        kappa: of falling to rising inputs; positive.
    limit_ratio : float
        lambda: of falling to rising inputs; positive.
    centre, scale : float
        Of the input in the polynomial; scale positive.
    input_range : (float, float), optional
        Lowest and highest input; the inverse needs it and clips there.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: all springs slipping upwards, or none deflected.
    """

    kind = "maxwell-slip"
    solved = True
    inverse_memory = "input"
    kernel = maxwell_slip_step
    start_kernel = maxwell_slip_start
    inverse_kernel = maxwell_slip_inverse_step
    inverse_start_kernel = solved_start(maxwell_slip_output, maxwell_slip_start)
    parameters = ("weights", "polynomial", "stiffness_ratio", "limit_ratio")
    layout = (
        *("stiffness_ratio", "limit_ratio", "centre", "scale"),
        *("breakaways", "weights", "polynomial"),
    )
    increasing = ("breakaways",)
    same_length = ("breakaways", "weights")
    typical = (
        *((0.3, 0.8, 1.6), (-1.0, -0.8, -0.5), (14.0, 17.0, -1.0)),
        *(1.1, 0.8, 2.5, 2.5, (0.0, 5.0)),
    )
    n_states = one_per("breakaways", 1)  # deflections and the previous input
    n_scratch = one_per("breakaways")  # what single precision loses of the deflections
    formulas = (
        r"y = \sum_k c_k x^k + \sum_i w_i z_i,\quad x = \frac{u - m}{s}",
        r"z_{i,t} = \begin{cases} \min(z_{i,t-1} + \Delta u,\, r_i) & u \text{ rises} \\ "
        r"\max(z_{i,t-1} + \kappa \Delta u,\, -\lambda r_i) & u \text{ falls} \end{cases}",
    )

    breakaways: Annotated[fields.PositiveVector, MinLen(1), "r_i [{u}]"]
    weights: Annotated[fields.Vector, "w_i [{y}/{u}]"]
    polynomial: Annotated[fields.PolynomialField, "c_k from 0 [{y}]"]
    stiffness_ratio: Annotated[fields.Positive, r"\kappa"] = 1.0
    limit_ratio: Annotated[fields.Positive, r"\lambda"] = 1.0
    centre: Annotated[FiniteFloat, "m [{u}]"] = 0.0
    scale: Annotated[fields.Positive, "s [{u}]"] = 1.0
    input_range: fields.InputRange | None = None

    def least_slope(self) -> float:
        softening = float(np.minimum(self.weights, 0.0).sum()) * max(1.0, self.stiffness_ratio)
        return least_slope(self.polynomial, self.centre, self.scale, self.input_limits) + softening

    def peaks(self) -> Array:
        low, _ = self.input_limits
        return low + 2.0 * np.array(self.breakaways)
