"""Recordings made ready to be measured: noise averaged away, turning points found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import NARROWEST, Array
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.signals.reversals import noise_level, reversals, swing_threshold

Indices = NDArray[np.int64]

QUIET = 1e-3
"""Noise below this share of the range is left as it is."""

STILL = 0.005
"""Share of its range that the input may move while samples are averaged."""

ROUNDING = 1e-12
"""Noise below this share of the range is rounding, and none."""

SAMPLED = 20_000
"""Samples, or windows of them, that are looked at where all would take long."""

MAJOR = 0.1
"""Swings of the input below this share of its range do not part cycles."""

FEWEST = 10


@dataclass(frozen=True)
class Scale:
    """Ranges and noise over all recordings.

    Parameters
    ----------
    u_low, u_high, y_low, y_high : float
        Extremes of input and output, with their noise.
    u_noise, y_noise : float
        Standard deviation of one sample's noise; NaN for unknown.
    sign : float
        1 if the output grows with the input, -1 if it falls.
    """

    u_low: float
    u_high: float
    y_low: float
    y_high: float
    u_noise: float
    y_noise: float
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
    """One recording, ready to be measured.

    Parameters
    ----------
    u, y : array, shape (n,)
        Input and output, averaged over ``window`` samples each.
    sample_time : float or None
        [s].
    window : int
        Odd; 1 where nothing was averaged.
    u_noise, y_noise : float
        Standard deviation of the noise that is left; 0 where it is not known.
    turns : array of int
        First sample, turning points of the input, last sample.
    major_turns : array of int
        The same without swings below a tenth of the input range.
    """

    u: Array
    y: Array
    sample_time: float | None
    window: int
    u_noise: float
    y_noise: float
    turns: Indices
    major_turns: Indices

    @property
    def heights(self) -> Array:
        """Input at the turning points, shape (m,)."""
        return self.u[self.turns]


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
    pairs = [(recording[input_name], recording[output_name]) for recording in recordings]
    n = sum(u.size for u, _ in pairs)
    if n < FEWEST:
        raise DataError(
            f"{n} samples are too few to characterize",
            file=recordings[0].source,
            channel=input_name,
            remedy=f"record at least {FEWEST}, better whole cycles with 50 or more each",
        )
    u_low, u_high = min(u.min() for u, _ in pairs), max(u.max() for u, _ in pairs)
    y_low, y_high = min(y.min() for _, y in pairs), max(y.max() for _, y in pairs)
    for channel, low, high in ((input_name, u_low, u_high), (output_name, y_low, y_high)):
        if low == high:
            raise DataError(
                f"it is constant at {low:g}, so there is no hysteresis to see",
                file=recordings[0].source,
                channel=channel,
                remedy="record while it moves, or name another channel",
            )
        if high - low < NARROWEST:
            raise DataError(
                f"it moves by {high - low:.3g} in all, which is too little to compute with",
                file=recordings[0].source,
                channel=channel,
                remedy="check its column and unit, or name another channel",
            )
    together = sum(float(np.sum((u - u.mean()) * (y - y.mean()))) for u, y in pairs)
    scale = Scale(
        float(u_low),
        float(u_high),
        float(y_low),
        float(y_high),
        _noise([u for u, _ in pairs], float(u_high - u_low)),
        _noise([y for _, y in pairs], float(y_high - y_low)),
        -1.0 if together < 0 else 1.0,
    )
    tracks = [
        _track(u, y, recording.sample_time, scale)
        for recording, (u, y) in zip(recordings, pairs, strict=True)
    ]
    return scale, tracks


def _noise(signals: Sequence[Array], span: float) -> float:
    levels = [noise_level(signal, span) for signal in signals]
    known = [level for level in levels if np.isfinite(level)]
    noise = float(np.median(known)) if known else float("nan")
    return 0.0 if noise < ROUNDING * span else noise


def _track(u: Array, y: Array, sample_time: float | None, scale: Scale) -> Track:
    noisy = scale.u_noise > QUIET * scale.u_span or scale.y_noise > QUIET * scale.y_span
    window = _still_window(u, STILL * scale.u_span) if noisy else 1
    if window > 1:
        from scipy.ndimage import uniform_filter1d

        u, y = (np.asarray(uniform_filter1d(x, window, mode="nearest")) for x in (u, y))
    left = 1 / np.sqrt(window)
    u_noise, y_noise = (float(np.nan_to_num(x)) * left for x in (scale.u_noise, scale.y_noise))
    threshold = swing_threshold(u_noise, scale.u_span, u.size)
    turns = reversals(u, threshold)
    major_turns = reversals(u, max(threshold, MAJOR * scale.u_span))
    return Track(u, y, sample_time, window, u_noise, y_noise, turns, major_turns)


def _still_window(u: Array, limit: float) -> int:
    """Return the longest odd window, by doubling, in which the input moves no more than a limit.

    Means of neighbouring windows are compared, so that noise is not taken for movement; one pair in
    twenty may differ by more, because jumps are short. Where noise hides even that, the window with
    the smallest differences.
    """
    sums = np.concatenate([[0.0], np.cumsum(u - u[0])])
    moved = {}
    window = 1
    while 8 * window < u.size:
        stride = max(1, window // 2, u.size // SAMPLED)
        means = [
            (sums[start + window :: stride] - sums[start : -window or None : stride]) / window
            for start in (0, window)
        ]
        before = means[0][: means[1].size]
        moved[window] = float(np.quantile(np.abs(means[1] - before), 0.95))
        window *= 2
    if not moved:
        return 1
    still = [size for size, way in moved.items() if way <= limit]
    return max(1, max(still, default=min(moved, key=lambda size: moved[size])) - 1)
