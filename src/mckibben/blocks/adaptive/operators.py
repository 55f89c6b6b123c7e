"""Weighted sums of play operators whose weights and offset are learnt while they are inverted.

y = y_0 + sum_i w_i s_i: the slopes of the output are the operators and 1, so nothing is linearised.
The operators play in the space of the input: they stay as they are where weights move, and memory is
carried over exactly.

What is learnt is taken over as far as the input then goes on in the direction of the reference, unless
it differs by more than the usual error: a change of weights is never mistaken for a reversal, and
noise does not make the input chatter across the loop.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.adaptive.adaptable import Adaptable, Group, relative_spread
from mckibben.blocks.adaptive.learning import GATE, USUAL, family_at, learn, trusted
from mckibben.blocks.hysteresis.play_operators import follow
from mckibben.blocks.kernels import kernel

LEAST = 0.1
"""Share of a fitted partial sum of weights that is left, whatever is measured."""


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
    n, p = r.size, r.size + 1
    limits = c[family_at(c) : family_at(c) + 2]
    least = c[family_at(c) + 2 : inverse_at(c)]
    fitted, fresh = c[4 + 2 * p : 4 + 3 * p], c[4 + 3 * p : family_at(c)]
    theta, used, root = learnt[:p], learnt[p : 2 * p], learnt[2 * p : 2 * p + fresh.size]
    sense = learnt[2 * p + fresh.size :]
    work, slopes = scratch[: 2 * p], scratch[2 * p : 3 * p]
    believed, asked, expected = theta[n], used[n], fitted[n]
    for i in range(n):
        slopes[i] = s[i]
        believed += theta[i] * s[i]
        asked += used[i] * s[i]
        expected += fitted[i] * s[i]
    slopes[n] = 1.0
    taught = learn(
        c[1:4],
        c[4 : 4 + p],
        c[4 + p : 4 + 2 * p],
        fresh,
        theta,
        root,
        sense,
        slopes,
        work,
        measured,
        believed,
        asked,
        expected,
    )
    if taught:
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


class LearntOperators(Adaptable):
    """A weighted sum of play operators whose weights, and an offset, are learnt."""

    groups: ClassVar[tuple[Group, ...]] = (
        Group(
            "gain", "higher (softer springs, or more area)", "lower (stiffer springs, or less area)"
        ),
        Group("friction"),
        Group("offset", "up", "down"),
    )

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]

    @property
    def learnt_limits(self) -> tuple[float, float]:
        """Lowest and highest input of the operators."""
        return self.input_limits

    @property
    def taught(self) -> Array:
        """Weights, then the offset."""
        return np.array([*self.weights, getattr(self, "offset", 0.0)])

    @property
    def span(self) -> float:
        """Change of the output over the whole input [its unit]."""
        low, high = self.learnt_limits
        width = high - low if np.isfinite(high - low) else max(self.thresholds) or 1.0
        return float(np.sum(self.weights) * width)

    @property
    def scales(self) -> Array:
        """The weights, none below a hundredth of their mean; the change over the whole input."""
        w = np.abs(self.weights)
        return np.array([*np.maximum(w, 0.01 * w.mean()), self.span])

    @property
    def spread(self) -> Array:
        """Gain and friction by 30 %, every weight by 10 %, the offset by 30 % of the span."""
        return relative_spread(0.3, 0.3, 0.1, 0.3, len(self.weights))

    @property
    def least(self) -> Array:
        """Lowest weights, then lowest partial sums."""
        w = np.array(self.weights)
        lowest = np.where(w >= 0, 0.0, -np.inf)
        return np.concatenate([lowest, LEAST * np.cumsum(w)])

    def adaptive_numbers(self, sample_time: float | None) -> Array:
        """Return [lowest, highest input of the operators, least], then the inverse's."""
        own = super().adaptive_numbers(sample_time)
        return np.concatenate([self.learnt_limits, self.least, own])

    def group_changes(self, theta: Array) -> Array:
        """Return the relative changes of sum w, of sum w r over sum w, and the offset over the span."""
        r, w = np.array(self.thresholds), np.array(self.weights)
        new, old = theta[:-1], w
        width_new, width_old = new @ r / new.sum(), old @ r / old.sum()
        friction = width_new / width_old - 1 if width_old > 0 else 0.0
        shift = (theta[-1] - self.taught[-1]) / self.span
        return np.array([new.sum() / old.sum() - 1, friction, shift])
