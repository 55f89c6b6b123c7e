"""The generalized Prandtl-Ishlinskii (GPI) model, for asymmetric and saturating loops, and its inverse.

Operators play between two envelopes, gamma_R on rising and gamma_L on falling input:
w_t = max(gamma_R(u_t) - r, w_{t-1}) when u rises, min(gamma_L(u_t) + r, w_{t-1}) when it falls, and
w_{t-1} when it is constant; the output is y = sum_i x_i w_i.

The inverse finds the common envelope value z at which the weighted sum equals the reference, then
u = gamma_R^{-1}(z) while the reference rises and gamma_L^{-1}(z) while it falls. At a reversal z is
continuous while u jumps across the dead zone between the envelopes, where every operator holds.

Operators start from f_r(u_0, 0), Eq. (1), with the rule ``virgin``: 0, moved no further than into
[gamma_R(u_0) - r, gamma_L(u_0) + r]. ``first_sample`` takes gamma_R(u_0) - r.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Eqs. (1) to (7), the inverse Eqs. (16) to (20).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.hysteresis.envelopes import Envelope, Tanh, nested_envelope
from mckibben.blocks.hysteresis.play_operators import (
    check_invertible_sum,
    follow,
    start_operators,
    start_sum,
)
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import inlined, kernel, step, summing_step
from mckibben.blocks.learning import Learnable, learnable_operators, learning_kernels
from mckibben.blocks.memoryless import Affine
from mckibben.blocks.parameters import one_per
from mckibben.errors import ModelError

EnvelopeField = Annotated[InstanceOf[Envelope], BeforeValidator(nested_envelope)]


@cache
def kernels_of(rising: type[Envelope], falling: type[Envelope]) -> tuple[Any, ...]:
    """Return step and start kernels for two kinds of envelopes: forward, inverse and adaptive.

    Coefficients are [size of the rising envelope, thresholds, weights, rising, falling], and of the
    inverse [lowest, highest input] before. The state is [operators, previous input], and of the inverse
    also [previous reference, samples clipped].
    """
    rising_at, rising_from = rising.value, rising.inverse
    falling_at, falling_from = falling.value, falling.inverse

    @inlined
    def rising_edge(u: float, c: Array, n: int) -> float:
        return rising_at(u, c[2 * n + 1 : 2 * n + 1 + int(c[0])])

    @inlined
    def falling_edge(u: float, c: Array, n: int) -> float:
        return falling_at(u, c[2 * n + 1 + int(c[0]) :])

    @summing_step
    def gpi_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        """Run a GPI model."""
        n = state.size - 1
        r, w = coefficients[1 : n + 1], coefficients[n + 1 : 2 * n + 1]
        u = inputs[0]
        y = 0.0
        if u > state[n]:
            edge = rising_edge(u, coefficients, n)
            for i in range(n):
                state[i] = max(state[i], edge - r[i])
                y += w[i] * state[i]
        else:
            edge = falling_edge(u, coefficients, n) if u < state[n] else np.inf
            for i in range(n):
                state[i] = min(state[i], edge + r[i])
                y += w[i] * state[i]
        state[n] = u
        outputs[0] = y

    @kernel
    def gpi_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
        """Start a GPI model before its first sample."""
        n = state.size - 1
        u, c = inputs[0], coefficients
        up, down = rising_edge(u, c, n), falling_edge(u, c, n)
        start_operators(c[1 : n + 1], up, down, virgin, state[:n])
        state[n] = u

    @inlined
    def go(way: float, c: Array, state: Array, n: int) -> float:
        """Move to the input, within limits, at which the envelope of a direction reaches the edge."""
        first = 2 * n + 3 + int(c[2])
        if way > 0.0:
            state[n] = min(max(rising_from(state[0], c[2 * n + 3 : first]), c[0]), c[1])
        elif way < 0.0:
            state[n] = min(max(falling_from(state[0], c[first:]), c[0]), c[1])
        return state[n]

    @step
    def gpi_inverse_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        """Advance the inverse: find the operators' common edge, then the input from the envelope."""
        n, c = state.size - 3, coefficients[2:]
        r, w = c[1 : n + 1], c[n + 1 : 2 * n + 1]
        lowest = falling_edge(coefficients[0], c, n)
        highest = rising_edge(coefficients[1], c, n)
        way, clipped = follow(inputs[0], state[n + 1], lowest, highest, r, w, state[:n])
        if clipped:
            state[n + 2] += 1.0
        state[n + 1] = inputs[0]
        outputs[0] = go(way, coefficients, state, n)

    @kernel
    def gpi_inverse_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
        """Start the inverse of a GPI model before its first reference."""
        n, c = state.size - 3, coefficients[2:]
        r, w = c[1 : n + 1], c[n + 1 : 2 * n + 1]
        low, y = coefficients[0], inputs[0]
        lowest = falling_edge(low, c, n) if virgin else rising_edge(low, c, n)
        start_sum(y, lowest, rising_edge(coefficients[1], c, n), r, w, virgin, state[:n])
        go(-1.0 if virgin and y < 0.0 else 1.0, coefficients, state, n)
        state[n + 1], state[n + 2] = y, 0.0

    forward = (gpi_step, gpi_start, gpi_inverse_step, gpi_inverse_start)
    return *forward, *learning_kernels(gpi_inverse_start, go, 1)


def of_envelopes(place: int) -> Any:
    """Return a property: one of the kernels for a model's kinds of envelopes."""

    def kernel_of(model: GPI) -> Any:
        kinds: Any = (type(model.rising), type(model.falling))
        return kernels_of(*kinds)[place]

    return property(kernel_of)


def smallest_gap(
    rising: Envelope, falling: Envelope, input_range: tuple[float, float]
) -> tuple[float, float]:
    """Return the smallest gamma_L - gamma_R over the input range, and its input."""
    low, high = input_range
    for _ in range(4):
        u = np.linspace(low, high, 1025)
        gaps = falling(u) - rising(u)
        best = int(np.argmin(gaps))
        low, high = u[max(best - 1, 0)], u[min(best + 1, u.size - 1)]
    return float(gaps[best]), float(u[best])


@dataclass(frozen=True, config=fields.STRICT)
class GPI(fields.WithMemory, Invertible):
    """Generalized Prandtl-Ishlinskii model.

    Parameters
    ----------
    thresholds : sequence of float, length N + 1
        Thresholds on the envelopes' values: 0 <= r_0 < r_1 < ...
    weights : sequence of float, length N + 1
        Weights, output per unit of the envelopes. The inverse requires r_0 = 0 and positive partial
        sums.
    rising, falling : Envelope
        gamma_R and gamma_L. The inverse requires gamma_L >= gamma_R over the input range.
    input_range : (float, float)
        Lowest and highest input, over which the conditions hold and to which the inverse clips.
    """

    kind = "gpi"
    kernel, start_kernel, inverse_kernel, inverse_start_kernel = map(of_envelopes, range(4))
    adaptive_step, adaptive_start = map(of_envelopes, (4, 5))
    inverse_memory = "output"
    increasing = ("thresholds",)
    same_length = ("thresholds", "weights")
    parameters = ("weights", "rising", "falling")
    n_states = one_per("thresholds", 1)  # and the previous input
    typical = ((0.0, 0.1, 0.3, 0.5), (9.0, 4.0, 2.0, 1.0), *Tanh.examples(), (0.0, 5.0))
    formulas = (
        r"y = \sum_i x_i w_i",
        r"w_{i,t} = \begin{cases} \max(\gamma_R(u_t) - r_i,\, w_{i,t-1}) & u \text{ "
        r"rises} \\ \min(\gamma_L(u_t) + r_i,\, w_{i,t-1}) & u \text{ falls} \end{cases}",
    )

    thresholds: Annotated[fields.Thresholds, "r_i"]
    weights: Annotated[fields.Vector, "x_i [{y}]"]
    rising: EnvelopeField
    falling: EnvelopeField
    input_range: fields.InputRange

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [size of the rising envelope, thresholds, weights, rising, falling]."""
        up, down = self.rising.coefficients(), self.falling.coefficients()
        return np.array([up.size, *self.thresholds, *self.weights, *up, *down])

    def strictly_increasing(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        """Yield the thresholds, and the knots of piecewise-linear envelopes."""
        yield from super().strictly_increasing()
        for envelope in (self.rising, self.falling):
            yield from ((name, getattr(envelope, name)) for name in envelope.increasing)

    def peaks(self) -> Array:
        """Return the peaks from which each operator just returns to the lowest input."""
        low, high = self.input_limits
        edges = self.falling(low) + 2 * np.array(self.thresholds)
        return np.asarray(self.rising.solve(edges[edges < self.rising(high)]))

    def check_invertible(self) -> None:
        check_invertible_sum(self.kind, self.thresholds, self.weights)
        gap, where = smallest_gap(self.rising, self.falling, self.input_range)
        if gap < 0:
            raise ModelError(
                f"'gpi' has no inverse: at {where:.4g} {self.input.unit} its falling "
                f"envelope is {-gap:.3g} below the rising one",
                remedy="identify it with `fit()`, which constrains their order",
            )

    def inverse_numbers(self, own: Array) -> Array:
        return np.array([*self.input_limits, *own])

    def stored_for_inverse(self, state: Array) -> tuple[float, ...]:
        return (np.dot(self.weights, state[:-1]),)

    @property
    def learnable(self) -> Learnable:
        """Adaptive parameters: weights, and an additional offset."""
        low, high = self.input_range
        limits = float(self.falling(low)), float(self.rising(high))

        def with_parameters(theta: Array) -> Block:
            changed, offset = replace(self, weights=fields.vector(theta[:-1])), float(theta[-1])
            shift = Affine(1.0, offset, self.output, self.output)
            return Series((changed, shift)) if offset else changed

        operators, adaptive = (
            (self.thresholds, self.weights),
            (self.adaptive_step, self.adaptive_start),
        )
        return learnable_operators(self, *operators, limits, 0.0, *adaptive, with_parameters)
