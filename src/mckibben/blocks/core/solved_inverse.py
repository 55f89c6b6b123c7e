"""Inverses without a closed form: one root a sample, for blocks whose output rises with their input.

The block gives two compiled functions: ``trial(u, memory)``, the output that an input would give, and
``advance(u, coefficients, state)``, which takes that step. The inverse takes the block's coefficients,
then its lowest and highest input; and its state, then the last input and the count of samples clipped.
What is solved for is exact to rounding: the bracket is closed until
nothing lies between its ends.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from mckibben.arrays import Array
from mckibben.blocks.core.exportable import Cost
from mckibben.blocks.core.kernels import inlined
from mckibben.blocks.core.root import solve_near
from mckibben.blocks.core.single_channel import Ranged
from mckibben.errors import ModelError


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


USUAL_TRIALS, MOST_TRIALS = 12, 600
"""On smooth references, and at worst."""


def solved_cost(trial: Cost) -> Cost:
    """Return what a step costs that is solved for by trials."""
    return Cost(USUAL_TRIALS * trial.usual, MOST_TRIALS * trial.usual)


class Solved(Ranged):
    """A single-channel block whose inverse is solved for in every sample."""

    inverse_remembers = "input"

    @abstractmethod
    def least_slope(self) -> float:
        """Return a lower bound of the slope of the output by the input."""

    def check_invertible(self) -> None:
        """Demand an input range, and that the output rises over it."""
        if self.input_range is None:
            raise ModelError(
                f"{self.kind!r} has no inverse without an input range. Remedy: give input_range."
            )
        steepness = self.least_slope()
        if not steepness > 0:
            raise ModelError(
                f"{self.kind!r} has no inverse: its output may fall while its input rises (least "
                f"slope {steepness:.3g}). Remedy: identify it with nonnegative=true where it has that "
                "setting, or invert another model."
            )

    def inverse_cost(self, sample_time: float | None) -> Cost:
        """Return what trials cost, of which there are few on smooth references."""
        return solved_cost(self.cost(sample_time))

    def remembered(self, state: Array) -> tuple[float, ...]:
        """Return the input last seen, which most keep behind all else."""
        return (float(state[-1]),)
