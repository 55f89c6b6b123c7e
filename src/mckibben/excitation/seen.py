"""What recordings show of their inputs: branches with their speeds, turning points, holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import NARROWEST, Array
from mckibben.estimators.coupled.base import SCHEDULES
from mckibben.recording import Recording
from mckibben.signals.reversals import noise_level, reversals, swing_threshold

STILL = 0.01
"""An input whose range is below this share of its largest value is held; an output likewise."""

HELD = 0.01
"""Share of its range within which an input counts as held."""

SHORTEST_HOLD = 10
"""Samples of a hold, at least."""

MOST_BRANCHES = 2000
"""Of an input that are looked at, evenly taken from more."""

MOST_LOOKED_AT = 8
"""Recordings in which noise is looked at."""

LEAST = 0.1
"""Swings of an input below this share of its range part no branches."""

LEVELS = np.linspace(0.1, 0.9, 9)
"""Shares of a branch between which its speeds are taken."""

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Scale:
    """Range and noise of a channel over all recordings.

    Parameters
    ----------
    low, high : float
        Extremes, with their noise.
    noise : float
        Standard deviation of a sample's white noise; 0 where it is not known.
    """

    low: float
    high: float
    noise: float

    @property
    def span(self) -> float:
        """High less low."""
        return self.high - self.low

    @property
    def moves(self) -> bool:
        """Whether the channel moves by more than noise, a hair, and what can be computed with."""
        least = max(STILL * max(abs(self.low), abs(self.high)), 10 * self.noise, NARROWEST)
        return self.span > least


@dataclass(frozen=True)
class Branch:
    """An input on its way from one turning point to the next, over at least a tenth of its range.

    Parameters
    ----------
    start, end : float
        Input at the turning points.
    samples : int
        How many it has.
    slow, fast : float or None
        Mean speed, holds and all, and that of its fastest tenths [input unit/s]; None without time.
    """

    start: float
    end: float
    samples: int
    slow: float | None
    fast: float | None

    @property
    def travel(self) -> float:
        """How far it goes."""
        return abs(self.end - self.start)


@dataclass(frozen=True)
class Hold:
    """A stretch in which every input is held, after one that moved.

    Parameters
    ----------
    recording : int
    start, stop : int
        Samples.
    seconds : float
    """

    recording: int
    start: int
    stop: int
    seconds: float


@dataclass(frozen=True)
class Seen:
    """Recordings as the search for gaps sees them.

    Parameters
    ----------
    recordings, tests : tuple of Recording
    inputs : tuple of str
        All that drive.
    outputs : tuple of str
        All that are to be modelled.
    moving : tuple of str
        Inputs that move at all.
    scales : mapping of str to Scale
        Of every input and output.
    branches : mapping of str to tuple of Branch
        Of every input that moves.
    turns : mapping of str to tuple of arrays
        Likewise, heights of upper, and of lower turning points, as shares of the range.
    holds : tuple of Hold
    """

    recordings: tuple[Recording, ...]
    tests: tuple[Recording, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    moving: tuple[str, ...]
    scales: Mapping[str, Scale]
    branches: Mapping[str, tuple[Branch, ...]]
    turns: Mapping[str, tuple[Array, Array]]
    holds: tuple[Hold, ...]

    @property
    def timed(self) -> bool:
        """Whether every recording has time."""
        return all(recording.sample_time is not None for recording in self.recordings)

    @property
    def duration(self) -> float:
        """Of the longest recording [s]; 0 without time."""
        return max(recording.duration or 0.0 for recording in self.recordings)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return self.recordings[0].units[channel]

    def pooled(self, channel: str) -> Array:
        """Return the samples of a channel, of all recordings."""
        return np.concatenate([recording[channel] for recording in self.recordings])


def seen(
    recordings: Sequence[Recording],
    inputs: Sequence[str],
    outputs: Sequence[str],
    tests: Sequence[Recording] = (),
) -> Seen:
    """Return what recordings show of their inputs.

    Raises
    ------
    DataError
        On absent channels.
    """
    scales = {name: _scale(recordings, name) for name in (*inputs, *outputs)}
    moving = tuple(name for name in inputs if scales[name].moves)
    turns = {name: [_turned(r[name], scales[name]) for r in recordings] for name in moving}
    return Seen(
        recordings=tuple(recordings),
        tests=tuple(tests),
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        moving=moving,
        scales=scales,
        branches={name: _branches(recordings, name, turns[name], scales[name]) for name in moving},
        turns={name: _heights(recordings, name, turns[name], scales[name]) for name in moving},
        holds=_holds(
            recordings, _held_with(recordings, {name: scales[name] for name in moving}, outputs)
        ),
    )


def moves(recordings: Sequence[Recording], channel: str) -> bool:
    """Tell whether a channel moves in any of some recordings, or between them."""
    return _scale(recordings, channel).moves


def some(recordings: Sequence[Recording]) -> Sequence[Recording]:
    """Return as many recordings as noise is looked at in, evenly taken."""
    return recordings[:: -(-len(recordings) // MOST_LOOKED_AT)]


def scatter(signal: Array) -> tuple[float, bool]:
    """Return the median size of third differences of a signal, and whether noise makes them.

    Those of white noise scatter as much over two samples as over one; of motion, more.
    """
    one, two = (float(np.median(np.abs(np.diff(signal[::k], 3)))) for k in (1, 2))
    return one, two < 1.5 * one


def white(signal: Array, span: float) -> float:
    """Return the standard deviation of the white noise on a signal; 0 where motion scatters."""
    if signal.size < 32:
        return 0.0
    level = noise_level(signal, span)
    return float(level) if np.isfinite(level) and scatter(signal)[1] else 0.0


def _scale(recordings: Sequence[Recording], channel: str) -> Scale:
    low = min(float(recording[channel].min()) for recording in recordings)
    high = max(float(recording[channel].max()) for recording in recordings)
    noise = float(np.median([white(r[channel], high - low) for r in some(recordings)]))
    return Scale(low, high, noise)


def _held_with(
    recordings: Sequence[Recording], scales: Mapping[str, Scale], outputs: Sequence[str]
) -> dict[str, Scale]:
    """Return the inputs with what schedules and moves: in a hold, it is held too; outputs may creep."""
    beside = [
        name
        for name in SCHEDULES
        if name not in (*scales, *outputs) and all(name in recording for recording in recordings)
    ]
    known = {name: _scale(recordings, name) for name in beside}
    return {**scales, **{name: scale for name, scale in known.items() if scale.moves}}


def _turned(u: Array, scale: Scale) -> Indices:
    return reversals(u, max(swing_threshold(scale.noise, 0.0, u.size), LEAST * scale.span))


def _branches(
    recordings: Sequence[Recording], name: str, turns: Sequence[Indices], scale: Scale
) -> tuple[Branch, ...]:
    every = max(1, sum(places.size for places in turns) // MOST_BRANCHES)
    return tuple(
        _branch(recording[name][first : last + 1], recording.sample_time)
        for recording, places in zip(recordings, turns, strict=True)
        for first, last in list(pairwise(places))[::every]
        if abs(recording[name][last] - recording[name][first]) >= LEAST * scale.span
    )


def _branch(u: Array, sample_time: float | None) -> Branch:
    start, end = float(u[0]), float(u[-1])
    slow = fast = None
    if sample_time is not None:
        travel, seconds = abs(end - start), sample_time * (u.size - 1)
        slow = travel / seconds
        reached = np.maximum.accumulate((u - start) * np.sign(end - start)) / travel
        # where a level is first reached, between samples
        after = np.searchsorted(reached, LEVELS)
        before = np.maximum(after - 1, 0)
        rise = np.maximum(reached[after] - reached[before], 1e-12)
        took = np.diff(before + np.clip((LEVELS - reached[before]) / rise, 0.0, 1.0))
        # the second shortest, so that one crossing that noise hastens does not count
        seconds = sample_time * max(float(np.sort(took)[1]), 0.1)
        fast = max(slow, float(np.diff(LEVELS)[0]) * travel / seconds)
    return Branch(start, end, u.size - 1, slow, fast)


def _heights(
    recordings: Sequence[Recording], name: str, turns: Sequence[Indices], scale: Scale
) -> tuple[Array, Array]:
    upper: list[float] = []
    lower: list[float] = []
    for recording, places in zip(recordings, turns, strict=True):
        heights = (recording[name][places] - scale.low) / scale.span
        for height, way in zip(heights[1:-1], np.diff(heights)[:-1], strict=True):
            (upper if way > 0 else lower).append(float(height))
    return np.array(upper), np.array(lower)


def _holds(recordings: Sequence[Recording], scales: Mapping[str, Scale]) -> tuple[Hold, ...]:
    found: list[Hold] = []
    for number, recording in enumerate(recordings):
        if recording.sample_time is None or not scales:
            continue
        shares = [(recording[name] - scale.low) / scale.span for name, scale in scales.items()]
        bands = [
            max(HELD, swing_threshold(scale.noise, 0.0, len(recording)) / scale.span)
            for scale in scales.values()
        ]
        found += [
            Hold(number, start, stop, recording.sample_time * (stop - start))
            for start, stop in _held(shares, bands)
            if start > 0
            and max(np.ptp(u[max(0, 2 * start - stop) : start + 1]) for u in shares) > LEAST
        ]
    return tuple(found)


def _held(signals: Sequence[Array], bands: Sequence[float]) -> list[tuple[int, int]]:
    """Return the stretches in which no signal leaves its band, the longest first.

    Windows of doubling length are looked at, so that a slow ramp is no hold: a stretch of quiet windows
    that is longer than twice their length is one in which no longer window is quiet.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    n = signals[0].size
    masks: list[tuple[int, NDArray[np.bool_]]] = []
    length = SHORTEST_HOLD
    while length <= n:
        quiet = np.ones(n - length + 1, dtype=bool)
        part = slice(length // 2, length // 2 + n - length + 1)
        for u, band in zip(signals, bands, strict=True):
            quiet &= (maximum_filter1d(u, length) - minimum_filter1d(u, length))[part] <= band
        if not quiet.any():
            break
        masks.append((length, quiet))
        length *= 2
    found: list[tuple[int, int]] = []
    taken = np.zeros(n, dtype=bool)
    for length, quiet in reversed(masks):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], quiet.astype(np.int8), [0]])))
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            start, stop = int(first), int(last) - 1 + length
            if stop - start < 2 * length + SHORTEST_HOLD and not taken[start:stop].any():
                found.append((start, stop))
                taken[start:stop] = True
    return sorted(found, key=lambda stretch: stretch[0] - stretch[1])
