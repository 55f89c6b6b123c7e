"""The state in which a free run begins: one rule for fits, scores, simulations, checks and bands.

A run begins from the first measured output for whatever that determines, and at rest for everything
else. What it determines is one past input: a linear model has been at rest at another input, a model
with hysteresis has come down from a peak, a model that takes past outputs has had that output. The past
is a short history of inputs before the first sample, after which every block is in a state it can reach.
Where no output was measured (a stream, generated code, arrays of inputs), where several inputs drive the
block, or where a start was stated, the block begins as it states: by default at rest at the first input.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.fields import Initial
from mckibben.blocks.runs import Run
from mckibben.errors import ModelError

Outputs = Callable[[Array], Array]
"""Returns the outputs over inputs, (k, n_inputs), of a run from rest; infinite where it clipped."""

SETTLING = 256
"""Most samples at the first input before a recording, in which rates decay in a rate-dependent block."""

PRECISE = 1e-12
"""Precision of a peak, relative to the way down from the highest."""

EXPLAINED = 1e-9
"""Error of the first output, relative to its size, that is rounding: a run from rest explains it."""


def stated(kind: str, n_states: int, initial: Initial) -> Array:
    """Return an explicit initial state, shape (n_states,), after checking its length."""
    if isinstance(initial, str):
        raise ModelError(
            f"{kind!r} has no start {initial!r}",
            parameter="initial",
            remedy=f"give 'first_sample', 'virgin', or {n_states} numbers",
        )
    state = np.array(initial, dtype=np.float64)
    if state.shape != (n_states,) or not np.isfinite(state).all():
        raise ModelError(
            f"{kind!r} has {n_states} states, the initial state given has shape {state.shape}",
            parameter="initial",
            remedy=f"give {n_states} finite numbers, or 'first_sample'",
        )
    return state


def explaining_past(block: Any, run: Run, outputs: Array) -> Array:
    """Return the inputs before a run that explain its first outputs, shape (k, n_inputs).

    Parameters
    ----------
    block : Block
        Of one driven input.
    run : Run
    outputs : array, shape (n_outputs,)
        Measured in the first sample.
    """

    def from_rest(inputs: Array) -> Array:
        found, state = block.run(inputs, run.sample_time, "first_sample")
        if block.n_clipped(state):  # a past that the model itself warns of is none
            found[:] = np.inf
        return found

    first = run.first
    missed = outputs - from_rest(first[np.newaxis])[-1]
    if np.abs(missed).max() <= EXPLAINED * np.abs(outputs).max():
        return np.empty((0, first.size))
    if block.is_linear:
        return _rest_elsewhere(from_rest, first, missed)
    driven = block
    while parts := getattr(driven, "parts", ()):
        driven = parts[0]
    low, high = getattr(driven, "input_range", None) or (first[0], first[0])
    low, high = min(low, float(run.u.min())), max(high, float(run.u.max()))
    return _excursion(from_rest, first, outputs, block.rate_dependent, low, high)


def _rest_elsewhere(run: Outputs, first: Array, missed: Array) -> Array:
    """Return the input at which a linear block was at rest, shape (1, n_inputs), or (0, n_inputs).

    ``missed`` is what the first output is above that of a run from rest at the first input.
    """
    before = np.tile(first, (2, 1))
    before[0, 0] += 1.0
    at_rest = run(before[1:])[-1]
    slope = run(before)[-1] - at_rest
    power = float(slope @ slope)
    if not power > 0:
        return before[:0]
    before[0, 0] = first[0] + float(slope @ missed) / power
    return before[: int(np.isfinite(before[0, 0]))]


def _excursion(
    run: Outputs, first: Array, outputs: Array, rates: bool, low: float, high: float
) -> Array:
    """Return the past of a block with memory that explains the first outputs, shape (k, n_inputs).

    Pasts are tried in the order of what they leave in the output: the input has just come from lower;
    has been held for a while (both make a difference where the block depends on the rate); or has come
    down from a peak and been held since. Inputs are from ``low`` to ``high``. Where none explains the
    outputs, it is the end that explains them better.
    """
    held = np.tile(first, (SETTLING if rates else 0, 1))

    def come_from(level: float) -> Array:
        return np.append(level, first[1:])[np.newaxis]

    def down_from(peak: float) -> Array:
        return np.vstack([come_from(peak), held])

    def last(before: Array) -> Array:
        return run(np.vstack([before, first]))[-1]

    ends = last(come_from(low)), last(down_from(high))
    direction = ends[1] - ends[0]

    def above(found: Array) -> Array:
        """Return how far outputs are above the measured ones, along the way between the ends."""
        return np.asarray((found - outputs) @ direction)

    if not np.isfinite(direction).all():
        return held[:0]
    while_held = above(run(np.vstack([held, first])))
    if while_held[0] >= 0:
        return _where(above, last, come_from, low, float(first[0])) if len(held) else held[:0]
    if while_held[-1] >= 0:
        return held[: int(np.argmax(while_held >= 0))]
    return _where(above, last, down_from, float(first[0]), high)


def _where(
    above: Callable[[Array], Array],
    last: Callable[[Array], Array],
    way: Callable[[float], Array],
    low: float,
    high: float,
) -> Array:
    """Return the past of a family at which the first outputs are explained, or the nearer end."""
    from scipy.optimize import brentq

    def missed(level: float) -> float:
        return float(above(last(way(level))))

    if not missed(low) < 0:
        return way(low)
    if not missed(high) > 0:
        return way(high)
    tolerance = PRECISE * (high - low)
    return way(float(brentq(missed, low, high, xtol=tolerance, disp=False)))
