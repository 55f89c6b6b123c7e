"""The simplest use of a muscle, beside which a compensator has to show its worth: no compensation.

All that is known of the muscle is one slow rise of its pressure from the lowest to the highest, as every
lab has it. A reference is read off that curve: a monotone map without memory, so that what goes down
goes by the curve that came up. Of several muscles all rise together, and each has its own curve. Where
more muscles than motions pull against each other, each rises alone, and moves all along straight lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.control.controller import Controller
from mckibben.control.loop import track
from mckibben.control.roles import Plant, actuated, followed_by
from mckibben.errors import ModelError
from mckibben.recording import Recording

RISE = 30.0
"""Time in which pressures rise [s]: slow beside air and creep of a loop's length."""

KNOTS = 65
"""Of a curve."""

SMALLEST = 1e-3
"""Weight of a command's size beside what it moves: of all that move alike, the smallest are given."""


@dataclass
class Ramp(Controller):
    """All commands from lowest to highest, evenly in so many steps."""

    low: Array
    high: Array
    steps: int

    def reset(self, sample_time: float) -> None:
        self._done = 0

    def step(self, reference: Array, measured: Array, scheduled: Array) -> Array:
        share = min(self._done / self.steps, 1.0)
        self._done += 1
        return self.low + share * (self.high - self.low)


@dataclass
class StaticMap(Controller):
    """References read off curves, one a muscle.

    Parameters
    ----------
    curves : sequence of (array, array)
        Displacement [mm], or force [N], rising, and the command there [bar].
    """

    curves: list[tuple[Array, Array]]

    def reset(self, sample_time: float) -> None:
        """Do nothing: it has no memory."""

    def step(self, reference: Array, measured: Array, scheduled: Array) -> Array:
        pairs = zip(reference, self.curves, strict=True)
        return np.array([np.interp(wanted, *curve) for wanted, curve in pairs])


@dataclass
class StraightMap(Controller):
    """References by straight lines, one a muscle and motion, and of all commands the smallest.

    Parameters
    ----------
    rest : array, shape (m,)
        What is followed, where all commands are lowest.
    slopes : array, shape (m, n)
        Of what is followed over the commands.
    low, high : array, shape (n,)
        Commands.
    """

    rest: Array
    slopes: Array
    low: Array
    high: Array

    def reset(self, sample_time: float) -> None:
        """Do nothing: it has no memory."""

    def step(self, reference: Array, measured: Array, scheduled: Array) -> Array:
        from scipy.optimize import lsq_linear  # slow to load

        small = SMALLEST * float(np.abs(self.slopes).max()) * np.eye(self.low.size)
        wanted = np.concatenate([reference - self.rest, np.zeros(self.low.size)])
        limits = (0.0, self.high - self.low)
        found = lsq_linear(np.vstack([self.slopes, small]), wanted, limits, method="bvls")
        return np.asarray(self.low + found.x)


def slow_rise(
    plant: Plant,
    reference: Recording,
    *,
    only: str | None = None,
    pressure_loop: bool = True,
    seed: int = 0,
) -> Recording:
    """Return what a plant does while its commands rise slowly together, or one of them alone.

    Parameters
    ----------
    plant : Plant
    reference : Recording
        What is to be followed: its sample time, and what it holds at first, are those of the rise.
    only : str, optional
        The one that rises, while the others stay lowest.
    pressure_loop : bool
        As of `track`.
    seed : int
        Of the noise.

    Returns
    -------
    Recording
        Commands, what is held, and what is followed, as measured a step after.

    Raises
    ------
    DataError, ModelError
        As of `track`.
    """
    followed = followed_by(plant, reference)
    held = [name for name in plant.inputs if name in reference]
    driven = actuated(plant, held)
    ends = np.array([[plant.limits(name).low, plant.limits(name).high] for name in driven])
    if only is not None:
        ends[:, 1] = np.where([name == only for name in driven], ends[:, 1], ends[:, 0])
    steps = round(RISE / (reference.sample_time or 1.0))
    first = {name: np.full(steps + 2, reference[name][0]) for name in (*followed, *held)}
    ramp = Ramp(ends[:, 0], ends[:, 1], steps)
    given = Recording(first, reference.sample_time, {n: reference.units[n] for n in first})
    found = track(
        ramp, plant, given, approach=0.0, pressure_loop=pressure_loop, seed=seed
    ).recording
    share = np.arange(steps + 1) / steps
    commands = {
        name: low + share * (high - low) for name, (low, high) in zip(driven, ends, strict=True)
    }
    channels = {name: first[name][:-1] for name in held} | commands
    channels |= {name: found[name][1:] for name in followed}
    return Recording(channels, reference.sample_time)


def uncompensated(
    plant: Plant,
    reference: Recording,
    rise: Recording,
    *,
    pressure_loop: bool = True,
    seed: int = 0,
) -> Controller:
    """Return what follows a reference without compensation, by a plant's slow rise.

    Parameters
    ----------
    plant : Plant
    reference : Recording
        What is to be followed.
    rise : Recording
        From `slow_rise`.
    pressure_loop, seed
        As of `slow_rise`.

    Raises
    ------
    ModelError
        If something does not move.
    """
    followed = followed_by(plant, reference)
    driven = actuated(plant, [name for name in plant.inputs if name in reference])
    if len(followed) != len(driven):
        slopes, rests = [], []
        for name in driven:
            alone = slow_rise(plant, reference, only=name, pressure_loop=pressure_loop, seed=seed)
            line = np.polynomial.polynomial.polyfit(
                alone[name] - alone[name][0], alone.matrix(followed), 1
            )
            rests.append(line[0])
            slopes.append(line[1])
        ends = [plant.limits(name) for name in driven]
        low, high = (np.array([getattr(each, end) for each in ends]) for end in ("low", "high"))
        return StraightMap(np.mean(rests, axis=0), np.column_stack(slopes), low, high)
    return StaticMap([curve(rise[u], rise[y], y) for u, y in zip(driven, followed, strict=True)])


def curve(command: Array, moved: Array, name: str) -> tuple[Array, Array]:
    """Return a monotone curve of a slow rise: what is moved, rising, and the command there.

    Parameters
    ----------
    command, moved : array, shape (n,)
        Of the rise.
    name : str
        Of what is moved.

    Raises
    ------
    ModelError
        If nothing moves.
    """
    from scipy.optimize import isotonic_regression  # slow to load

    falls = moved[-1] < moved[0]
    smooth = np.asarray(isotonic_regression(moved, increasing=not falls).x)
    if falls:
        smooth, command = smooth[::-1], command[::-1]
    places, of = np.unique(smooth, return_inverse=True)
    if places.size < 2:
        raise ModelError(
            f"{name} does not move with the command. Remedy: check the plant and its limits."
        )
    at = np.bincount(of, command) / np.bincount(of)  # of a stretch that is flat, its middle
    knots = np.linspace(places[0], places[-1], KNOTS)
    return knots, np.interp(knots, places, at)
