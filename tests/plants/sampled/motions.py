"""Patterns of pressure and load of drawn plants: shape (n,), each scaled to reach both ends exactly.

They take the generator, the duration [s], the sample time [s] and both ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array


def scaled(wave: ArrayLike, low: float, high: float) -> Array:
    """Return a wave that goes from ``low`` to ``high``."""
    wave = np.asarray(wave, np.float64)
    return low + (high - low) * (wave - wave.min()) / np.ptp(wave)


def clock(seconds: float, dt: float) -> Array:
    """Return the times of all samples."""
    return dt * np.arange(round(seconds / dt), dtype=np.float64)


def nested(
    rng: np.random.Generator, seconds: float, dt: float, low: float, high: float, period: float
) -> Array:
    """Triangles or cosines whose size shrinks."""
    t = clock(seconds, dt)
    phase = t / period
    triangles, cosines = 2 * np.abs(2 * (phase % 1.0) - 1) - 1, np.cos(2 * np.pi * phase)
    wave = triangles if rng.random() < 0.5 else cosines
    size = np.interp(t, [0, seconds], [1.0, rng.uniform(0.15, 0.4)])
    return scaled(-wave * size, low, high)


def turning(
    rng: np.random.Generator, seconds: float, dt: float, low: float, high: float, stroke: float
) -> Array:
    """Random turning points, joined by half cosines or straight lines of random duration."""
    t = clock(seconds, dt)
    count = int(4 * seconds / stroke) + 4
    times = np.append(0, np.cumsum(rng.uniform(0.4, 1.6, count) * stroke))
    points = rng.uniform(0, 1, count + 1)
    # high and low in turn, so that every point is a turning point
    points[1::2], points[::2] = 0.5 + 0.5 * points[1::2], 0.5 * points[::2]
    points *= rng.choice([0.5, 0.75, 1.0], count + 1)
    i = np.searchsorted(times, t, side="right") - 1
    s = (t - times[i]) / np.diff(times)[i]
    if rng.random() < 0.5:
        s = 0.5 - 0.5 * np.cos(np.pi * s)
    return scaled(points[i] + (points[i + 1] - points[i]) * s, low, high)


def stairs(
    rng: np.random.Generator,
    seconds: float,
    dt: float,
    low: float,
    high: float,
    hold: float,
    ramp: float = 0.3,
) -> Array:
    """Random levels that are held, with short ramps between them."""
    t = clock(seconds, dt)
    hold = min(hold, seconds / 6)
    count = int(3 * seconds / hold) + 3
    ends = np.cumsum(rng.uniform(0.5, 1.5, count) * hold + ramp)
    levels = rng.uniform(0, 1, count + 1)
    levels[1:3] = [1.0, 0.0]
    knots = np.append(0, np.column_stack([ends - ramp, ends]).ravel())
    return scaled(np.interp(t, knots, np.repeat(levels, 2)[: knots.size]), low, high)


def sines(
    rng: np.random.Generator, seconds: float, dt: float, low: float, high: float, fastest: float
) -> Array:
    """Six sines of random phase up to a frequency [Hz]; the faster, the smaller."""
    t = clock(seconds, dt)
    f = fastest * np.geomspace(0.08, 1.0, 6) * rng.uniform(0.9, 1.1, 6)
    waves = np.sin(2 * np.pi * (f * t[:, None] + rng.random(6))) / np.sqrt(f)
    return scaled(waves.sum(1), low, high)


def chirp(seconds: float, dt: float, low: float, high: float, slow: float, fast: float) -> Array:
    """A cosine whose frequency grows exponentially from ``slow`` to ``fast`` [Hz]."""
    t = clock(seconds, dt)
    ratio = np.log(fast / slow)
    phase = 2 * np.pi * slow * seconds / ratio * (np.exp(ratio * t / seconds) - 1)
    return scaled(-np.cos(phase), low, high)


def slow_levels(
    rng: np.random.Generator, seconds: float, dt: float, low: float, high: float, hold: float
) -> Array:
    """Levels with ramps of 1 s, for loads that change within a run."""
    return stairs(rng, seconds, dt, low, high, hold, ramp=1.0)
