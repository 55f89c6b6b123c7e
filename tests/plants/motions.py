"""Patterns that drive virtual plants, one column each.

Those of some plants begin anywhere, and `from_empty` leads into every run; those of others begin and
end at zero, as `framed` has it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array

FILLING, WAITING = 3.0, 5.0  # s


def from_empty(pressures: Array, sample_time: float) -> tuple[Array, int]:
    """Return pressures with the filling of empty muscles before them, and how many samples it is."""
    filling = np.linspace(0.0, 1.0, round(FILLING / sample_time), endpoint=False)
    lead = np.append(filling, np.ones(round(WAITING / sample_time)))
    return np.concatenate([lead[:, None] * pressures[0], pressures]), lead.size


def framed(samples: Array, sample_time: float, seconds: float = 1.5) -> Array:
    """Return samples that grow out of zero and go back to it."""
    time = sample_time * np.arange(samples.size)
    return samples * np.clip(np.minimum(time, time[-1] - time) / seconds, 0.0, 1.0)


def wander(
    rng: np.random.Generator,
    seconds: float,
    sample_time: float,
    low: float,
    high: float,
    strokes: tuple[float, float] = (0.8, 4.0),
) -> Array:
    """Go between random turning points by half cosines that last ``strokes`` [s]."""
    count = int(seconds / strokes[0]) + 2
    times = np.append(0.0, np.cumsum(rng.uniform(*strokes, count)))
    points = rng.uniform(low, high, count + 1)
    time = _time(seconds, sample_time)
    at = np.searchsorted(times, time, side="right") - 1
    part = (time - times[at]) / np.diff(times)[at]
    return points[at] + (points[at + 1] - points[at]) * 0.5 * (1.0 - np.cos(np.pi * part))


def ramps(
    rng: np.random.Generator,
    seconds: float,
    sample_time: float,
    low: float,
    high: float,
    speed: tuple[float, float],
    rest: float,
) -> Array:
    """Go between random levels at random speeds, with rests of up to ``rest`` [s]; framed."""
    times, levels = [0.0], [0.0]
    while times[-1] < seconds:
        level = float(rng.uniform(low, high))
        arrives = times[-1] + abs(level - levels[-1]) / float(rng.uniform(*speed)) + 1e-3
        times += [arrives, arrives + float(rng.uniform(0.0, rest)) + 1e-3]
        levels += [level, level]
    return framed(np.interp(_time(seconds, sample_time), times, levels), sample_time)


def through(levels: Sequence[float], seconds: float, sample_time: float) -> Array:
    """Go by ramps of one speed from zero through levels to zero."""
    corners = np.array([0.0, *levels, 0.0])
    times = np.append(0.0, np.cumsum(np.abs(np.diff(corners))))
    return np.interp(_time(seconds, sample_time) / seconds * times[-1], times, corners)


def stairs(
    rng: np.random.Generator,
    seconds: float,
    sample_time: float,
    low: float,
    high: float,
    hold: tuple[float, float] = (2.0, 5.0),
    ramp: float = 0.4,
) -> Array:
    """Hold random levels for ``hold`` [s], with ramps of ``ramp`` [s] between them."""
    count = int(seconds / hold[0]) + 2
    begins = np.cumsum(rng.uniform(*hold, count) + ramp)
    levels = rng.uniform(low, high, count + 1)
    times = np.column_stack([begins - ramp, begins]).ravel()
    return np.interp(_time(seconds, sample_time), np.append(0.0, times), np.repeat(levels, 2)[:-1])


def waves(
    rng: np.random.Generator,
    seconds: float,
    sample_time: float,
    low: float,
    high: float,
    band: tuple[float, float],
) -> Array:
    """Sum seven sines of random phases in a band of frequencies [Hz], scaled to a range; framed."""
    time = _time(seconds, sample_time)
    frequencies = np.geomspace(*band, 7) * rng.uniform(0.93, 1.07, 7)
    phases = rng.uniform(0.0, 2.0 * np.pi, 7)
    # slower sines are larger, as in most motions
    sines = np.sin(2.0 * np.pi * frequencies * time[:, None] + phases) / np.sqrt(frequencies)
    wave = sines.sum(axis=1)
    return framed(low + (high - low) * (wave - wave.min()) / np.ptp(wave), sample_time)


def swell(
    seconds: float,
    sample_time: float,
    low: float,
    high: float,
    period: float,
    sizes: tuple[float, float] = (1.0, 0.1),
    phase: float = -0.5 * np.pi,
) -> Array:
    """Swing about mid-range, from one share of the full size to another: nested loops."""
    time = _time(seconds, sample_time)
    size = np.interp(time, [0.0, seconds], sizes)
    swing = size * np.sin(2 * np.pi * time / period + phase)
    return 0.5 * (low + high) + 0.5 * (high - low) * swing


def _time(seconds: float, sample_time: float) -> Array:
    return sample_time * np.arange(round(seconds / sample_time), dtype=np.float64)
