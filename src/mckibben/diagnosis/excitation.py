"""Excitation of recordings: ranges, noise, branches and holds of all driving channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import NARROWEST, Array
from mckibben.recording import Recording
from mckibben.signals.holds import holds
from mckibben.signals.reversals import (
    FEWEST_FOR_NOISE,
    GROWS,
    NOISE_SHARE,
    OF_NORMAL,
    branches_between,
    reversals,
    swing_threshold,
    third_differences,
)

MOVES_SHARE, LOAD_MOVES_SHARE = 0.01, 0.1
"""Range, relative to the largest magnitude, above which a channel varies; the second is for loads,
which inertia disturbs.
"""

BRANCH_SHARE = 0.1
"""Smallest share of its range that a channel covers in a branch."""

MOST_BRANCHES, NOISY_RECORDINGS = 2000, 8
"""Largest number of branches stored per channel, and of recordings used to estimate noise, evenly
spaced.
"""

CROSSINGS = np.linspace(0.1, 0.9, 9)
"""Shares of a branch between which its speed is measured."""


@dataclass(frozen=True)
class Branch:
    """A channel between two turning points: recording, samples, values there."""

    recording: int
    first: int
    last: int
    start: float
    end: float

    @property
    def travel(self) -> float:
        """Distance covered."""
        return abs(self.end - self.start)


@dataclass(frozen=True)
class Excitation:
    """Excitation of all driving channels in recordings.

    Parameters
    ----------
    recordings, tests : tuple of Recording
    inputs, loads, outputs : tuple of str
        Channels that are commanded, that schedule or load, and that are modelled.
    """

    recordings: tuple[Recording, ...]
    tests: tuple[Recording, ...]
    inputs: tuple[str, ...]
    loads: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def driven(self) -> tuple[str, ...]:
        """Inputs and loads."""
        return (*self.inputs, *self.loads)

    @property
    def timed(self) -> bool:
        """Whether every recording has time."""
        return all(recording.sample_time is not None for recording in self.recordings)

    @cached_property
    def ranges(self) -> Mapping[str, tuple[float, float]]:
        """Lowest and highest value of every channel."""
        return {name: extremes(self.recordings, name) for name in (*self.driven, *self.outputs)}

    @cached_property
    def noise(self) -> Mapping[str, float]:
        """Standard deviation of the white noise of every channel, 0 if motion hides it."""
        recordings = self.recordings[:: -(-len(self.recordings) // NOISY_RECORDINGS)]
        levels = {
            name: [_white(recording[name]) for recording in recordings] for name in self.ranges
        }
        noise = {name: float(np.median(values)) for name, values in levels.items()}
        for name in self.inputs:
            # levels at random, of which each was recorded once, scatter as noise does
            unit, units = self.recordings[0].units[name], self.recordings[0].units
            widest = max(self.span(other) for other in self.inputs if units[other] == unit)
            if noise[name] > NOISE_SHARE * widest:
                noise[name] = 0.0
        return noise

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """Inputs and loads that vary, within a recording or between them."""
        return tuple(name for name in self.driven if self.moves(name))

    @property
    def swinging(self) -> tuple[str, ...]:
        """Inputs that vary within a recording; all varying ones if none does."""
        varying = [name for name in self.moving if name in self.inputs]
        return tuple(name for name in varying if self.branches[name]) or tuple(varying)

    def span(self, channel: str) -> float:
        """Return the range of a channel."""
        low, high = self.ranges[channel]
        return high - low

    def moves(self, channel: str) -> bool:
        """Return whether a channel varies by more than its noise and a small share of its magnitude."""
        return not self.constant(channel) and self.span(channel) > 10 * self.noise[channel]

    def constant(self, channel: str) -> bool:
        """Return whether a channel varies by at most a small share of its magnitude."""
        share = LOAD_MOVES_SHARE if channel in self.loads else MOVES_SHARE
        return self.span(channel) <= max(share * max(map(abs, self.ranges[channel])), NARROWEST)

    def pooled(self, channels: Sequence[str]) -> Array:
        """Return the samples of all recordings, shape (n, channels)."""
        return np.concatenate([recording.matrix(channels) for recording in self.recordings])

    @cached_property
    def turns(self) -> Mapping[str, tuple[NDArray[np.int64], ...]]:
        """Turning points of all varying channels, with both ends, of every recording."""

        def turning_points(name: str, u: Array) -> NDArray[np.int64]:
            noise = swing_threshold(self.noise[name], 0.0, u.size)
            return reversals(u, max(noise, BRANCH_SHARE * self.span(name)))

        return {
            name: tuple(turning_points(name, recording[name]) for recording in self.recordings)
            for name in self.moving
        }

    @cached_property
    def branches(self) -> Mapping[str, tuple[Branch, ...]]:
        """Branches of all varying channels."""
        branches_of = {}
        for name in self.moving:
            pieces = [
                Branch(number, first, stop - 1, float(u[first]), float(u[stop - 1]))
                for number, turns in enumerate(self.turns[name])
                for u in [self.recordings[number][name]]
                for first, stop, _ in branches_between(u, turns)
            ]
            long_enough = [
                branch for branch in pieces if branch.travel >= BRANCH_SHARE * self.span(name)
            ]
            branches_of[name] = tuple(long_enough[:: max(1, len(long_enough) // MOST_BRANCHES)])
        return branches_of

    def speed(self, name: str, branch: Branch) -> float:
        """Return the speed of a branch, excluding holds [unit/s]."""
        recording = self.recordings[branch.recording]
        u = recording[name][branch.first : branch.last + 1]
        reached = np.maximum.accumulate((u - branch.start) * np.sign(branch.end - branch.start))
        # where a level is first reached, between samples
        levels = CROSSINGS * branch.travel
        after = np.searchsorted(reached, levels)
        before = np.maximum(after - 1, 0)
        rise = np.maximum(reached[after] - reached[before], 1e-12)
        times = before + np.clip((levels - reached[before]) / rise, 0.0, 1.0)
        step = float(np.diff(levels)[0])
        moving = max(float(np.quantile(np.diff(times), 0.25)), 0.1)
        return step / (moving * recording.step)

    @cached_property
    def longest_hold(self) -> float:
        """Longest time in which all inputs and loads are constant after a motion [s]."""
        spans = [self.span(name) for name in self.moving]
        lasting = [
            (hold.stop - hold.start) * (recording.sample_time or 0.0)
            for recording in self.recordings
            for hold in holds(recording.matrix(self.moving), spans)
            if hold.start > 0
        ]
        return max(lasting, default=0.0)


def extremes(recordings: Sequence[Recording], name: str) -> tuple[float, float]:
    """Return the lowest and the highest value of a channel in the recordings that have it."""
    values = [recording[name] for recording in recordings if name in recording]
    return min(float(x.min()) for x in values), max(float(x.max()) for x in values)


def _white(x: Array) -> float:
    first, second = third_differences(x) if x.size >= FEWEST_FOR_NOISE else (0.0, 0.0)
    return first / OF_NORMAL if second < GROWS * first else 0.0
