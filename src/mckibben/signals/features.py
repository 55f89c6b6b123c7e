"""What the signals of recordings show: what moves, at which level, how often.

It is measured relative to all recordings, so that nothing depends on the size of a rig.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.signals.protocol import Role
from mckibben.signals.reversals import cycles, noise_level, swing_threshold

MOVES = 0.15
"""Share of a channel's range over all recordings that a moving one covers at least."""

SWING = 0.12
"""Share of its own range by which a signal has to swing back for a turning point, beyond noise."""

IRREGULAR = 0.15
"""Spread of the times between cycles, relative to their median, from which they are irregular."""

NOISE = 0.05
"""Power of noise, relative to the largest."""

HINTS: Mapping[Role, str] = {
    "train": "train|calib|fit|ident",
    "validation": "valid",
    "test": "test",
}
"""Of a role, at the beginning of a word in the name of a file."""

STILL = 0.02
"""Share of the widest range of channels of a unit within which one is noise."""


@dataclass(frozen=True)
class Features:
    """What the signals of a recording show; ``spans`` are the ranges of channels over all recordings."""

    recording: Recording
    spans: Mapping[str, float]

    def moved(self, channel: str) -> float:
        """Return the range of a channel without outliers, relative to that over all recordings."""
        return float(np.ptp(np.percentile(self.recording[channel], (1, 99)))) / self.spans[channel]

    def moves(self, channel: str) -> bool:
        """Whether it moves, beyond noise and the errors of a regulator."""
        return self.moved(channel) > MOVES

    def level(self, channel: str) -> float:
        """Return the level at which a channel is held."""
        return float(np.median(self.recording[channel]))

    def peaks(self, channel: str) -> list[float]:
        """Return the peak of every whole cycle."""
        samples = self.recording[channel]
        return [float(samples[one].max()) for one in _cycles(samples)]

    def frequency(self, channel: str) -> float:
        """Return the frequency of cycles [Hz], 0 without any."""
        times = self._durations(channel)
        if not times.size:  # of a single cycle at most
            times = np.array([one.stop - one.start for one in _cycles(self.recording[channel])])
            times = times * self.recording.step
        return 1 / float(np.median(times)) if times.size else 0.0

    def regular(self, channel: str) -> bool:
        """Whether there are cycles, and they take equal times."""
        times, some = self._durations(channel), bool(_cycles(self.recording[channel]))
        return some and (not times.size or np.ptp(times) < IRREGULAR * np.median(times))

    def highest_frequency(self, channel: str) -> float:
        """Return the highest frequency with power beyond noise, of a random wave [Hz]."""
        x = self.recording[channel]
        power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(x.size))) ** 2
        last = int(np.flatnonzero(power >= NOISE * power.max())[-1]) if np.ptp(x) > 0 else 0
        return last / (x.size * self.recording.step)

    @cached_property
    def hint(self) -> Role | None:
        """Role by the name of its file."""
        name = str(self.recording.name)
        roles = [r for r, words in HINTS.items() if re.search(rf"(?<![a-z])({words})", name, re.I)]
        return roles[0] if len(roles) == 1 else None

    def _durations(self, channel: str) -> Array:
        """Return the times between cycles, in the middle of their rise, where they are sharp [s]."""
        samples, rises = self.recording[channel], []
        for one in _cycles(samples):
            rise = samples[one][: int(np.argmax(samples[one])) + 1]
            rises.append(one.start + int(np.argmax(rise > (rise[0] + rise[-1]) / 2)))
        return np.diff(np.array(rises, dtype=np.float64)) * self.recording.step


def features_of(recordings: Sequence[Recording]) -> list[Features]:
    """Return what the signals of every recording show."""
    lows, highs = dict[str, float](), dict[str, float]()
    for one in recordings:
        for channel, samples in one.channels.items():
            low, high = np.percentile(samples, (1, 99))
            lows[channel] = min(low, lows.get(channel, np.inf))
            highs[channel] = max(high, highs.get(channel, -np.inf))
    units = {channel: one.units.get(channel) for one in recordings for channel in one}
    widest = dict[str | None, float]()
    for channel, unit in units.items():
        widest[unit] = max(widest.get(unit, 1e-9), highs[channel] - lows[channel])
    spans = {
        channel: max(highs[channel] - lows[channel], STILL / MOVES * widest[unit])
        for channel, unit in units.items()
    }
    return [Features(one, spans) for one in recordings]


def grouped(values: Sequence[float], width: float) -> list[float]:
    """Return every value as the mean of its group, rounded; no group is wider than ``width``.

    A group that would be wider is split by half the distance: where neighbours are as far apart
    throughout, each is a group of its own.

    >>> grouped([0.01, 49.8, 50.3, -0.02], width=5.0)
    [0.0, 50.0, 50.0, 0.0]
    >>> grouped([0.0, 0.04, 0.08, 0.12], width=0.05)
    [0.0, 0.04, 0.08, 0.12]
    """
    if not values or width <= 0:
        return [*values]
    groups = _split(np.sort(np.asarray(values, dtype=np.float64)), width, width)
    means = np.array([group.mean() for group, _ in groups])
    digits = [-int(np.floor(np.log10(distance))) for _, distance in groups]
    levels = [round(float(mean), n) + 0.0 for mean, n in zip(means, digits, strict=True)]
    return [levels[np.argmin(np.abs(means - value))] for value in values]


def _split(ordered: Array, distance: float, width: float) -> list[tuple[Array, float]]:
    """Return sorted values, split where neighbours are further apart, until none is too wide."""
    groups: list[tuple[Array, float]] = []
    for group in np.split(ordered, np.flatnonzero(np.diff(ordered) > distance) + 1):
        groups += (
            [(group, distance)] if np.ptp(group) <= width else _split(group, distance / 2, width)
        )
    return groups


def _cycles(samples: Array) -> list[slice]:
    span = float(np.ptp(samples))
    least = swing_threshold(noise_level(samples), span, samples.size)
    return cycles(samples, max(SWING * span, least)) if span else []
