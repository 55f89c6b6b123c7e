"""The scalar solver of the inverses that have no closed form: one root a sample, in a bracket."""

from __future__ import annotations

from typing import Any

from mckibben.blocks.core.kernels import BRACKET, ROUNDING, SLACK, inlined

MOST_STEPS = 200
"""Of closing the bracket, and of the walk each way: far more than either takes."""


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
