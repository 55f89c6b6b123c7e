"""Preparation of recordings for measurement: noise averaging and turning points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import NARROWEST, Array
from mckibben.errors import DataError
from mckibben.recording import FEWEST_SAMPLES, Recording
from mckibben.signals.holds import shortest_hold
from mckibben.signals.reversals import branches_between, noise_level, reversals, swing_threshold

Range = tuple[float, float]

QUIET, ROUNDING = 1e-3, 1e-12
"""Shares of the range: noise below the first is not averaged; below the second it is rounding."""

MAJOR = 0.1
"""Smallest swing of the input, as a share of its range, that separates cycles."""


@dataclass(frozen=True)
class Spread:
    """Extremes of a channel over all recordings, and its sensor noise.

    Noise is the standard deviation of a sample, NaN for unknown; a step is the least distance between
    two readings.
    """

    low: float
    high: float
    noise: float
    step: float

    @property
    def span(self) -> float:
        """Range."""
        return self.high - self.low

    @classmethod
    def of(cls, signals: Sequence[Array], source: str | None, channel: str) -> Spread:
        """Return that of the pieces of a channel, which must vary."""
        readings = np.unique(np.concatenate(signals))
        low, high = float(readings[0]), float(readings[-1])
        span = high - low
        if span < NARROWEST:
            raise DataError(
                f"it {f'moves by {span:.3g} in all' if span else f'is constant at {low:g}'}, so "
                "hysteresis cannot be measured",
                file=source,
                channel=channel,
                remedy="record while it moves, check its column and unit, or name another channel",
            )
        levels = [noise_level(signal, span) for signal in signals if signal.size > 1]
        known = [level for level in levels if not np.isnan(level)]
        noise = float(np.median(known)) if known else float("nan")
        steps = np.diff(readings)
        step = float(steps[steps > ROUNDING * span].min())
        return cls(low, high, 0.0 if noise < ROUNDING * span else noise, step)


@dataclass(frozen=True)
class Scale:
    """Input and output over all recordings; the sign is -1 if the output falls with the input."""

    u: Spread
    y: Spread
    sign: float = 1.0


@dataclass(frozen=True)
class Track:
    """One recording: input and output, (n,) each, as moving averages where there is noise.

    ``y_noise`` is the noise that is left, 0 where unknown. ``turns`` are the first sample, the turning
    points of the input and the last sample, ``major_turns`` the same without swings below a tenth of
    the input range. A ``periodic`` recording starts at its lowest input.
    """

    u: Array
    y: Array
    sample_time: float | None
    y_noise: float
    turns: NDArray[np.int64]
    major_turns: NDArray[np.int64]
    periodic: bool

    @property
    def branches(self) -> list[tuple[slice, int]]:
        """Samples between major turning points, with 1 if the input rises, else -1."""
        found = branches_between(self.u, self.major_turns)
        return [(slice(start, stop), way) for start, stop, way in found]


def prepare(
    recordings: Sequence[Recording], input_name: str, output_name: str
) -> tuple[Scale, list[Track]]:
    """Return the common scale of recordings, and each of them prepared for measurement.

    Raises
    ------
    DataError
        On no recordings, a missing channel, fewer than ten samples, or a channel that hardly moves.
    """
    if not recordings:
        raise DataError("there is no recording to characterize", remedy="give at least one")
    us, ys = ([one[name] for one in recordings] for name in (input_name, output_name))
    source, n = recordings[0].source, sum(map(len, recordings))
    if n < FEWEST_SAMPLES:
        raise DataError(
            f"{n} samples are too few to characterize",
            file=source,
            channel=input_name,
            remedy=f"record at least {FEWEST_SAMPLES}, better whole cycles with 50 or more each",
        )
    scale = Scale(Spread.of(us, source, input_name), Spread.of(ys, source, output_name))
    tracks = [
        _track(u, y, one.sample_time, scale) for u, y, one in zip(us, ys, recordings, strict=True)
    ]
    # what the output does along the branches: neither drift nor another level between runs turns it
    follows = sum(
        way * float(track.y[part][-1] - track.y[part][0])
        for track in tracks
        for part, way in track.branches
    )
    return replace(scale, sign=-1.0 if follows < 0 else 1.0), tracks


def _track(u: Array, y: Array, sample_time: float | None, scale: Scale) -> Track:
    periodic = _closes(u, scale.u.noise) and _closes(y, scale.y.noise)
    if periodic:  # one loop wherever its record begins
        if u[0] == u[-1] and y[0] == y[-1]:
            u, y = u[:-1], y[:-1]
        start = int(np.argmin(u))
        u, y = (np.append(np.roll(x, -start), x[start]) for x in (u, y))
    noisy = any(spread.noise > QUIET * spread.span for spread in (scale.u, scale.y))
    # so many samples take the input over 1 % of its range
    window = max(1, shortest_hold(u, scale.u.span) // 50 - 1) | 1 if noisy else 1
    if window > 1:
        from scipy.ndimage import uniform_filter1d

        u, y = (np.asarray(uniform_filter1d(x, window, mode="nearest")) for x in (u, y))
    u_noise, y_noise = (
        float(np.nan_to_num(spread.noise)) / np.sqrt(window) for spread in (scale.u, scale.y)
    )
    threshold = swing_threshold(u_noise, scale.u.span, u.size)
    turns = reversals(u, threshold)
    major_turns = reversals(u, max(threshold, MAJOR * scale.u.span))
    return Track(u, y, sample_time, y_noise, turns, major_turns, periodic)


def _closes(x: Array, noise: float) -> bool:
    """Return whether a signal is periodic: its end continues at its beginning."""
    usual = float(np.quantile(np.abs(np.diff(x)), 0.99)) if x.size > FEWEST_SAMPLES else 0.0
    return bool(abs(x[0] - x[-1]) <= max(1.5 * usual, 4 * np.nan_to_num(noise)))
