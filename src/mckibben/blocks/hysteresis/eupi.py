"""Extended unparallel Prandtl-Ishlinskii (EUPI) model, for loops whose branches differ in slope.

The unparallel play operator has edges of different slope: with x the input counted from the lower end
of its range, it follows x - r on the rising edge and alpha x + beta r on the falling one, and holds
between; where the falling edge would run below the rising one they are the same line. Beside the
operators stands a polynomial of x without memory: y = y_0 + sum_k a_k x^k + sum_i w_i F_i[x]. With
alpha = beta = 1 and no polynomial it is the classical PI model; with the polynomial alone set to 0, the
unparallel (UPI) model.

Named among the alternatives in "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling
Behavior for Parallel Pneumatic Artificial Muscle-Driven Soft Manipulator", Section 3.1. Publications
differ in how they write the falling edge; this general form contains them.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.hysteresis.play_operators import start_operators
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import inlined, kernel
from mckibben.blocks.parameters import one_per
from mckibben.blocks.solving import solved_kernels
from mckibben.errors import ModelError

FIRST_INPUT, ALPHA, BETA, OFFSET, A_1, A_2, A_3, THRESHOLDS = range(8)
"""Places of the coefficients; thresholds, then weights, are from the last on."""


@inlined
def unparallel_play(s: float, x: float, r: float, alpha: float, beta: float) -> float:
    """Advance an operator whose edges differ in slope."""
    return max(min(s, alpha * x + beta * r), x - r)


@kernel
def eupi_matrix(x: Array, alpha: float, beta: float, r: Array, s: Array, operators: Array) -> None:
    """Run unparallel play operators side by side: ``operators[t, i]`` is operator i after sample t.

    Shapes: x (n,), r and s (N,), operators (n, N). Changes the states ``s``.
    """
    for t in range(x.size):
        for i in range(r.size):
            s[i] = unparallel_play(s[i], x[t], r[i], alpha, beta)
            operators[t, i] = s[i]


@kernel
def eupi_advance(u: float, c: Array, state: Array) -> None:
    """Update the operators to an input."""
    x = u - c[FIRST_INPUT]
    for i in range(state.size):
        state[i] = unparallel_play(state[i], x, c[THRESHOLDS + i], c[ALPHA], c[BETA])


@kernel
def eupi_output(u: float, memory: tuple[Array, Array]) -> float:
    """Return the output at an input."""
    c, state = memory
    n = state.size
    x = u - c[FIRST_INPUT]
    y = c[OFFSET] + ((c[A_3] * x + c[A_2]) * x + c[A_1]) * x
    for i in range(n):
        y += c[THRESHOLDS + n + i] * unparallel_play(
            state[i], x, c[THRESHOLDS + i], c[ALPHA], c[BETA]
        )
    return y


@kernel
def eupi_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start the operators before the first sample."""
    x = inputs[0] - coefficients[FIRST_INPUT]
    start_operators(coefficients[THRESHOLDS : THRESHOLDS + state.size], x, x, virgin, state)


@dataclass(frozen=True, config=fields.STRICT)
class EUPI(fields.WithMemory, Invertible):
    """Extended unparallel Prandtl-Ishlinskii model.

    Parameters
    ----------
    thresholds : sequence of float, length N
        Thresholds, in the unit of the input: 0 <= r_0 < r_1 < ...
    weights : sequence of float, length N
        Weights, output per input. The inverse requires that none is negative.
    falling_slope : float
        alpha, slope of the falling edge where the rising one has 1; positive.
    falling_threshold : float
        beta, threshold of the falling edge per threshold of the rising one; at least 0.
    polynomial : (float, float, float)
        a_1, a_2, a_3 of the part without memory. The inverse requires that it increases.
    offset : float
        Constant of the output.
    input_range : (float, float)
        Lowest and highest input; x counts from the lowest, and the inverse clips to both.
    """

    kind = "eupi"
    solved = True
    inverse_memory = "input"
    start_kernel = eupi_start
    kernel, inverse_kernel, inverse_start_kernel = solved_kernels(
        eupi_output, eupi_advance, eupi_start
    )
    increasing = ("thresholds",)
    same_length = ("thresholds", "weights")
    parameters = ("weights", "falling_slope", "falling_threshold", "polynomial", "offset")
    typical = (
        *((0.0, 0.3, 0.8, 1.5), (2.0, 1.5, 1.0, 0.5), 1.1, 0.8),
        *((1.0, 0.2, -0.02), 2.0, (0.0, 5.0)),
    )
    n_states = one_per("thresholds")  # one an operator
    formulas = (
        r"y = y_0 + \sum_{k} a_k x^k + \sum_i w_i F_i[x],\quad x = u - u_{\min}",
        r"F_{i,t} = \begin{cases} \max(x_t - r_i,\, F_{i,t-1}) & x \text{ rises} \\ "
        r"\min(\alpha x_t + \beta r_i,\, F_{i,t-1}) & x \text{ falls} \end{cases}",
    )

    thresholds: Annotated[fields.Thresholds, "r_i [{u}]"]
    weights: Annotated[fields.Vector, "w_i [{y}/{u}]"]
    falling_slope: Annotated[fields.Positive, r"\alpha"]
    falling_threshold: Annotated[fields.NotNegative, r"\beta"]
    polynomial: Annotated[
        tuple[FiniteFloat, FiniteFloat, FiniteFloat], "a_k [{y}/{u}|{y}/{u}^2|{y}/{u}^3]"
    ]
    offset: Annotated[FiniteFloat, "y_0 [{y}]"]
    input_range: fields.InputRange

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [u_0, alpha, beta, offset, a_1, a_2, a_3, thresholds, weights]."""
        edges = (self.input_range[0], self.falling_slope, self.falling_threshold)
        shape = (self.offset, *self.polynomial)
        return np.array([*edges, *shape, *self.thresholds, *self.weights])

    def peaks(self) -> Array:
        """Return the peaks from which each operator just returns to the lowest input."""
        return self.input_range[0] + (1 + self.falling_threshold) * np.array(self.thresholds)

    def check_invertible(self) -> None:
        if min(self.weights) < 0 or self.least_slope() <= 0:
            raise ModelError(
                "'eupi' has no inverse: a weight is negative, or its part without memory "
                "does not increase",
                remedy="identify it with `settings[nonnegative]=true`",
            )

    def least_slope(self) -> float:
        low, high = self.input_range
        a1, a2, a3 = self.polynomial
        turn = -a2 / (3 * a3) if a3 else 0.0
        places = np.array([0.0, high - low, min(max(turn, 0.0), high - low)])
        slope = (a1 + 2 * a2 * places + 3 * a3 * places**2).min()
        reversible = self.thresholds[0] == 0 and self.falling_slope <= 1
        return float(slope + (self.weights[0] if reversible else 0.0))

    def stored_for_inverse(self, state: Array) -> tuple[float, ...]:
        """Return the lowest input, as operators do not determine the last one."""
        return (self.input_range[0],)
