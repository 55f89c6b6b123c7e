"""Prandtl-Ishlinskii (PI) models: weighted sums of play operators, and their inverses.

The classical model: y_t = y_0 + sum_i w_i F_{r_i}[u]_t, with r_0 = 0 so that the first term is the
reversible part. Source: "Analysis and modeling of a pneumatic artificial muscle system", Eqs. (12) and
(13). Its inverse walks the same piecewise-linear relation from the operators' states, which touches only
the operators that move, and stays consistent when a reference has to be clipped.

The rate-dependent model: y_t = y_0 + sum_i (k_i v_t + d_i) F_{r_i}[u]_t, where v is the rate of u,
optionally through a first-order filter for inputs that are measured and noisy. With a polynomial behind
it, this is the MPI model of "High-Precision Displacement and Force Hybrid Modeling of Pneumatic
Artificial Muscle Using 3D PI-NARMAX Model", Eqs. (2) to (4). Its inverse is solved for. Where the output
falls at first when the input jumps up (strongly negative weights by rate and a short filter), solutions
swing ever wider, into the input limits; a longer `rate_time_constant` prevents it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.hysteresis.play_operators import (
    check_invertible_sum,
    follow,
    start_operators,
    start_sum,
)
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import kernel, step, summing_step
from mckibben.blocks.learning import (
    N_LEARNED,
    Learnable,
    follow_learning,
    inverse_at,
    learnable_operators,
    start_learning,
)
from mckibben.blocks.parameters import one_per
from mckibben.blocks.sample_times import needs_sample_time, rate_filter
from mckibben.blocks.solving import solved_kernels


@summing_step
def pi_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance a PI model; coefficients are [offset, thresholds, weights]."""
    n = state.size
    r, w = coefficients[1 : n + 1], coefficients[n + 1 :]
    u = inputs[0]
    y = 0.0
    for i in range(n):
        s = min(max(state[i], u - r[i]), u + r[i])
        state[i] = s
        y += w[i] * s
    outputs[0] = coefficients[0] + y


@kernel
def pi_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start a PI model before its first sample."""
    start_operators(coefficients[1 : state.size + 1], inputs[0], inputs[0], virgin, state)


@step
def pi_inverse_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the inverse; coefficients are [lowest, highest input, offset, thresholds, weights].

    The state is [forward operators, previous reference, samples clipped].
    """
    n = state.size - 2
    lowest, highest, offset = coefficients[0], coefficients[1], coefficients[2]
    r, w = coefficients[3 : n + 3], coefficients[n + 3 :]
    y = inputs[0]
    _, clipped = follow(y - offset, state[n] - offset, lowest, highest, r, w, state[:n])
    if clipped:
        state[n + 1] += 1.0
    state[n] = y
    outputs[0] = state[0]


@kernel
def pi_inverse_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start the inverse of a PI model before its first reference."""
    n = state.size - 2
    lowest, highest, offset = coefficients[0], coefficients[1], coefficients[2]
    r, w = coefficients[3 : n + 3], coefficients[n + 3 :]
    start_sum(inputs[0] - offset, lowest, highest, r, w, virgin, state[:n])
    state[n], state[n + 1] = inputs[0], 0.0


@step
def pi_adaptive_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Advance the inverse of a PI model, and adapt its weights and offset to measurements."""
    n = int(coefficients[N_LEARNED]) - 1
    r = coefficients[inverse_at(coefficients) + 3 : inverse_at(coefficients) + n + 3]
    s, last, adapted = state[:n], state[n : n + 3], state[n + 3 :]
    follow_learning(coefficients, r, s, last, adapted, scratch, inputs[0], inputs[1])
    outputs[0] = s[0]


@kernel
def pi_adaptive_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start as the inverse does, with the fitted weights."""
    n = int(coefficients[N_LEARNED]) - 1
    pi_inverse_start(coefficients[inverse_at(coefficients) :], state[: n + 2], inputs, virgin)
    state[n + 2] = 0.0
    start_learning(coefficients, state[n + 3 :])


@dataclass(frozen=True, config=fields.STRICT)
class PI(fields.WithMemory, Invertible):
    """Classical Prandtl-Ishlinskii model.

    Parameters
    ----------
    thresholds : sequence of float, length N
        Thresholds of the play operators, in the unit of the input: 0 <= r_0 < r_1 < ...
    weights : sequence of float, length N
        Weights, output per input. The exact inverse requires r_0 = 0 and positive partial sums.
    offset : float
        Constant of the output.
    input_range : (float, float), optional
        Lowest and highest input that may be asked for; the inverse clips there. Default none.
    """

    kind = "pi"
    kernel = pi_step
    start_kernel = pi_start
    inverse_kernel = pi_inverse_step
    inverse_start_kernel = pi_inverse_start
    inverse_memory = "output"
    increasing = ("thresholds",)
    same_length = ("thresholds", "weights")
    parameters = ("weights", "offset")
    n_states = one_per("thresholds")  # one a play operator
    layout = ("offset", "thresholds", "weights")
    typical = ((0.0, 0.3, 0.8, 1.5), (3.0, 1.5, 1.0, 0.5), 2.0, (0.0, 5.0))
    formulas = (
        r"y = y_0 + \sum_i w_i F_{r_i}[u]",
        r"F_r[u]_t = \min(\max(F_r[u]_{t-1},\, u_t - r),\, u_t + r)",
    )

    thresholds: Annotated[fields.Thresholds, "r_i [{u}]"]
    weights: Annotated[fields.Vector, "w_i [{y}/{u}]"]
    offset: Annotated[FiniteFloat, "y_0 [{y}]"] = 0.0
    input_range: fields.InputRange | None = None

    def peaks(self) -> Array:
        """Return the peaks from which each operator just returns to the lowest input."""
        return self.input_limits[0] + 2 * np.array(self.thresholds)

    def check_invertible(self) -> None:
        check_invertible_sum(self.kind, self.thresholds, self.weights)

    def inverse_numbers(self, own: Array) -> Array:
        return np.array([*self.input_limits, *own])

    def stored_for_inverse(self, state: Array) -> tuple[float, ...]:
        return (self.offset + np.dot(self.weights, state),)

    @property
    def learnable(self) -> Learnable:
        return learnable_operators(
            self,
            self.thresholds,
            self.weights,
            self.input_limits,
            self.offset,
            pi_adaptive_step,
            pi_adaptive_start,
            lambda theta: replace(self, weights=fields.vector(theta[:-1]), offset=float(theta[-1])),
        )


SMOOTHING, RATE_GAIN, OFFSET, THRESHOLDS = range(4)
"""Places of the coefficients of the rate-dependent model; thresholds, k and d are from the last on."""


@kernel
def rate_pi_output(u: float, memory: tuple[Array, Array]) -> float:
    """Return the output at an input; the state is [operators, previous input, filtered rate]."""
    coefficients, state = memory
    n = state.size - 2
    r = coefficients[THRESHOLDS : THRESHOLDS + n]
    rate = coefficients[SMOOTHING] * state[n + 1] + coefficients[RATE_GAIN] * (u - state[n])
    y = coefficients[OFFSET]
    for i in range(n):
        s = min(max(state[i], u - r[i]), u + r[i])
        y += (coefficients[THRESHOLDS + 2 * n + i] + rate * coefficients[THRESHOLDS + n + i]) * s
    return y


@kernel
def rate_pi_advance(u: float, coefficients: Array, state: Array) -> None:
    """Update the state to an input."""
    n = state.size - 2
    for i in range(n):
        r = coefficients[THRESHOLDS + i]
        state[i] = min(max(state[i], u - r), u + r)
    state[n + 1] = coefficients[SMOOTHING] * state[n + 1] + coefficients[RATE_GAIN] * (u - state[n])
    state[n] = u


@kernel
def rate_pi_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at rest, at the first input."""
    n = state.size - 2
    start_operators(
        coefficients[THRESHOLDS : THRESHOLDS + n], inputs[0], inputs[0], virgin, state[:n]
    )
    state[n], state[n + 1] = inputs[0], 0.0


@dataclass(frozen=True, config=fields.STRICT)
class RateDependentPI(fields.WithMemory, Invertible):
    """Prandtl-Ishlinskii model whose weights are linear in the input's rate.

    Parameters
    ----------
    thresholds : sequence of float, length N
        Thresholds, in the unit of the input: 0 <= r_0 < r_1 < ...
    rate_weights : sequence of float, length N
        k_i, output per input per rate.
    weights : sequence of float, length N
        d_i, output per input at rest. The inverse requires r_0 = 0 and positive partial sums.
    offset : float
        Constant of the output.
    rate_time_constant : float
        Time constant of the filter of the rate [s]; 0, as in the paper, for none.
    input_range : (float, float), optional
        Lowest and highest input; the inverse needs it and clips there.
    """

    kind = "rate-dependent-pi"
    settable: ClassVar[Mapping[str, str | None]] = {"rate_time_constant": None}
    solved = True
    start_kernel = rate_pi_start
    kernel, inverse_kernel, inverse_start_kernel = solved_kernels(
        rate_pi_output, rate_pi_advance, rate_pi_start
    )
    inverse_memory = "input"
    rate_dependent = True
    increasing = ("thresholds",)
    same_length = ("thresholds", "rate_weights", "weights")
    parameters = ("rate_weights", "weights", "offset")
    typical = (
        *((0.0, 0.3, 0.8, 1.5), (-0.05, 0.02, 0.04, 0.01), (3.0, 1.5, 1.0, 0.5)),
        *(2.0, 0.1, (0.0, 5.0)),
    )
    n_states = one_per("thresholds", 2)  # operators, previous input and filtered rate
    formulas = (
        r"y = y_0 + \sum_i (d_i + k_i v) F_{r_i}[u],\quad T \dot{v} = \dot{u} - v",
        r"F_r[u]_t = \min(\max(F_r[u]_{t-1},\, u_t - r),\, u_t + r)",
    )

    thresholds: Annotated[fields.Thresholds, "r_i [{u}]"]
    rate_weights: Annotated[fields.Vector, "k_i [{y} s/{u}^2]"]
    weights: Annotated[fields.Vector, "d_i [{y}/{u}]"]
    offset: Annotated[FiniteFloat, "y_0 [{y}]"] = 0.0
    rate_time_constant: Annotated[fields.NotNegative, "T [s]"] = 0.0
    input_range: fields.InputRange | None = None

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [smoothing, gain of the rate, offset, thresholds, k, d]."""
        rate = rate_filter(self.rate_time_constant, needs_sample_time(self.kind, sample_time))
        sums = (*self.thresholds, *self.rate_weights, *self.weights)
        return np.array([*rate, self.offset, *sums])

    def check_invertible(self) -> None:
        check_invertible_sum(self.kind, self.thresholds, self.weights)
        super().check_invertible()

    def stored_for_inverse(self, state: Array) -> tuple[float, ...]:
        return (float(state[-2]),)

    def reachable(self) -> tuple[Array, Array]:
        """Return the outputs that are reachable at rest from every state."""
        at_rest = PI(self.thresholds, self.weights, self.offset, self.input_range)
        return at_rest.reachable()
