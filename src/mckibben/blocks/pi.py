"""The classical Prandtl-Ishlinskii (PI) model: a weighted sum of play operators, and its inverse.

y_t = y_0 + sum_i w_i F_{r_i}[u]_t, with r_0 = 0 so that the first term is the reversible part.

Source: "Analysis and modeling of a pneumatic artificial muscle system", Eqs. (12), (13). The inverse
is known to be a PI model too; here it is found by walking the same piecewise-linear relation from
the operators' states, which is as exact, touches only the operators that move, and stays consistent
when a reference has to be clipped.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.blocks.base import Kernel, Primitive
from mckibben.blocks.fields import (
    DISPLACEMENT,
    PRESSURE,
    STRICT,
    ChannelField,
    Initial,
    Rule,
    StoredInitial,
    Vector,
)
from mckibben.blocks.kernels import kernel, summing_kernel
from mckibben.blocks.memory import (
    check_invertible_sum,
    check_thresholds,
    follow,
    play_state,
    solve_from_rest,
)
from mckibben.blocks.refusals import parameter_vector
from mckibben.blocks.saving import nested
from mckibben.blocks.single import Inverse, Ranged, check_input_range

Array = NDArray[np.float64]


@summing_kernel
def pi_kernel(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run a PI model; coefficients are [offset, thresholds, weights]."""
    n = state.size
    offset = coefficients[0]
    r = coefficients[1 : n + 1]
    w = coefficients[n + 1 :]
    for t in range(inputs.shape[0]):
        u = inputs[t, 0]
        y = 0.0
        for i in range(n):
            s = min(max(state[i], u - r[i]), u + r[i])
            state[i] = s
            y += w[i] * s
        outputs[t, 0] = offset + y


@kernel
def pi_inverse_kernel(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Invert a PI model; coefficients are [lowest, highest input, offset, thresholds, weights].

    The state is [forward operators, previous reference, samples clipped].
    """
    n = state.size - 2
    lowest, highest, offset = coefficients[0], coefficients[1], coefficients[2]
    r = coefficients[3 : n + 3]
    w = coefficients[n + 3 :]
    s = state[:n]
    for t in range(inputs.shape[0]):
        y = inputs[t, 0]
        _, clipped = follow(y - offset, state[n] - offset, lowest, highest, r, w, s)
        if clipped:
            state[n + 1] += 1.0
        state[n] = y
        outputs[t, 0] = s[0]


@dataclass(frozen=True, config=STRICT)
class PI(Ranged, Primitive):
    """Classical Prandtl-Ishlinskii model.

    Parameters
    ----------
    thresholds : sequence of float, length N
        Thresholds of the play operators, in the unit of the input: 0 <= r_0 < r_1 < ...
    weights : sequence of float, length N
        Weights, output per input. The exact inverse wants r_0 = 0 and positive partial sums.
    offset : float
        Constant of the output.
    input_range : (float, float), optional
        Lowest and highest input that may be asked for; the inverse clips there. Default none.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "pi"
    kernel: ClassVar[Kernel] = pi_kernel

    thresholds: Vector
    weights: Vector
    offset: FiniteFloat = 0.0
    input_range: tuple[FiniteFloat, FiniteFloat] | None = None
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        check_thresholds(self.kind, self.thresholds, self.weights)
        check_input_range(self.kind, self.input_range)

    @property
    def n_states(self) -> int:
        """One a play operator."""
        return len(self.thresholds)

    @property
    def n_parameters(self) -> int:
        """The weights and the offset; thresholds are structure."""
        return len(self.weights) + 1

    def pack(self) -> Array:
        """Return [weights, offset]."""
        return np.array([*self.weights, self.offset])

    def unpack(self, parameters: ArrayLike) -> Self:
        """Return a model with the same thresholds and other weights and offset."""
        *weights, offset = parameter_vector(self, parameters).tolist()
        return replace(self, weights=tuple(weights), offset=offset)

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the operators' outputs before the first sample, shape (N,)."""
        start = self.initial if initial is None else initial
        return play_state(self, np.array(self.thresholds), first[0], first[0], start)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [offset, thresholds, weights]."""
        del sample_time
        return np.array([self.offset, *self.thresholds, *self.weights])

    def peaks(self) -> Array:
        """Return the peaks from which the operators just come back to the lowest input."""
        return self.limits[0] + 2 * np.array(self.thresholds)

    def inverse(self) -> PIInverse:
        """Return the exact inverse.

        Raises
        ------
        ModelError
            If the first threshold is not 0 or a partial sum of the weights is not positive.
        """
        return PIInverse(self)

    @classmethod
    def example(cls) -> Self:
        """Return the shape of a small muscle's loop over 0 to 5 bar."""
        return cls((0.0, 0.3, 0.8, 1.5), (3.0, 1.5, 1.0, 0.5), 2.0, (0.0, 5.0))


@dataclass(frozen=True, config=STRICT)
class PIInverse(Inverse, Primitive):
    """Exact inverse of a `PI` model.

    Parameters
    ----------
    forward : PI
        The model inverted.
    """

    kind: ClassVar[str] = "pi-inverse"
    kernel: ClassVar[Kernel] = pi_inverse_kernel

    forward: Annotated[PI, BeforeValidator(nested)]

    def __post_init__(self) -> None:
        check_invertible_sum(PI.kind, self.forward.thresholds, self.forward.weights)

    @property
    def n_states(self) -> int:
        """The forward model's, the previous reference, and the count of clipped samples."""
        return self.forward.n_states + 2

    def matching_state(self, first: float, start: Rule) -> Array:
        """Return the state of the inverse of a forward model started by a named rule."""
        forward = self.forward
        r, w = np.array(forward.thresholds), np.array(forward.weights)
        lowest, highest = forward.limits
        if start == "virgin":
            states = solve_from_rest(first - forward.offset, lowest, highest, r, w)
            return np.array([*states, first, 0.0])
        risen = (first - forward.offset + w @ r) / w.sum()
        u = min(max(risen, lowest), highest)
        return np.array([*(u - r), first, 0.0])

    def state_from_forward(self, state: Array) -> Array:
        """Return the state that matches a state of the forward model."""
        return np.array([*state, self.forward.offset + np.dot(self.forward.weights, state), 0.0])

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [lowest, highest input, offset, thresholds, weights]."""
        del sample_time
        forward = self.forward
        return np.array([*forward.limits, forward.offset, *forward.thresholds, *forward.weights])

    @classmethod
    def example(cls) -> Self:
        """Return the inverse of the example PI model."""
        return cls(PI.example())
