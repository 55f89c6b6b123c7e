"""What the play-type blocks share: threshold rules, starting states, and the walk that inverts them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import VIRGIN
from mckibben.blocks.kernels import ROUNDING, SLACK, kernel
from mckibben.errors import ModelError


def check_thresholds(kind: str, thresholds: Sequence[float], weights: Sequence[float]) -> None:
    """Refuse thresholds that are negative or not increasing, or not one to a weight."""
    r = np.asarray(thresholds)
    if r.size == 0 or r.size != len(weights):
        raise ModelError(
            f"{kind!r} has {r.size} thresholds and {len(weights)} weights. "
            "Remedy: give one weight to every threshold, and at least one."
        )
    if r[0] < 0 or np.any(np.diff(r) <= 0):
        raise ModelError(
            f"the thresholds of {kind!r} are not 0 <= r_0 < r_1 < ... "
            "Remedy: sort them and drop repeated ones."
        )


def check_invertible_sum(kind: str, thresholds: Sequence[float], weights: Sequence[float]) -> None:
    """Refuse a weighted sum of play operators that is not strictly increasing.

    The slope after every reversal runs through the partial sums of the weights, so each must be
    positive, and the first operator must have no dead zone.
    """
    if thresholds[0] != 0:
        raise ModelError(
            f"{kind!r} has no inverse: its smallest threshold is {thresholds[0]:g}, so it does not "
            "move right after a reversal. Remedy: identify it with a first threshold of 0."
        )
    partial = np.cumsum(weights)
    if np.any(partial <= 0):
        first = int(np.argmax(partial <= 0))
        raise ModelError(
            f"{kind!r} has no inverse: its weights 0 to {first} add up to {partial[first]:g}, so its "
            "output would not rise with its input. Remedy: identify it with non-negative weights "
            "(nonnegative=True)."
        )


@kernel
def start_operators(r: Array, rising: float, falling: float, virgin: bool, s: Array) -> None:
    """Start play operators as if the input had only risen, or as if nothing had ever happened.

    ``rising`` and ``falling`` are the first input as the two edges see it: the same for classical
    operators, the two envelopes' values for generalised ones.
    """
    for i in range(r.size):
        s[i] = rising - r[i]
        if virgin:
            s[i] = min(max(0.0, rising - r[i]), falling + r[i])


def started(r: Array, rising: float, falling: float, rule: str) -> Array:
    """Return the states of play operators with thresholds ``r``, see `start_operators`."""
    states = np.empty_like(r)
    start_operators(r, rising, falling, VIRGIN[rule], states)
    return states


@kernel
def start_from_rest(
    target: float, lowest: float, highest: float, r: Array, w: Array, s: Array
) -> None:
    """Start as one excursion from rest leaves operators when the weighted sum is ``target``."""
    for i in range(r.size):
        s[i] = 0.0
    if target > 0.0:
        rise_to(target, highest, r, w, s)
    elif target < 0.0:
        fall_to(target, lowest, r, w, s)


@kernel
def start_sum(
    target: float, lowest: float, highest: float, r: Array, w: Array, virgin: bool, s: Array
) -> None:
    """Start operators so that their weighted sum is ``target``, within the limits of their input."""
    if virgin:
        start_from_rest(target, lowest, highest, r, w, s)
        return
    risen, slope = target, 0.0
    for i in range(r.size):
        risen += w[i] * r[i]
        slope += w[i]
    z = min(max(risen / slope, lowest), highest)
    for i in range(r.size):
        s[i] = z - r[i]


@kernel
def follow(
    target: float, previous: float, lowest: float, highest: float, r: Array, w: Array, s: Array
) -> tuple[float, bool]:
    """Move the input of a weighted sum of play operators until the sum is the new target.

    Stays where the reference does, and where target and sum differ by rounding only, so that rounding
    is never taken for a reversal. Changes the states ``s``; returns the direction taken (1, -1, or 0
    for none), and whether the input would have to leave its limits, by more than rounding.
    """
    total = 0.0
    size = 0.0
    for i in range(r.size):
        total += w[i] * s[i]
        size += abs(w[i] * s[i])
    missing = target - total
    slack = SLACK * abs(highest - lowest)
    if target > previous and missing > ROUNDING * size:
        return 1.0, rise_to(target, highest, r, w, s) > highest + slack
    if target < previous and missing < -ROUNDING * size:
        return -1.0, fall_to(target, lowest, r, w, s) < lowest - slack
    above = missing > w[0] * slack and s[0] >= highest
    below = missing < -w[0] * slack and s[0] <= lowest
    return 0.0, above or below


@kernel
def rise_to(target: float, z_max: float, r: Array, w: Array, s: Array) -> float:
    """Raise the input of a weighted sum of play operators until the sum is ``target``.

    Changes the states ``s``, as far as ``z_max`` allows, and returns the input that the target asks for.
    """
    z = _reach(target, 1.0, r, w, s)
    for i in range(r.size):
        s[i] = max(s[i], min(z, z_max) - r[i])
    return z


@kernel
def fall_to(target: float, z_min: float, r: Array, w: Array, s: Array) -> float:
    """Lower the input until the sum is ``target``; the mirror of `rise_to`."""
    z = _reach(target, -1.0, r, w, s)
    for i in range(r.size):
        s[i] = min(s[i], max(z, z_min) + r[i])
    return z


@kernel
def _reach(target: float, way: float, r: Array, w: Array, s: Array) -> float:
    """Return the input, going up or down (``way`` 1 or -1), at which the sum is ``target``.

    While the input z rises, operator i moves once z > s_i + r_i, and operators start moving in the
    order of their thresholds; between two starts the sum is linear in z.
    """
    n = r.size
    still = 0.0
    for i in range(n):
        still += w[i] * s[i]
    slope = 0.0
    moving = 0.0
    z = s[0]
    for i in range(n):
        still -= w[i] * s[i]
        slope += w[i]
        moving += w[i] * r[i]
        z = (target - still + way * moving) / slope
        if i + 1 == n or way * z <= way * s[i + 1] + r[i + 1]:
            break
    return z
