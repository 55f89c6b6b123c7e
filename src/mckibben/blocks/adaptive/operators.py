"""Weighted sums of play operators whose weights and offset are learnt while they are inverted.

y = y_0 + sum_i w_i s_i: the slopes of the output are the operators and 1, so nothing is linearised.
The operators play in the space of the input: they stay as they are where weights move, and memory is
carried over exactly.

What is learnt is taken over as far as the input then goes on in the direction of the reference, unless
it differs by more than the usual error: a change of weights is never mistaken for a reversal, and
noise does not make the input chatter across the loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.adaptive.learning import (
    GATE,
    USUAL,
    Group,
    Learnable,
    family_at,
    learn,
    start_learning,
    trusted,
)
from mckibben.blocks.hysteresis.play_operators import follow
from mckibben.blocks.kernels import Step, kernel, step

if TYPE_CHECKING:
    from mckibben.blocks.base import Block, Start
    from mckibben.blocks.hysteresis.gpi import GPI
    from mckibben.blocks.hysteresis.pi import PI

LEAST = 0.1
"""Share of a fitted partial sum of weights that is left, whatever is measured."""

GROUPS = (
    Group("gain", "higher (softer springs, or more area)", "lower (stiffer springs, or less area)"),
    Group("friction"),
    Group("offset", "up", "down"),
)


@kernel
def inverse_at(c: Array) -> int:
    """Return where the inverse's numbers begin among the coefficients, behind [limits, least]."""
    return family_at(c) + 2 * int(c[0])


@kernel
def follow_learning(
    c: Array,
    r: Array,
    s: Array,
    last: Array,
    learnt: Array,
    scratch: Array,
    y: float,
    measured: float,
) -> float:
    """Learn, and find the operators' common input for a reference; return the direction it takes.

    Parameters and weights in use are [weights, offset]; ``s`` are the operators; ``last`` is [previous
    reference, samples clipped, direction of travel].
    """
    n, p, family = r.size, r.size + 1, family_at(c)
    limits, least = c[family : family + 2], c[family + 2 : inverse_at(c)]
    fitted = c[4 + 2 * p : 4 + 3 * p]
    theta, used = learnt[:p], learnt[p : 2 * p]
    sense = learnt[family - 4 - p :]
    work, slopes = scratch[: 2 * p], scratch[2 * p : 3 * p]
    believed, asked, expected = theta[n], used[n], fitted[n]
    for i in range(n):
        slopes[i] = s[i]
        believed += theta[i] * s[i]
        asked += used[i] * s[i]
        expected += fitted[i] * s[i]
    slopes[n] = 1.0
    if learn(c, learnt, 0, slopes, work, measured, believed, asked, expected):
        keep_rising(theta, least)
    if y > last[0]:
        last[2] = 1.0
    elif y < last[0]:
        last[2] = -1.0
    share = trusted(sense)
    for i in range(p):
        slopes[i] = fitted[i] + share * (theta[i] - fitted[i])
    take_over(slopes, used, s, y, last[2], GATE * sense[USUAL])
    total = 0.0
    for i in range(n):
        total += used[i] * s[i]
    way, clipped = follow(y - used[n], total, limits[0], limits[1], r, used[:n], s)
    if clipped:
        last[1] += 1.0
    last[0] = y
    return way


def learning_kernels(
    inverse_start: Start, take: Callable[..., float], before: int
) -> tuple[Step, Start]:
    """Return step and start of an inverse that learns its weights and an offset.

    ``take(way, c, state, n)`` takes, and returns, the input of the operators' edge where the reference
    goes a way, by the inverse's coefficients, whose thresholds are from 3 on; between operators and
    previous reference its state has ``before`` numbers.
    """

    def adaptive_step(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Invert, and learn the weights and an offset from what is measured."""
        n = int(coefficients[0]) - 1
        own = coefficients[inverse_at(coefficients) :]
        last, learnt = state[n + before : n + before + 3], state[n + before + 3 :]
        way = follow_learning(
            coefficients, own[3 : n + 3], state[:n], last, learnt, scratch, inputs[0], inputs[1]
        )
        outputs[0] = take(way, own, state, n)

    def adaptive_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
        """Start as the inverse does, with the weights as fitted."""
        last = int(coefficients[0]) - 1 + before
        own = coefficients[inverse_at(coefficients) :]
        inverse_start(own, state[: last + 2], inputs, virgin)
        state[last + 2] = 0.0
        start_learning(coefficients, state[last + 3 :])

    adaptive_step.__qualname__ = f"{inverse_start.__module__}.{inverse_start.__qualname__}.step"
    adaptive_start.__qualname__ = f"{inverse_start.__module__}.{inverse_start.__qualname__}.start"
    return step(adaptive_step), kernel(adaptive_start)


@kernel
def keep_rising(theta: Array, least: Array) -> None:
    """Raise weights that are too low for a sum that rises right after every reversal."""
    n = theta.size - 1
    total = 0.0
    for i in range(n):
        theta[i] = max(theta[i], least[i], least[n + i] - total)
        total += theta[i]


@kernel
def take_over(aim: Array, used: Array, s: Array, y: float, travel: float, band: float) -> None:
    """Move what is used to what is aimed at, as far as the input need not turn before the reference."""
    n = s.size
    total, change = used[n], aim[n] - used[n]
    for i in range(n):
        total += used[i] * s[i]
        change += (aim[i] - used[i]) * s[i]
    room = y - total
    share = 1.0
    left = room - change
    if travel * left < 0.0 and abs(left) <= band and change != 0.0:
        share = min(max(room / change, 0.0), 1.0)
    for i in range(n + 1):
        used[i] = aim[i] if share == 1.0 else used[i] + share * (aim[i] - used[i])


def learnable_operators(
    model: PI | GPI,
    limits: tuple[float, float],
    offset: float,
    step: Step,
    start: Start,
    with_parameters: Callable[[Array], Block],
) -> Learnable:
    """Return what is learnt of a weighted sum of play operators: its weights, and an offset.

    Gain and friction are expected to change by 30 %, each weight by itself by 10 %, the offset by 30 %
    of the span; ``limits`` are the lowest and highest input of the operators.
    """
    r, w = np.array(model.thresholds), np.array(model.weights)
    n, size, width = len(w), np.abs(w), limits[1] - limits[0]
    span = float(np.sum(w) * (width if np.isfinite(width) else r.max() or 1.0))
    weights, sliding = np.append(np.ones(n), 0.0), np.array([0.0, *np.ones(n - 1), 0.0])
    together = 0.3**2 * np.outer(weights, weights) + 0.3**2 * np.outer(sliding, sliding)
    lowest = np.where(w >= 0, 0.0, -np.inf)
    least = np.concatenate([lowest, LEAST * np.cumsum(w)])  # of weights, then of partial sums

    def numbers(sample_time: float | None) -> Array:
        own = model.inverse_numbers(model.coefficients(sample_time))
        return np.concatenate([limits, least, own])

    def group_changes(theta: Array) -> Array:
        """Return the changes of sum w, of sum w r over sum w, and of the offset over the span."""
        new = theta[:-1]
        width_new, width_old = new @ r / new.sum(), w @ r / w.sum()
        friction = width_new / width_old - 1 if width_old > 0 else 0.0
        return np.array([new.sum() / w.sum() - 1, friction, (theta[-1] - offset) / span])

    return Learnable(
        step,
        start,
        fitted=np.append(w, offset),
        scales=np.append(np.maximum(size, 0.01 * size.mean()), span),
        spread=together + np.diag([*np.full(n, 0.1**2), 0.3**2]),
        with_parameters=with_parameters,
        numbers=numbers,
        groups=GROUPS,
        group_changes=group_changes,
        whole_changes=np.array([span, 2 * np.dot(w, r), span]),
    )
