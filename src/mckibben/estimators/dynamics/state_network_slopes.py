"""Free runs of state-space networks with exact derivatives by all their weights, one pass for both."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.kernels import summing_kernel

LARGEST = 1e6
"""State, in units of the output's scale, that is out of all bounds: the run ends there."""


@summing_kernel
def follow_network(
    linear: Array,
    hidden: Array,
    readout: Array,
    h: float,
    state: Array,
    moved: Array,
    inputs: Array,
    every: int,
    skipped: int,
    outputs: Array,
    slopes: Array,
) -> bool:
    """Run a network over inputs joined by straight lines, one Runge-Kutta step each.

    Parameters
    ----------
    linear, hidden, readout : arrays, shapes (n, n + 2), (units, n + 2) and (n, units)
    h : float
        Step by rate.
    state : array, shape (n,)
        At the first input; changed.
    moved : array, shape (n, p)
        Derivatives of that by the weights; changed.
    inputs : array, shape (1 + every * (skipped + samples),)
        Less their offset, by their scale.
    every, skipped : int
        Steps from sample to sample, and samples before the first that is wanted.
    outputs : array, shape (samples,)
        Filled with the first state at every sample.
    slopes : array, shape (samples, p)
        Filled with its derivatives; of shape (0, p) where they are not wanted.

    Returns
    -------
    bool
        Whether it came to the end.
    """
    n, width = linear.shape
    units, p, wanted = hidden.shape[0], moved.shape[1], slopes.shape[0] > 0
    first_unit, first_read = n * width, n * width + units * width
    rate, tangent = np.zeros((4, n)), np.zeros((4, n, p))
    known, act, bend = np.ones(width), np.zeros(units), np.zeros(units)
    turned, at = np.zeros((n, n)), np.zeros((n, p))
    for t in range(inputs.size - 1):
        for stage in range(4):
            way = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            last = max(stage - 1, 0)
            for d in range(n):
                known[d] = state[d] + way * h * rate[last, d]
            known[n] = inputs[t] + way * (inputs[t + 1] - inputs[t])
            for j in range(units):
                s = 0.0
                for e in range(width):
                    s += hidden[j, e] * known[e]
                act[j] = np.tanh(s)
                bend[j] = 1.0 - act[j] * act[j]
            for d in range(n):
                s = 0.0
                for e in range(width):
                    s += linear[d, e] * known[e]
                for j in range(units):
                    s += readout[d, j] * act[j]
                rate[stage, d] = s
            if not wanted:
                continue
            for d in range(n):
                for e in range(n):
                    s = linear[d, e]
                    for j in range(units):
                        s += readout[d, j] * bend[j] * hidden[j, e]
                    turned[d, e] = s
                for i in range(p):
                    at[d, i] = moved[d, i] + way * h * tangent[last, d, i]
            for d in range(n):
                own = tangent[stage, d]
                own[:] = 0.0
                for e in range(n):
                    share = turned[d, e]
                    for i in range(p):
                        own[i] += share * at[e, i]
                for e in range(width):
                    own[d * width + e] += known[e]
                for j in range(units):
                    share = readout[d, j] * bend[j]
                    for e in range(width):
                        own[first_unit + j * width + e] += share * known[e]
                    own[first_read + d * units + j] += act[j]
        for d in range(n):
            ends, middle = rate[0, d] + rate[3, d], rate[1, d] + rate[2, d]
            state[d] += h / 6.0 * (ends + 2.0 * middle)
            if wanted:
                for i in range(p):
                    between = tangent[1, d, i] + tangent[2, d, i]
                    moved[d, i] += h / 6.0 * (tangent[0, d, i] + 2.0 * between + tangent[3, d, i])
            if not abs(state[d]) < LARGEST:
                return False
        k = (t + 1) // every - skipped - 1
        if (t + 1) % every == 0 and k >= 0:
            outputs[k] = state[0]
            if wanted:
                slopes[k] = moved[0]
    return True
