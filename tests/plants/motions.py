"""Pressure patterns of virtual plants, one column; `from_empty` leads into every run."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array

FILLING, WAITING = 3.0, 5.0  # s


def from_empty(pressures: Array, sample_time: float) -> tuple[Array, int]:
    """Return pressures with the filling of empty muscles before them, and how many samples it is."""
    filling = np.linspace(0.0, 1.0, round(FILLING / sample_time), endpoint=False)
    lead = np.append(filling, np.ones(round(WAITING / sample_time)))
    return np.concatenate([lead[:, None] * pressures[0], pressures]), lead.size


def held(value: float, like: Array) -> Array:
    """Return one constant load through a whole run, shape (n, 1)."""
    return np.full((len(like), 1), value)


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


def chirp(
    seconds: float, sample_time: float, low: float, high: float, rates: tuple[float, float]
) -> Array:
    """Swing over a range, ever faster: ``rates`` [Hz] at begin and end."""
    time = _time(seconds, sample_time)
    turns = rates[0] * time + 0.5 * (rates[1] - rates[0]) * time**2 / seconds
    return 0.5 * (low + high) - 0.5 * (high - low) * np.cos(2 * np.pi * turns)


def _time(seconds: float, sample_time: float) -> Array:
    return sample_time * np.arange(round(seconds / sample_time), dtype=np.float64)
