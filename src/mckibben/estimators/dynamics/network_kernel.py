"""Free runs of state-space networks with their derivatives by the weights: compiled loops."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.kernels import summing_kernel

RUNGE_KUTTA = ((0.0, 1.0, 0.5), (0.5, 2.0, 0.5), (0.5, 2.0, 1.0), (1.0, 1.0, 0.0))
"""Runge-Kutta stages: position in the step, weight, and length of the following stage."""

LARGEST_STATE = 1e6
"""Scaled state that counts as diverged."""


@summing_kernel
def layer(
    linear: Array,
    hidden: Array,
    readout: Array,
    first: int,
    x: Array,
    features: Array,
    act: Array,
    result: Array,
) -> None:
    """Fill in rows of L v + R tanh(H v), from the first on, and their derivatives by the weights.

    L, H and R are ``linear``, ``hidden`` and ``readout``; their weights are numbered in this order, row
    by row, and column 1 + i of the result is the derivative by weight i.

    Parameters
    ----------
    linear, hidden, readout : arrays, shapes (n + p, n + m + 1), (units, n + m + 1) and (n + p, units)
    first : int
    x : array, shape (n, 1 + q)
        States, and their derivatives by the weights, row by row; q may be 0.
    known : array, shape (n + m + 1,)
        v: states, inputs and 1; the states are filled in here.
    act : array, shape (units,)
        Filled with tanh(H v).
    result : array, shape (rows, 1 + q)
    """
    total, width = linear.shape
    n, units, q = x.shape[0], hidden.shape[0], x.shape[1] - 1
    for d in range(n):
        features[d] = x[d, 0]
    for j in range(units):
        s = 0.0
        for e in range(width):
            s += hidden[j, e] * features[e]
        act[j] = np.tanh(s)
    for k in range(result.shape[0]):
        row, d = result[k], first + k
        for i in range(1 + q):
            row[i] = 0.0

        # the value
        for e in range(width):
            row[0] += linear[d, e] * features[e]
        for j in range(units):
            row[0] += readout[d, j] * act[j]
        if q == 0:
            continue

        # derivatives through the states
        for e in range(n):
            slope = linear[d, e]
            for j in range(units):
                slope += readout[d, j] * (1.0 - act[j] * act[j]) * hidden[j, e]
            for i in range(1, 1 + q):
                row[i] += slope * x[e, i]

        # derivatives by the weights of this layer, at fixed states
        for e in range(width):
            row[1 + d * width + e] += features[e]
        for j in range(units):
            slope = readout[d, j] * (1.0 - act[j] * act[j])
            for e in range(width):
                row[1 + (total + j) * width + e] += slope * features[e]
            row[1 + (total + units) * width + d * units + j] += act[j]


@summing_kernel
def simulate_network(
    linear: Array,
    hidden: Array,
    readout: Array,
    h: float,
    state: Array,
    inputs: Array,
    substeps: int,
    skipped: int,
    is_wanted: Mask,
    outputs: Array,
) -> bool:
    """Simulate a network with linearly interpolated inputs, one Runge-Kutta step per sample of them.

    Parameters
    ----------
    linear, hidden, readout : arrays
        As of `layer`.
    h : float
        Step by rate.
    state : array, shape (n, 1 + q)
        At the first inputs, with its derivatives by the weights; changed.
    inputs : array, shape (1 + substeps * (skipped + samples), m)
        Less their offsets, by their scales.
    substeps, skipped : int
        Steps from sample to sample, and samples before the first.
    wanted : array of bool, shape (samples,)
        Samples whose outputs are stored.
    outputs : array, shape (samples that are wanted, p, 1 + q)
        Filled with the scaled outputs, and their derivatives.

    Returns
    -------
    bool
        Whether the end was reached: a state above `LARGEST_STATE` ends the run.
    """
    n, columns = state.shape
    m = inputs.shape[1]
    at, rate, total = state.copy(), np.zeros((n, columns)), np.zeros((n, columns))
    features, act, row = np.ones(linear.shape[1]), np.zeros(hidden.shape[0]), 0
    for t in range(inputs.shape[0] - 1):
        # the stages of a step
        for position, weight, ahead in RUNGE_KUTTA:
            for j in range(m):
                features[n + j] = inputs[t, j] + position * (inputs[t + 1, j] - inputs[t, j])
            layer(linear, hidden, readout, 0, at, features, act, rate)
            for d in range(n):
                for i in range(columns):
                    total[d, i] += weight * rate[d, i]
                    at[d, i] = state[d, i] + ahead * h * rate[d, i]

        # the step
        for d in range(n):
            for i in range(columns):
                state[d, i] += h / 6.0 * total[d, i]
                at[d, i], total[d, i] = state[d, i], 0.0
            if not abs(state[d, 0]) < LARGEST_STATE:
                return False

        # the outputs, at samples
        k = (t + 1) // substeps - skipped - 1
        if (t + 1) % substeps == 0 and k >= 0 and is_wanted[k]:
            for j in range(m):
                features[n + j] = inputs[t + 1, j]
            layer(linear, hidden, readout, n, state, features, act, outputs[row])
            row += 1
    return True
