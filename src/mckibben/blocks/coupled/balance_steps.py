"""Both directions of a balance of forces, sample by sample."""

from __future__ import annotations

from mckibben.arrays import Array
from mckibben.blocks.core.kernels import kernel
from mckibben.blocks.coupled.balance_law import NEARLY, keep, pressed, settle
from mckibben.blocks.coupled.balance_terms import FROM_REST, IN_TIME


@kernel
def balance_kernel(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Give pressures; the last state counts samples that muscles cannot reach."""
    c = coefficients
    n, n_x = int(c[0]), int(c[1]) + int(c[3])
    scratch = c[c.size - n * (n + 6) :]
    y, p, gradient = scratch[:n], scratch[n : 2 * n], scratch[2 * n : 3 * n]
    tare = state[state.size - 2 - n :]
    for t in range(inputs.shape[0]):
        x = inputs[t, n : n + n_x]
        way = FROM_REST if state[state.size - 2] != 0.0 else IN_TIME
        amiss = False
        for j in range(n):
            y[j] = inputs[t, j] + tare[j]
        for k in range(n):
            found, reached = pressed(c, k, state, way, y, x, gradient)
            p[k] = min(max(found, c[10]), c[11])
            # a hair beyond is rounding
            amiss = amiss or not (reached and abs(p[k] - found) <= 1e-9 * (1.0 + abs(found)))
            outputs[t, k] = p[k]
        if amiss:  # where the muscles go instead is what friction will remember
            settle(c, state, way, y, x, p, scratch[2 * n :])
        keep(c, state, way, y, p)
        state[state.size - 2] = 0.0
        if amiss:
            state[state.size - 1] += 1.0


@kernel
def balance_inverse_kernel(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Give displacements; the last state counts samples that were not solved."""
    c = coefficients
    n, n_x = int(c[0]), int(c[1]) + int(c[3])
    scratch = c[c.size - n * (n + 6) :]
    y, tare = scratch[:n], state[state.size - 2 - n :]
    for t in range(inputs.shape[0]):
        p, x = inputs[t, :n], inputs[t, n : n + n_x]
        for k in range(n):
            y[k] = state[k]
        way = FROM_REST if state[state.size - 2] != 0.0 else IN_TIME
        left = settle(c, state, way, y, x, p, scratch[2 * n :])
        keep(c, state, way, y, p)
        state[state.size - 2] = 0.0
        for k in range(n):
            outputs[t, k] = y[k] - tare[k]
        if not left < NEARLY:
            state[state.size - 1] += 1.0
