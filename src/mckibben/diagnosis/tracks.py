"""Recordings made ready to be measured: noise averaged away, turning points found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import NARROWEST, Array
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.signals.holds import shortest_hold
from mckibben.signals.reversals import noise_level, reversals, swing_threshold

Indices = NDArray[np.int64]
Range = tuple[float, float]

QUIET = 1e-3
"""Noise below this share of the range is not averaged away."""

ROUNDING = 1e-12
"""Noise below this share of the range is rounding."""

MAJOR = 0.1
"""Swings of the input below this share of its range do not separate cycles."""

FEWEST = 10
"""Samples of all recordings, at least."""

REPEATS = 3
"""Values of which an interval is made, at least."""


@dataclass(frozen=True)
class Scale:
    """Extremes of input and output over all recordings, and what their sensors add.

    Noise is the standard deviation of a sample, NaN for unknown; a step is the least distance between
    two readings. The sign is 1 if the output grows with the input, -1 if it falls.
    """

    u_low: float
    u_high: float
    y_low: float
    y_high: float
    u_noise: float
    y_noise: float
    u_step: float
    y_step: float
    sign: float

    @property
    def u_span(self) -> float:
        """Range of the input."""
        return self.u_high - self.u_low

    @property
    def y_span(self) -> float:
        """Range of the output."""
        return self.y_high - self.y_low


@dataclass(frozen=True)
class Track:
    """One recording: input and output, (n,) each, as moving averages where there is noise.

    ``u_noise`` and ``y_noise`` are the noise that is left, 0 where unknown. ``turns`` are the first
    sample, the turning points of the input and the last sample, ``major_turns`` the same without swings
    below a tenth of the input range. A ``periodic`` recording starts at its lowest input.
    """

    u: Array
    y: Array
    sample_time: float | None
    u_noise: float
    y_noise: float
    turns: Indices
    major_turns: Indices
    periodic: bool

    @property
    def heights(self) -> Array:
        """Input at the turning points, shape (m,)."""
        return self.u[self.turns]

    @property
    def branches(self) -> list[tuple[slice, float]]:
        """Samples between major turning points, and 1 where the input rises, else -1."""
        ways = np.sign(np.diff(self.u[self.major_turns]))
        bounds = zip(self.major_turns[:-1], self.major_turns[1:], ways, strict=True)
        return [(slice(int(a), int(b) + 1), float(way)) for a, b, way in bounds]


def prepare(
    recordings: Sequence[Recording], input_name: str, output_name: str
) -> tuple[Scale, list[Track]]:
    """Return the common scale of recordings, and each of them ready to be measured.

    Raises
    ------
    DataError
        On no recordings, a missing channel, fewer than ten samples, or a channel that hardly moves.
    """
    if not recordings:
        raise DataError("there is no recording to characterize", remedy="give at least one")
    pairs = [(one[input_name], one[output_name]) for one in recordings]
    n = sum(u.size for u, _ in pairs)
    if n < FEWEST:
        raise DataError(
            f"{n} samples are too few to characterize",
            file=recordings[0].source,
            channel=input_name,
            remedy=f"record at least {FEWEST}, better whole cycles with 50 or more each",
        )
    us, ys = ([pair[place] for pair in pairs] for place in (0, 1))
    u_low, u_high = _ends(us, recordings[0].source, input_name)
    y_low, y_high = _ends(ys, recordings[0].source, output_name)
    scale = Scale(
        *(u_low, u_high, y_low, y_high, _noise(us, u_high - u_low), _noise(ys, y_high - y_low)),
        *(_step(us, u_high - u_low), _step(ys, y_high - y_low), 1.0),
    )
    tracks = [
        _track(u, y, one.sample_time, scale) for one, (u, y) in zip(recordings, pairs, strict=True)
    ]
    # what the output does along the branches: neither drift nor another level between runs turns it
    follows = sum(
        way * float(track.y[part][-1] - track.y[part][0])
        for track in tracks
        for part, way in track.branches
    )
    return replace(scale, sign=-1.0 if follows < 0 else 1.0), tracks


def _ends(signals: Sequence[Array], source: str | None, channel: str) -> Range:
    """Return lowest and highest value of a channel that moves."""
    low, high = float(min(x.min() for x in signals)), float(max(x.max() for x in signals))
    if high - low < NARROWEST:
        moves = f"moves by {high - low:.3g} in all" if high > low else f"is constant at {low:g}"
        raise DataError(
            f"it {moves}, so there is no hysteresis to see",
            file=source,
            channel=channel,
            remedy="record while it moves, check its column and unit, or name another channel",
        )
    return low, high


def interval(values: Sequence[float]) -> Range | None:
    """Return the 95 % interval of the median of repeated values by Student's t; None of two or fewer.

    It does not reach beyond zero where all values are of one sign.
    """
    from scipy.special import stdtrit

    n = len(values)
    if n < REPEATS:
        return None
    # the standard error of a median of normal values is 1.2533 times that of their mean
    half = 1.2533 * float(np.std(values, ddof=1)) / np.sqrt(n) * float(stdtrit(n - 1, 0.975))
    low, high = float(np.median(values)) - half, float(np.median(values)) + half
    return max(low, 0.0) if min(values) >= 0 else low, min(high, 0.0) if max(values) <= 0 else high


def median(values: Sequence[float]) -> float | None:
    """Return the median, or None of nothing."""
    return float(np.median(values)) if len(values) else None


def _noise(signals: Sequence[Array], span: float) -> float:
    levels = [noise_level(signal, span) for signal in signals if signal.size > 1]
    noise = float(np.median(known)) if (known := [x for x in levels if x == x]) else float("nan")
    return 0.0 if noise < ROUNDING * span else noise


def _step(signals: Sequence[Array], span: float) -> float:
    """Return the least distance between two readings."""
    apart = np.diff(np.unique(np.concatenate(signals)))
    return float(apart[apart > ROUNDING * span].min())


def _track(u: Array, y: Array, sample_time: float | None, scale: Scale) -> Track:
    periodic = _closes(u, scale.u_noise) and _closes(y, scale.y_noise)
    if periodic:  # one loop wherever its record begins
        if u[0] == u[-1] and y[0] == y[-1]:
            u, y = u[:-1], y[:-1]
        start = int(np.argmin(u))
        u, y = (np.append(np.roll(x, -start), x[start]) for x in (u, y))
    noisy = scale.u_noise > QUIET * scale.u_span or scale.y_noise > QUIET * scale.y_span
    # so many samples take the input over 1 % of its range
    window = max(1, shortest_hold(u, scale.u_span) // 50 - 1) | 1 if noisy else 1
    if window > 1:
        from scipy.ndimage import uniform_filter1d

        u, y = (np.asarray(uniform_filter1d(x, window, mode="nearest")) for x in (u, y))
    left = 1 / np.sqrt(window)
    u_noise, y_noise = (float(np.nan_to_num(x)) * left for x in (scale.u_noise, scale.y_noise))
    threshold = swing_threshold(u_noise, scale.u_span, u.size)
    turns = reversals(u, threshold)
    major_turns = reversals(u, max(threshold, MAJOR * scale.u_span))
    return Track(u, y, sample_time, u_noise, y_noise, turns, major_turns, periodic)


def _closes(x: Array, noise: float) -> bool:
    """Tell whether a signal goes from its end to its beginning as from one sample to the next."""
    usual = float(np.quantile(np.abs(np.diff(x)), 0.99)) if x.size > FEWEST else 0.0
    return bool(abs(x[0] - x[-1]) <= max(1.5 * usual, 4 * np.nan_to_num(noise)))
