"""The scalar solver of the inverses that have no closed form: one root a sample, in a bracket."""

from __future__ import annotations

from typing import Any

import numba


@numba.njit(inline="always", nogil=True, error_model="numpy")
def solve_increasing(
    evaluate: Any, target: float, start: float, lowest: float, highest: float, memory: Any
) -> tuple[float, bool]:
    """Find u with ``evaluate(u, memory) == target``, nearest to ``start``, within the limits.

    Walks from ``start`` towards the target in growing steps until it is bracketed, then closes the
    bracket by regula falsi (Illinois) and bisection until nothing lies between its ends. Returns u,
    and whether a limit was reached first.
    """
    tiny = 1e-15 * (highest - lowest)
    near, error_near = start, evaluate(start, memory) - target
    if error_near == 0.0:
        return near, False
    direction = -1.0 if error_near > 0.0 else 1.0
    step = (highest - lowest) / 256.0
    while True:
        far = min(max(near + direction * step, lowest), highest)
        error_far = evaluate(far, memory) - target
        if error_far == 0.0:
            return far, False
        if (error_far > 0.0) != (error_near > 0.0):
            break
        if far in (lowest, highest):
            return far, True
        near, error_near = far, error_far
        step *= 2.0
    weight_near, weight_far = error_near, error_far
    side = 0
    for iteration in range(200):
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
    return (near, False) if abs(error_near) < abs(error_far) else (far, False)
