"""Inverses without a closed form: one root a sample, for blocks whose output rises with their input.

The forward block gives two compiled functions: ``trial(u, memory)``, the output that an input would
give, and ``advance(u, coefficients, state)``, which takes that step. The inverse takes the forward
block's coefficients, then its lowest and highest input; and its state, then the last input and the
count of samples clipped. What is solved for is exact to rounding: the bracket is closed until
nothing lies between its ends.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Primitive
from mckibben.blocks.fields import Rule
from mckibben.blocks.kernels import inlined
from mckibben.blocks.root import solve_near
from mckibben.blocks.single import Inverse
from mckibben.errors import ModelError

Array = NDArray[np.float64]


@inlined
def solve_samples(
    trial: Any, advance: Any, coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Give the inputs for which the forward block follows the references."""
    n = state.size - 2
    lowest, highest = coefficients[-2], coefficients[-1]
    forward, own = coefficients[:-2], state[:n]
    for t in range(inputs.shape[0]):
        u, clipped = solve_near(trial, inputs[t, 0], state[n], lowest, highest, (forward, own))
        advance(u, forward, own)
        state[n] = u
        if clipped:
            state[n + 1] += 1.0
        outputs[t, 0] = u


class SolvedInverse(Inverse, Primitive):
    """The inverse of a single-channel block that is solved for in every sample."""

    def __post_init__(self) -> None:
        forward = self.forward
        if forward.input_range is None:
            raise ModelError(
                f"{forward.kind!r} has no inverse without an input range. Remedy: give input_range."
            )
        steepness = forward.least_slope()
        if not steepness > 0:
            raise ModelError(
                f"{forward.kind!r} has no inverse: its output may fall while its input rises (least "
                f"slope {steepness:.3g}). Remedy: identify it with nonnegative=true where it has that "
                "setting, or invert another model."
            )

    @property
    def n_states(self) -> int:
        """The forward block's, the last input, and the count of samples clipped."""
        return int(self.forward.n_states) + 2

    def matching_state(self, first: float, start: Rule) -> Array:
        """Return the state of the inverse of a forward block started by a named rule.

        The input is sought by bisection whose first output is the first reference.
        """
        low, high = self.forward.limits

        def output(u: float) -> float:
            return float(self.forward.simulate([u], initial=start, sample_time=1.0)[0])

        below, above = low, high
        for _ in range(200):
            middle = 0.5 * (below + above)
            if middle in (below, above):
                break
            below, above = (middle, above) if output(middle) < first else (below, middle)
        u = (
            low
            if output(low) >= first
            else high
            if output(high) <= first
            else 0.5 * (below + above)
        )
        state = self.forward.initial_state(np.array([u]), start)
        return np.array([*state, u, 0.0])

    def state_from_forward(self, state: Array) -> Array:
        """Return the state that matches a state of the forward block."""
        return np.array([*state, self.forward.input_of(state), 0.0])

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [the forward block's, lowest, highest input]."""
        return np.array([*self.forward.coefficients(sample_time), *self.forward.limits])
