"""What muscles do at mid-range, by the response of their model: loops, creep, stiffness.

Nothing is read off coefficients: pressures are moved slowly up and down, stepped and held, and loads
changed a little, as one would at a bench.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_law import (
    AT_REST,
    solve_equilibrium,
    start_at_rest,
    unbalanced,
    update_state,
)
from mckibben.blocks.running import run_many

LOOP, HELD = 200, 400
"""Samples of a half of a loop; of a step that is held."""

SLOW = 1e4
"""Times the longest time constant that a slow loop takes."""

AMPLITUDE, STEP = 0.25, 0.1
"""Of the range of pressure: of a loop about its middle, and of a step."""


@dataclass(frozen=True)
class Response:
    """Of every muscle's pressure, where all are at mid-range, shape (n,) but where said.

    Parameters
    ----------
    position : array, shape (m,)
        Coordinates there [mm].
    stiffness : array, shape (m,)
        Of coordinates, relaxed, without friction, at held pressures: force by coordinate [N/mm].
    width : array
        Of a slow loop, of the coordinate that a pressure moves most [mm].
    friction : array
        Half the width times the stiffness [N].
    creep : array
        Share of the way after a step of pressure that comes after a second; 0 without lags.
    """

    position: Array
    stiffness: Array
    width: Array
    friction: Array
    creep: Array


def response_of(balance: Balance, low: float, high: float) -> Response:
    """Return what a balance does about mid-range of its pressures, and of what schedules and loads it."""
    n, m = len(balance.given), len(balance.driven)
    x = np.array([0.5 * (a + b) for a, b in balance.known] or np.zeros(len(balance.scheduled)))
    middle = 0.5 * (low + high)
    slowest = max((*balance.lags, 1e-3)) * SLOW / LOOP
    c = balance.coefficients(slowest)
    state, q, p, work = (
        np.zeros(balance.n_states),
        np.zeros(m),
        np.zeros(n),
        np.zeros(balance.n_scratch),
    )
    start_at_rest(c, state, x, q, p, work)
    p[:] = middle
    solve_equilibrium(c, state, AT_REST, q, x, p, work)
    update_state(c, state, AT_REST, q, p, x)
    residual, matrix, sizes = np.zeros(m), np.zeros((m, m)), np.zeros(m)
    unbalanced(c, state, AT_REST, q, x, p, residual, matrix, sizes, np.zeros(work.size))
    moved, width, creep = np.zeros(n, dtype=int), np.zeros(n), np.zeros(n)
    inverse = replace(balance, tare=False).inverse()
    swing = np.interp(np.arange(4 * LOOP), np.arange(5) * LOOP, [0, 1, -1, 1, -1])
    for k in range(n):
        pressures = np.tile(p, (swing.size, 1))
        pressures[:, k] += AMPLITUDE * (high - low) * swing
        inputs = np.column_stack([pressures, np.tile(x, (swing.size, 1))])
        y = run_many([inverse], inputs, sample_time=slowest)[0]
        moved[k] = int(np.argmax(np.ptp(y, axis=0)))
        down, up = y[LOOP : 3 * LOOP, moved[k]], y[2 * LOOP :, moved[k]]
        # at the middle of either branch of the last loop
        width[k] = abs(float(up[LOOP // 2] - down[LOOP // 2]))
        if balance.lags:
            stepped = np.tile(p, (HELD + 1, 1))
            stepped[1:, k] += STEP * (high - low)
            time = max(balance.lags) * 5.0 / HELD
            inputs = np.column_stack([stepped, np.tile(x, (HELD + 1, 1))])
            y = run_many(
                [replace(balance, tare=False, settled=True).inverse()], inputs, sample_time=time
            )[0]
            way = y[:, moved[k]] - y[0, moved[k]]
            after = min(max(round(1.0 / time), 1), HELD)
            creep[k] = float((way[-1] - way[after]) / way[-1]) if way[-1] else 0.0
    stiffness = np.diag(matrix).copy()
    return Response(q, stiffness, width, 0.5 * width * stiffness[moved], creep)
