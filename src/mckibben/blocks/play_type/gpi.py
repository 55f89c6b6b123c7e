"""The generalised Prandtl-Ishlinskii (GPI) model, for asymmetric and saturating loops, and its inverse.

Operators play between two envelopes, gamma_R on rising and gamma_L on falling input:
w_t = max(gamma_R(u_t) - r, w_{t-1}) when u rises, min(gamma_L(u_t) + r, w_{t-1}) when it falls, and
w_{t-1} when it stands still; the output is y = sum_i x_i w_i.

The inverse finds the common envelope value z at which the weighted sum equals the reference, then
u = gamma_R^{-1}(z) while the reference rises and gamma_L^{-1}(z) while it falls. At a reversal z is
continuous while u jumps across the dead zone between the envelopes, where every operator holds, so
the inverse stays exact through minor loops.

The paper starts operators from f_r(u_0, 0), Eq. (1), without saying which branch a first sample takes.
Both together leave one meaning: 0, moved no further than into [gamma_R(u_0) - r, gamma_L(u_0) + r],
which is the rule ``virgin``. ``first_sample`` takes gamma_R(u_0) - r, as if the input had only risen.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Eqs. (1) to (7), the inverse Eqs. (16) to (20).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.adaptive.adaptable import Learning
from mckibben.blocks.adaptive.operators import LearntOperators
from mckibben.blocks.core.block import Run
from mckibben.blocks.core.fields import (
    DISPLACEMENT,
    PRESSURE,
    STRICT,
    ChannelField,
    Initial,
    Rule,
    StoredInitial,
    Vector,
)
from mckibben.blocks.core.kernels import kernel, summing_kernel
from mckibben.blocks.core.notation import Notation
from mckibben.blocks.core.refusals import explicit_state
from mckibben.blocks.core.single_channel import check_input_range
from mckibben.blocks.play_type.envelopes.base import Envelope, nested_envelope
from mckibben.blocks.play_type.envelopes.tanh import Tanh
from mckibben.blocks.play_type.memory import (
    check_invertible_sum,
    check_thresholds,
    follow,
    play_state,
    solve_from_rest,
)
from mckibben.errors import ModelError
from mckibben.system.compiling import bound, in_turn

EnvelopeField = Annotated[InstanceOf[Envelope], BeforeValidator(nested_envelope)]


@summing_kernel
def gpi_kernel(
    coefficients: Array, state: Array, inputs: Array, rising: Array, falling: Array, outputs: Array
) -> None:
    """Run a GPI model, given its envelopes at every sample; coefficients are [thresholds, weights].

    The state is [operators, previous input].
    """
    n = state.size - 1
    r = coefficients[:n]
    w = coefficients[n:]
    previous = state[n]
    for t in range(inputs.size):
        u = inputs[t]
        lower = rising[t] if u > previous else -np.inf
        upper = falling[t] if u < previous else np.inf
        y = 0.0
        for i in range(n):
            s = min(max(state[i], lower - r[i]), upper + r[i])
            state[i] = s
            y += w[i] * s
        outputs[t, 0] = y
        previous = u
    state[n] = previous


@kernel
def gpi_matrix(
    u: Array, rising: Array, falling: Array, r: Array, s: Array, operators: Array
) -> None:
    """Run generalised play operators side by side: ``operators[t, i]`` is operator i after sample t.

    Shapes: u, rising and falling (n,), r and s (N,), operators (n, N). Changes the states ``s``, which
    are those after the first sample: nothing moves before the second.
    """
    previous = u[0]
    for t in range(u.size):
        lower = rising[t] if u[t] > previous else -np.inf
        upper = falling[t] if u[t] < previous else np.inf
        for i in range(r.size):
            s[i] = min(max(s[i], lower - r[i]), upper + r[i])
            operators[t, i] = s[i]
        previous = u[t]


@kernel
def gpi_inverse_kernel(
    coefficients: Array, state: Array, references: Array, z: Array, direction: Array
) -> None:
    """Find the common envelope value z and the direction of the input, for every reference.

    Coefficients are [lowest, highest z, thresholds, weights]; the state is [operators, previous
    input, previous reference, samples clipped].
    """
    n = state.size - 3
    lowest, highest = coefficients[0], coefficients[1]
    r = coefficients[2 : n + 2]
    w = coefficients[n + 2 :]
    s = state[:n]
    for t in range(references.size):
        y = references[t]
        direction[t], clipped = follow(y, state[n + 1], lowest, highest, r, w, s)
        if clipped:
            state[n + 2] += 1.0
        state[n + 1] = y
        z[t] = s[0]


@kernel
def choose_branch(
    limits: Array, state: Array, direction: Array, rising: Array, falling: Array, inputs: Array
) -> None:
    """Take the input from the envelope of the direction, or hold it; limits are [lowest, highest]."""
    n = state.size - 3
    u = state[n]
    for t in range(direction.size):
        if direction[t] > 0.0:
            u = min(max(rising[t], limits[0]), limits[1])
        elif direction[t] < 0.0:
            u = min(max(falling[t], limits[0]), limits[1])
        inputs[t, 0] = u
    state[n] = u


@dataclass(frozen=True, config=STRICT)
class GPI(LearntOperators):
    """Generalised Prandtl-Ishlinskii model.

    Parameters
    ----------
    thresholds : sequence of float, length N + 1
        Thresholds on the envelopes' values: 0 <= r_0 < r_1 < ...
    weights : sequence of float, length N + 1
        Weights, output per unit of the envelopes. The inverse wants r_0 = 0 and positive partial
        sums.
    rising, falling : Envelope
        gamma_R and gamma_L. The inverse wants gamma_L >= gamma_R over the input range.
    input_range : (float, float)
        Lowest and highest input, over which the conditions hold and to which the inverse clips.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "gpi"
    inverse_remembers = "output"
    increasing = ("thresholds",)
    parameters: ClassVar[tuple[str, ...]] = ("weights", "rising", "falling")
    notation: ClassVar[Notation] = Notation(
        r"y = \sum_i x_i w_i",
        r"w_{i,t} = \begin{cases} \max(\gamma_R(u_t) - r_i,\, w_{i,t-1}) & u \text{ "
        r"rises} \\ \min(\gamma_L(u_t) + r_i,\, w_{i,t-1}) & u \text{ falls} \end{cases}",
        thresholds="r_i",
        weights="x_i [{y}]",
    )

    thresholds: Vector
    weights: Vector
    rising: EnvelopeField
    falling: EnvelopeField
    input_range: tuple[FiniteFloat, FiniteFloat]
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        check_thresholds(self.kind, self.thresholds, self.weights)
        check_input_range(self.kind, self.input_range)

    @property
    def n_states(self) -> int:
        """One an operator, and the previous input."""
        return len(self.thresholds) + 1

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the operators' outputs and the first input, shape (N + 2,)."""
        start = self.initial if initial is None else initial
        if not isinstance(start, str) and len(start) == self.n_states:
            return explicit_state(self, start)
        r = np.array(self.thresholds)
        rising, falling = self.rising(first)[0], self.falling(first)[0]
        return np.array([*play_state(self, r, rising, falling, start), first[0]])

    def coefficients(self, sample_time: float | None) -> Array:
        """Return what C reads: [kinds and sizes of envelopes, thresholds, weights, envelopes]."""
        del sample_time
        envelopes = (self.rising, self.falling)
        numbers = [envelope.coefficients() for envelope in envelopes]
        head = [
            float(part)
            for envelope, own in zip(envelopes, numbers, strict=True)
            for part in (envelope.number, own.size)
        ]
        return np.array([*head, *self.thresholds, *self.weights, *numbers[0], *numbers[1]])

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that evaluates both envelopes, then runs the operators."""
        del sample_time
        coefficients = np.array([*self.thresholds, *self.weights])
        u = inputs.reshape(-1)
        rising, falling = np.empty(u.size), np.empty(u.size)
        up, down = type(self.rising).value, type(self.falling).value
        up_coefficients, down_coefficients = self.rising.coefficients(), self.falling.coefficients()

        return in_turn(
            bound(up, up_coefficients, u, rising),
            bound(down, down_coefficients, u, falling),
            bound(gpi_kernel, coefficients, state, u, rising, falling, outputs),
        )

    def kept_apart(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        """Give the thresholds, and the knots of the envelopes that have some."""
        yield from super().kept_apart()
        for envelope in (self.rising, self.falling):
            yield from ((name, getattr(envelope, name)) for name in envelope.increasing)

    def peaks(self) -> Array:
        """Return the peaks from which the operators just come back to the lowest input."""
        low, high = self.limits
        edges = self.falling(low) + 2 * np.array(self.thresholds)
        inside = edges[edges < self.rising(high)]
        return np.asarray(self.rising.solve(inside))

    def check_invertible(self) -> None:
        """Demand a first threshold of 0, an increasing sum, and envelopes in order within the limits."""
        check_invertible_sum(self.kind, self.thresholds, self.weights)
        gap, where = smallest_gap(self.rising, self.falling, self.input_range)
        if gap < 0:
            raise ModelError(
                f"'gpi' has no inverse: at {where:.4g} {self.input.unit} its falling envelope is "
                f"{-gap:.3g} below the rising one. Remedy: identify it with mckibben fit gpi, which "
                "keeps them in order."
            )

    @property
    def whole_changes(self) -> Array:
        """What is reached, the width of the widest loop, and what is reached."""
        return np.array([self.span, 2 * np.dot(self.weights, self.thresholds), self.span])

    def inverse_numbers(self, own: Array) -> Array:
        """Return [lowest, highest input], then this model's."""
        return np.array([*self.limits, *own])

    def inverse_start(self, first: Array, start: Rule) -> Array:
        """Return [operators, previous input, previous reference, samples clipped]."""
        output = float(first[0])
        r, w = np.array(self.thresholds), np.array(self.weights)
        low, high = self.input_range
        envelope, highest = self.rising, float(self.rising(high))
        if start == "virgin":
            states = solve_from_rest(output, float(self.falling(low)), highest, r, w)
            envelope = self.falling if output < 0 else self.rising
        else:
            risen = (output + w @ r) / w.sum()
            states = min(max(risen, float(self.rising(low))), highest) - r
        u = float(np.clip(envelope.solve(states[0]), low, high))
        return np.array([*states, u, output, 0.0])

    def remembered(self, state: Array) -> tuple[float, ...]:
        """Return the output."""
        return (np.dot(self.weights, state[:-1]),)

    def bind_inverse(
        self, sample_time: float | None, state: Array, inputs: Array, outputs: Array
    ) -> Run:
        """Return a function that solves for z, then inverts the envelopes."""
        del sample_time
        operators = np.array([*self.learnt_limits, *self.thresholds, *self.weights])
        references = inputs.reshape(-1)
        z, direction = np.empty(references.size), np.empty(references.size)
        solve = bound(gpi_inverse_kernel, operators, state, references, z, direction)
        return in_turn(solve, *self._bind_branches(state, z, direction, outputs))

    @property
    def learnt_limits(self) -> tuple[float, float]:
        """What the envelopes make of the lowest and highest input."""
        low, high = self.input_range
        return float(self.falling(low)), float(self.rising(high))

    def retaught(self, theta: Array) -> GPI:
        """Return the model with other weights; it has no offset."""
        return replace(self, weights=tuple(theta[:-1].tolist()))

    def added(self, theta: Array) -> float:
        """Return the offset."""
        return float(theta[-1])

    def bind_adaptive(
        self,
        sample_time: float | None,
        learning: Learning,
        state: Array,
        inputs: Array,
        measured: Array,
        outputs: Array,
    ) -> Run:
        """Return a function that learns and solves for z, then inverts the envelopes."""
        del sample_time
        n, length = len(self.thresholds), inputs.shape[0]
        s, last = state[:n], state[n + 1 :]
        z, direction = np.empty(length), np.empty(length)
        learn = self._bind_operators(learning, s, last, inputs, measured, z, direction)
        return in_turn(learn, *self._bind_branches(state[: n + 3], z, direction, outputs))

    def _bind_branches(self, state: Array, z: Array, direction: Array, outputs: Array) -> list[Run]:
        rising, falling = np.empty(z.size), np.empty(z.size)
        up, down = self.rising, self.falling
        limits = np.array(self.input_range)
        return [
            bound(type(up).inverse, up.coefficients(), z, rising),
            bound(type(down).inverse, down.coefficients(), z, falling),
            bound(choose_branch, limits, state, direction, rising, falling, outputs),
        ]

    @classmethod
    def example(cls) -> Self:
        """Return a saturating, asymmetric loop over 0 to 5 bar."""
        return cls((0.0, 0.1, 0.3, 0.5), (9.0, 4.0, 2.0, 1.0), *Tanh.examples(), (0.0, 5.0))


def smallest_gap(
    rising: Envelope, falling: Envelope, input_range: tuple[float, float]
) -> tuple[float, float]:
    """Return the smallest of gamma_L - gamma_R over the input range, and the input where it is."""
    low, high = input_range
    for _ in range(4):
        u = np.linspace(low, high, 1025)
        gaps = falling(u) - rising(u)
        best = int(np.argmin(gaps))
        low, high = u[max(best - 1, 0)], u[min(best + 1, u.size - 1)]
    return float(gaps[best]), float(u[best])
