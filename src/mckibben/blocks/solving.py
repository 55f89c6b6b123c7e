"""Equations solved inside kernels: bracketed roots, and small linear systems.

An inverse without a closed form is solved for in every sample, for a block whose output rises with its
input. The block gives two compiled functions: ``trial(u, memory)``, the output that an input would
give, and ``advance(u, coefficients, state)``, which takes that step. The inverse takes the block's
coefficients, then its lowest and highest input; and its state, then the last input and the count of
samples clipped.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mckibben.arrays import Array
from mckibben.blocks.base import Start
from mckibben.blocks.kernels import (
    BRACKET,
    DERIVED,
    NOTHING,
    ROUNDING,
    SLACK,
    Step,
    improved,
    inlined,
    kernel,
    step,
)

MOST_STEPS = 200
"""Maximum number of steps of bisection, of closing the bracket, and of each bracketing search."""


@inlined
def solve_near(
    evaluate: Any, target: float, start: float, lowest: float, highest: float, memory: Any
) -> tuple[float, bool]:
    """Find u with ``evaluate(u, memory) == target``, nearest to ``start``, within the limits.

    Walks from ``start`` in growing steps, both ways in turn, until the target is bracketed, then closes
    the bracket by regula falsi (Illinois) and bisection until nothing lies between its ends. Returns u,
    and whether both limits were reached without a solution, by more than rounding; u is then the limit
    that came closest.
    """
    tiny = BRACKET * (highest - lowest)
    error_start = evaluate(start, memory) - target
    if abs(error_start) <= ROUNDING * abs(target):
        return start, False
    above, error_above = start, error_start
    below, error_below = start, error_start
    near, error_near, far, error_far = start, error_start, start, error_start
    direction = -1.0 if error_start > 0.0 else 1.0
    step = (highest - lowest) / 256.0
    for _ in range(2 * MOST_STEPS):
        if direction > 0.0:
            near, error_near = above, error_above
            above = min(above + step, highest)
            error_above = evaluate(above, memory) - target
            far, error_far = above, error_above
        else:
            near, error_near = below, error_below
            below = max(below - step, lowest)
            error_below = evaluate(below, memory) - target
            far, error_far = below, error_below
        if error_far == 0.0:
            return far, False
        if (error_far > 0.0) != (error_start > 0.0):
            break
        if above == highest and below == lowest:
            break
        direction = -direction
        if direction * error_start < 0.0:
            step *= 1.5
    if (error_far > 0.0) == (error_start > 0.0):
        slack = SLACK * abs(error_above - error_below)
        if abs(error_above) < abs(error_below):
            return above, abs(error_above) > slack
        return below, abs(error_below) > slack
    weight_near, weight_far = error_near, error_far
    side = 0
    for iteration in range(MOST_STEPS):
        width = far - near
        if abs(width) <= tiny:
            break
        if iteration % 3 == 2:
            u = near + 0.5 * width
        else:
            u = near - weight_near * width / (weight_far - weight_near)
            if not min(near, far) < u < max(near, far):
                u = near + 0.5 * width
        if u in (near, far):
            break
        error = evaluate(u, memory) - target
        if error == 0.0:
            return u, False
        if (error > 0.0) == (error_near > 0.0):
            near, error_near, weight_near = u, error, error
            weight_far = 0.5 * weight_far if side == 1 else error_far
            side = 1
        else:
            far, error_far, weight_far = u, error, error
            weight_near = 0.5 * weight_near if side == 2 else error_near
            side = 2
    return near if abs(error_near) < abs(error_far) else far, False


@inlined
def solve_input(trial: Any, coefficients: Array, state: Array, inputs: Array) -> float:
    """Solve for the input that reproduces the reference, and store it."""
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


def solved_inverse(
    trial: Callable[..., float], advance: Callable[..., None], start: Start
) -> tuple[Step, Start]:
    """Return step and start of a block's inverse, from its ``trial``, ``advance`` and start."""

    def inverse_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        """Solve for the input that reproduces the reference, and take that step."""
        u = solve_input(trial, coefficients, state, inputs)
        advance(u, coefficients[:-2], state[:-2])
        outputs[0] = u

    return step(inverse_step), solved_start(trial, start)


def solved_kernels(
    trial: Callable[..., float], advance: Callable[..., None], start: Start
) -> tuple[Step, Step, Start]:
    """Return the step of the block, and those of its inverse."""

    def forward_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        """Compute the output, and take the step."""
        outputs[0] = trial(inputs[0], (coefficients, state))
        advance(inputs[0], coefficients, state)

    return step(forward_step), *solved_inverse(trial, advance, start)


def solved_start(trial: Callable[..., float], start: Start, behind: int = 2) -> Start:
    """Return the start of an iterative inverse: by bisection, the first input that fits.

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
        for _ in range(MOST_STEPS):
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

    return kernel(inverse_start)


@kernel
def eliminate(matrix: Array, right: Array) -> None:
    """Solve a small linear system in place, by elimination with pivots."""
    n = right.size
    for column in range(n):
        pivot = column
        for row in range(column + 1, n):
            if abs(matrix[row, column]) > abs(matrix[pivot, column]):
                pivot = row
        if pivot != column:
            for j in range(n):
                matrix[column, j], matrix[pivot, j] = matrix[pivot, j], matrix[column, j]
            right[column], right[pivot] = right[pivot], right[column]
        scale = matrix[column, column]
        if scale == 0.0:
            scale = NOTHING
        for row in range(column + 1, n):
            factor = matrix[row, column] / scale
            for j in range(column, n):
                matrix[row, j] -= factor * matrix[column, j]
            right[row] -= factor * right[column]
    for row in range(n - 1, -1, -1):
        for j in range(row + 1, n):
            right[row] -= matrix[row, j] * right[j]
        scale = matrix[row, row]
        right[row] /= scale if scale != 0.0 else NOTHING


@inlined
def newton(
    evaluate: Any,
    slope: Any,
    target: float,
    low: float,
    high: float,
    start: float,
    least_step: float,
    memory: Array,
) -> float:
    """Return the root of an increasing ``evaluate(x, memory) - target`` in a bracket.

    Newton's method inside a shrinking bracket, with ``slope(x, value, memory)`` given the value there;
    ends when the step is at most ``least_step``, or the bracket cannot shrink any further.
    """
    x = start
    for _ in range(MOST_STEPS):
        error = evaluate(x, memory) - target
        if error == 0.0:
            break
        if error > 0.0:
            high = x
        else:
            low = x
        steepness = slope(x, error + target, memory)
        candidate = x - error / steepness if steepness > 0.0 else low
        if not low < candidate < high:
            candidate = 0.5 * (low + high)
        if abs(candidate - x) <= least_step or candidate in (low, high):
            break
        x = candidate
    return x
