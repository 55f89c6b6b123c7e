"""Inverses without a closed form: one root a sample, for blocks whose output rises with their input.

The block gives two compiled functions: ``trial(u, memory)``, the output that an input would give, and
``advance(u, coefficients, state)``, which takes that step. The inverse takes the block's coefficients,
then its lowest and highest input; and its state, then the last input and the count of samples clipped.
What is solved for is exact to rounding: the bracket is closed until
nothing lies between its ends.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from mckibben.arrays import Array
from mckibben.blocks.core.block import Start
from mckibben.blocks.core.exportable import Cost
from mckibben.blocks.core.kernels import DERIVED, improved, inlined, kernel
from mckibben.blocks.core.root import solve_near
from mckibben.blocks.core.single_channel import Ranged
from mckibben.errors import ModelError

MOST_HALVED = 200
"""Steps of bisection, far more than it takes."""


@inlined
def solve_input(trial: Any, coefficients: Array, state: Array, inputs: Array) -> float:
    """Return the input for which the forward block follows the reference, and remember it."""
    n = state.size - 2
    lowest, highest = coefficients[-2], coefficients[-1]
    forward, own = coefficients[:-2], state[:n]
    u, clipped = solve_near(trial, inputs[0], state[n], lowest, highest, (forward, own))
    if DERIVED and lowest < u < highest:
        u = improved(trial, inputs[0], u, (forward, own))
    state[n] = u
    if clipped:
        state[n + 1] += 1.0
    return u


@inlined
def solve_sample(
    trial: Any, advance: Any, coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Give the input for which the forward block follows the reference, and take that step."""
    u = solve_input(trial, coefficients, state, inputs)
    advance(u, coefficients[:-2], state[:-2])
    outputs[0] = u


def solved_start(trial: Callable[..., float], start: Start, behind: int = 2) -> Start:
    """Return the start kernel of an inverse that is solved for: by bisection, the first input that fits.

    ``start`` is that of the block, behind whose state the inverse has 2 numbers, the last input and the
    count of samples clipped, or the count alone.
    """

    @kernel
    def first_output(u: float, memory: tuple[Array, Array, Array, Array]) -> float:
        """Return the first output at an input, of derivatives."""
        forward, own, given, rule = memory
        given[0] = u
        start(forward, own, given, rule[0] > 0.0)
        return trial(u, (forward, own))

    @kernel
    def inverse_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
        """Start with the input, within its limits, at which the block has the first reference."""
        own, forward = state[: state.size - behind], coefficients[:-2]
        u = state[state.size - behind :]
        low, high = coefficients[-2], coefficients[-1]
        u[0] = high
        start(forward, own, u, virgin)
        if trial(high, (forward, own)) <= inputs[0]:
            low = high
        u[0] = coefficients[-2]
        start(forward, own, u, virgin)
        if trial(u[0], (forward, own)) >= inputs[0]:
            low, high = coefficients[-2], coefficients[-2]
        for _ in range(MOST_HALVED):
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            u[0] = middle
            start(forward, own, u, virgin)
            if trial(middle, (forward, own)) < inputs[0]:
                low = middle
            else:
                high = middle
        u[0] = 0.5 * (low + high)
        if DERIVED and coefficients[-2] < u[0] < coefficients[-1]:
            rule = state[state.size - 1 :]
            rule[0] = 1.0 if virgin else 0.0
            u[0] = improved(first_output, inputs[0], u[0], (forward, own, u, rule))
        start(forward, own, u, virgin)
        state[-1] = 0.0

    return inverse_start


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
