"""Free runs of oscillators with exact derivatives by all their parameters, one pass for both.

The Runge-Kutta steps of `mckibben.blocks.hysteresis.oscillators`, and the tangents of each stage.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.hysteresis.oscillators import bouc_wen_slope, knot_before
from mckibben.blocks.kernels import inlined, kernel

OWN = 3
"""Parameters before those of the element: inertia, damping, stiffness."""


@inlined
def follow(
    element: Any,
    numbers: Array,
    step: float,
    state: Array,
    moved: Array,
    inputs: Array,
    every: int,
    skipped: int,
    outputs: Array,
    slopes: Array,
) -> None:
    """Run an oscillator over inputs a step apart, joined by straight lines.

    Parameters
    ----------
    element : function
        ``element(z, velocity, numbers, by)``, to the slope dz/dy and its derivative by z; fills ``by``
        with those by the element's parameters.
    numbers : array
        [inertia, damping, stiffness, those of the element].
    step : float
        [s].
    state : array, shape (3,)
        [y, y', z] at the first input; changed.
    moved : array, shape (3, p)
        Derivatives of that by the parameters; changed.
    inputs : array, shape (1 + every * (skipped + n),)
    every, skipped : int
        Steps from sample to sample, and samples before the first that is wanted.
    outputs : array, shape (n, 2)
        Filled with y and z at every sample.
    slopes : array, shape (n, p)
        Filled with the derivatives of y; of shape (0, p) where they are not wanted.
    """
    m, c, k, own = numbers[0], numbers[1], numbers[2], numbers[OWN:]
    p, wanted = moved.shape[1], slopes.shape[0] > 0
    by = np.zeros(p - OWN)
    rate, tangent = np.zeros((4, 3)), np.zeros((4, 3, p))
    for t in range(inputs.size - 1):
        for stage in range(4):
            way = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            h = way * step
            last = max(stage - 1, 0)
            u = inputs[t] + way * (inputs[t + 1] - inputs[t])
            y = state[0] + h * rate[last, 0]
            v = state[1] + h * rate[last, 1]
            z = state[2] + h * rate[last, 2]
            f, bend = element(z, v, own, by)
            a = (u - c * v - k * y - z) / m
            rate[stage, 0], rate[stage, 1], rate[stage, 2] = v, a, v * f
            if wanted:
                for i in range(p):
                    dy = moved[0, i] + h * tangent[last, 0, i]
                    dv = moved[1, i] + h * tangent[last, 1, i]
                    dz = moved[2, i] + h * tangent[last, 2, i]
                    tangent[stage, 0, i] = dv
                    tangent[stage, 1, i] = -(c * dv + k * dy + dz) / m
                    tangent[stage, 2, i] = f * dv + v * bend * dz
                tangent[stage, 1, 0] -= a / m
                tangent[stage, 1, 1] -= v / m
                tangent[stage, 1, 2] -= y / m
                for i in range(p - OWN):
                    tangent[stage, 2, OWN + i] += v * by[i]
        for d in range(3):
            state[d] += step / 6.0 * (rate[0, d] + 2.0 * rate[1, d] + 2.0 * rate[2, d] + rate[3, d])
            if wanted:
                for i in range(p):
                    ends = tangent[0, d, i] + tangent[3, d, i]
                    middle = tangent[1, d, i] + tangent[2, d, i]
                    moved[d, i] += step / 6.0 * (ends + 2.0 * middle)
        j = (t + 1) // every - skipped - 1
        if (t + 1) % every == 0 and j >= 0:
            outputs[j, 0], outputs[j, 1] = state[0], state[2]
            if wanted:
                slopes[j] = moved[0]


@kernel
def bouc_wen_element(z: float, velocity: float, numbers: Array, by: Array) -> tuple[float, float]:
    """Return the slope of a Bouc-Wen element, and its derivatives."""
    up = 1.0 if velocity > 0.0 else -1.0
    by[0], by[1], by[2] = 1.0, -up * z, -abs(z)
    bend = -numbers[1] * up - numbers[2] * (1.0 if z > 0.0 else -1.0)
    return bouc_wen_slope(z, velocity, numbers), bend


@kernel
def follow_bouc_wen(
    numbers: Array,
    step: float,
    state: Array,
    moved: Array,
    inputs: Array,
    every: int,
    skipped: int,
    outputs: Array,
    slopes: Array,
) -> None:
    """Run a Bouc-Wen oscillator; see `follow`."""
    follow(bouc_wen_element, numbers, step, state, moved, inputs, every, skipped, outputs, slopes)


@kernel
def duhem_element(z: float, velocity: float, numbers: Array, by: Array) -> tuple[float, float]:
    """Return the slope of an element of two curves, and its derivatives."""
    n = numbers.size // 3
    j = knot_before(z, numbers, n)
    width = numbers[j + 1] - numbers[j]
    share = (z - numbers[j]) / width
    inside = 0.0 <= share <= 1.0
    share = min(max(share, 0.0), 1.0)
    by[:] = 0.0
    i = j if velocity > 0.0 else j + n
    by[i], by[i + 1] = 1.0 - share, share
    rise = numbers[n + i + 1] - numbers[n + i]
    return numbers[n + i] + share * rise, rise / width if inside else 0.0


@kernel
def follow_duhem(
    numbers: Array,
    step: float,
    state: Array,
    moved: Array,
    inputs: Array,
    every: int,
    skipped: int,
    outputs: Array,
    slopes: Array,
) -> None:
    """Run an oscillator with an element of two curves; see `follow`."""
    follow(duhem_element, numbers, step, state, moved, inputs, every, skipped, outputs, slopes)
