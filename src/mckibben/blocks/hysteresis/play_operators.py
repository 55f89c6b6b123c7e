"""The play (backlash) operator, and thresholds, starts and inverses of weighted sums of it.

With threshold r and input u: w_t = min(max(w_{t-1}, u_t - r), u_t + r). Its output follows the
input through a dead zone of width 2 r, and remembers where it was left.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Eq. (3) with both envelopes the identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import VIRGIN, Block
from mckibben.blocks.kernels import ROUNDING, SLACK, kernel, step
from mckibben.errors import ModelError


def check_invertible_sum(kind: str, thresholds: Sequence[float], weights: Sequence[float]) -> None:
    """Raise an error for a weighted sum of play operators that is not strictly increasing.

    The slope after every reversal runs through the partial sums of the weights, so each must be
    positive, and the first operator must have no dead zone.
    """
    if thresholds[0] != 0:
        raise ModelError(
            f"{kind!r} has no inverse: its smallest threshold is {thresholds[0]:g}, so it "
            "does not move right after a reversal",
            remedy="identify it with a first threshold of 0",
        )
    partial = np.cumsum(weights)
    if np.any(partial <= 0):
        first = int(np.argmax(partial <= 0))
        raise ModelError(
            f"{kind!r} has no inverse: its weights 0 to {first} add up to "
            f"{partial[first]:g}, so its output would not rise with its input",
            remedy="identify it with `settings[nonnegative]=true`",
        )


@kernel
def start_operators(r: Array, rising: float, falling: float, virgin: bool, s: Array) -> None:
    """Start play operators as if the input had only risen, or from a virgin state.

    ``rising`` and ``falling`` are the first input as the two edges see it: the same for classical
    operators, the two envelopes' values for generalized ones.
    """
    for i in range(r.size):
        s[i] = rising - r[i]
        if virgin:
            s[i] = min(max(0.0, rising - r[i]), falling + r[i])


def started(r: Array, rising: float, falling: float, rule: str) -> Array:
    """Return the states of play operators with thresholds ``r``, see `start_operators`."""
    states = np.empty_like(r)
    start_operators(r, rising, falling, VIRGIN[rule], states)
    return states


@kernel
def start_sum(
    target: float, lowest: float, highest: float, r: Array, w: Array, virgin: bool, s: Array
) -> None:
    """Start operators so that their weighted sum is ``target``, within the input limits."""
    if virgin:
        s[:] = 0.0
        if target != 0.0:
            way = 1.0 if target > 0.0 else -1.0
            move_to(target, way, highest if target > 0.0 else lowest, r, w, s)
        return
    risen, slope = target, 0.0
    for i in range(r.size):
        risen += w[i] * r[i]
        slope += w[i]
    z = min(max(risen / slope, lowest), highest)
    for i in range(r.size):
        s[i] = z - r[i]


@kernel
def follow(
    target: float, previous: float, lowest: float, highest: float, r: Array, w: Array, s: Array
) -> tuple[float, bool]:
    """Move the input of a weighted sum of play operators until the sum is the new target.

    Stays where the reference does, and where target and sum differ by rounding only, so that rounding
    is never taken for a reversal. Changes the states ``s``; returns the direction taken (1, -1, or 0
    for none), and whether the input would have to leave its limits, by more than rounding.
    """
    total = 0.0
    size = 0.0
    for i in range(r.size):
        total += w[i] * s[i]
        size += abs(w[i] * s[i])
    missing = target - total
    slack = SLACK * abs(highest - lowest)
    if target > previous and missing > ROUNDING * size:
        z = move_to(target, 1.0, highest, r, w, s)
        return 1.0, z > highest + slack
    if target < previous and missing < -ROUNDING * size:
        z = move_to(target, -1.0, lowest, r, w, s)
        return -1.0, z < lowest - slack
    above = missing > w[0] * slack and s[0] >= highest
    below = missing < -w[0] * slack and s[0] <= lowest
    return 0.0, above or below


@kernel
def move_to(target: float, way: float, limit: float, r: Array, w: Array, s: Array) -> float:
    """Move the input of a sum of play operators up or down (``way`` 1 or -1) to ``target``.

    Changes the states ``s``, as far as the limit of the input allows, and returns the input that the
    target asks for. While the input z rises, operator i moves once z > s_i + r_i, and operators start
    moving in the order of their thresholds; between two starts the sum is linear in z.
    """
    n = r.size
    still = 0.0
    for i in range(n):
        still += w[i] * s[i]
    slope, moving, z = 0.0, 0.0, s[0]
    for i in range(n):
        still -= w[i] * s[i]
        slope += w[i]
        moving += w[i] * r[i]
        z = (target - still + way * moving) / slope
        if i + 1 == n or way * z <= way * s[i + 1] + r[i + 1]:
            break
    if way > 0.0:
        for i in range(n):
            s[i] = max(s[i], min(z, limit) - r[i])
    else:
        for i in range(n):
            s[i] = min(s[i], max(z, limit) + r[i])
    return z


@step
def play_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run one play operator; coefficients are [r]."""
    r, u = coefficients[0], inputs[0]
    state[0] = min(max(state[0], u - r), u + r)
    outputs[0] = state[0]


@kernel
def play_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start a play operator."""
    start_operators(coefficients, inputs[0], inputs[0], virgin, state)


@kernel
def play_matrix(
    u: Array, rising: Array, falling: Array, r: Array, s: Array, operators: Array
) -> None:
    """Run play operators in parallel: ``operators[t, i]`` is operator i after sample t.

    Shapes: u and what its edges see of it, rising and falling, (n,), r and s (N,), operators (n, N).
    Changes the states ``s``, which are those after the first sample: nothing moves before the second.
    """
    for t in range(u.size):
        lower = rising[t] if u[t] > u[max(t - 1, 0)] else -np.inf
        upper = falling[t] if u[t] < u[max(t - 1, 0)] else np.inf
        for i in range(r.size):
            s[i] = min(max(s[i], lower - r[i]), upper + r[i])
            operators[t, i] = s[i]


@dataclass(frozen=True, config=fields.STRICT)
class Play(fields.WithMemory, Block):
    """One play operator.

    Parameters
    ----------
    threshold : float
        Half the dead zone, in the unit of the input; at least 0.
    """

    kind = "play"
    kernel = play_step
    start_kernel = play_start
    parameters = ("threshold",)
    n_states = 1  # the operator's own output
    typical = (0.5,)
    formulas = (r"y = F_r[u],\quad F_r[u]_t = \min(\max(F_r[u]_{t-1},\, u_t - r),\, u_t + r)",)

    threshold: Annotated[fields.NotNegative, "r [{u}]"]
