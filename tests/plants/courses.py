"""Courses that rigs are driven through, all from zero and back to zero, and the noise of sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array

NOISE = 0.0005
"""Standard deviation of a sensor's noise, as a share of its span."""


def allowed(commands: Array, high: float) -> Array:
    """Return what a regulator makes of pressures asked for: none below zero or far above the highest."""
    return np.ascontiguousarray(np.clip(commands, 0.0, 1.25 * high))


def measured(rng: np.random.Generator, samples: Array, span: float) -> Array:
    """Return what a sensor of this span shows."""
    return samples + NOISE * span * rng.standard_normal(samples.shape)


def through(levels: Sequence[float], duration: float, step: float) -> Array:
    """Return ramps of one speed through levels, which fill the duration."""
    corners = np.array([0.0, *levels, 0.0])
    times = np.append(0.0, np.cumsum(np.abs(np.diff(corners))))
    time = np.arange(round(duration / step)) * step
    return np.interp(time / duration * times[-1], times, corners)


def wandering(
    rng: np.random.Generator,
    duration: float,
    step: float,
    *,
    low: float,
    high: float,
    speed: tuple[float, float],
    rest: float = 0.0,
) -> Array:
    """Return ramps between random levels at random speeds, with rests of up to some seconds."""
    times, levels = [0.0], [0.0]
    while times[-1] < duration:
        level = float(rng.uniform(low, high))
        times.append(times[-1] + abs(level - levels[-1]) / float(rng.uniform(*speed)) + 1e-3)
        levels.append(level)
        times.append(times[-1] + float(rng.uniform(0.0, rest)) + 1e-3)
        levels.append(level)
    time = np.arange(round(duration / step)) * step
    return _framed(np.interp(time, times, levels), step)


def waving(
    rng: np.random.Generator,
    duration: float,
    step: float,
    *,
    low: float,
    high: float,
    band: tuple[float, float],
) -> Array:
    """Return a sum of seven sines of random phases in a band of frequencies [Hz], scaled to a range."""
    time = np.arange(round(duration / step)) * step
    frequencies = np.geomspace(*band, 7) * rng.uniform(0.93, 1.07, 7)
    phases = rng.uniform(0.0, 2.0 * np.pi, 7)
    # slower sines are larger, as in most motions
    sines = np.sin(2.0 * np.pi * frequencies * time[:, None] + phases) / np.sqrt(frequencies)
    wave = sines.sum(axis=1)
    wave = low + (high - low) * (wave - wave.min()) / np.ptp(wave)
    return _framed(wave, step)


def stepping(
    rng: np.random.Generator,
    duration: float,
    step: float,
    *,
    low: float,
    high: float,
    hold: tuple[float, float],
) -> Array:
    """Return random levels, each held for a random time."""
    samples = np.zeros(round(duration / step))
    at = round(0.5 / step)
    while at < samples.size:
        samples[at:] = rng.uniform(low, high)
        at += round(float(rng.uniform(*hold)) / step)
    return _framed(samples, step)


def _framed(samples: Array, step: float, seconds: float = 1.5) -> Array:
    """Return samples that grow out of zero and go back to it."""
    time = np.arange(samples.size) * step
    return samples * np.clip(np.minimum(time, time[-1] - time) / seconds, 0.0, 1.0)
