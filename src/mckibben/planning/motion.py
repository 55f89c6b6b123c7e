"""Motion for a recording: random motion within limits, full cycles, and holds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mckibben.arrays import Array
from mckibben.planning.limits import Limits

MOST_SLOWER = 10.0
"""Times longer than at the highest rate that a stroke of random motion takes, at most."""

FEWEST_STROKES = 12.0
"""Strokes over the whole range, at the slowest speed, for which there must be time."""

MOST_SHARE = 0.3
"""Most of the time that holds take, and that full cycles take."""

SHORTEST_HOLD = 10.0
"""Shortest hold [s]."""

CYCLES = 3
"""Full cycles of everything together: of the second and the third, lags of the first have settled."""

PEAK = np.pi / 2
"""Highest over mean speed of a half cosine."""

Parts = list[tuple[str, Array]]
"""What each part is for, and its commands, shape (n, channels)."""


def motion(
    limits: Limits, seconds: float, step: float, holds: bool, rng: np.random.Generator
) -> Parts:
    """Return motion that starts and ends at rest, in parts.

    Random motion comes first, then full cycles and holds, where there is time.

    Parameters
    ----------
    limits : Limits
    seconds, step : float
        Duration of all, and sample time [s].
    holds : bool
        Whether to hold.
    """
    low, high, rest = (
        np.array([getattr(limit, end) for limit in limits.values()])
        for end in ("low", "high", "rest")
    )
    crossing = PEAK * max(limit.crossing for limit in limits.values())
    stops: list[tuple[str, Array, float]] = []  # levels to go to, and how long to stay there
    if (2 * CYCLES + 1) * crossing <= MOST_SHARE * seconds:
        stops += [("repeats", end, 0.0) for end in (low, *(high, low) * CYCLES)]
    for count in (2, 1) if holds else ():
        stays = MOST_SHARE * seconds / count - crossing
        if stays >= SHORTEST_HOLD:
            shares = rng.uniform(0.15, 0.85, (count, low.size))
            stops += [("holds", level, stays) for level in low + shares * (high - low)]
            break
    stops.append(("rest", rest, 0.0))
    durations = [crossing, *(_duration(limits, a, b) for (_, a, _), (_, b, _) in pairwise(stops))]
    random_seconds = (
        seconds - sum(durations) - sum(stays for *_, stays in stops) - step * len(stops)
    )
    parts = [("random", _strokes(limits, random_seconds, step, rng))]
    for purpose, level, stays in stops:
        last_level = parts[-1][1][-1]
        count = max(int(np.ceil(_duration(limits, last_level, level) / step)), 1)
        share = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, count + 1) / count)[:, np.newaxis]
        hold_rows = np.tile(level, (round(stays / step), 1))
        parts.append(
            (purpose, np.concatenate([last_level + share * (level - last_level), hold_rows]))
        )
    n_idle = round(seconds / step) - sum(len(part) for _, part in parts)
    return [*parts, ("rest", np.tile(rest, (max(n_idle, 0), 1)))]


def _strokes(limits: Limits, seconds: float, step: float, rng: np.random.Generator) -> Array:
    """Return random levels joined by half cosines of random speeds, each channel independently."""
    columns = []
    for limit in limits.values():
        slowest = np.clip(
            seconds / (FEWEST_STROKES * PEAK * max(limit.crossing, step)), 1.0, MOST_SLOWER
        )
        times, levels = [0.0], [limit.rest]
        while times[-1] < seconds:
            levels.append(float(rng.uniform(limit.low, limit.high)))
            duration = PEAK * abs(levels[-1] - levels[-2]) / limit.rate
            times.append(times[-1] + max(duration * float(slowest ** rng.uniform()), step))
        time = step * np.arange(round(seconds / step))
        stroke = np.searchsorted(times, time, side="right") - 1
        share = 0.5 - 0.5 * np.cos(np.pi * (time - np.take(times, stroke)) / np.diff(times)[stroke])
        columns.append(np.take(levels, stroke) + np.diff(levels)[stroke] * share)
    return np.column_stack(columns)


def _duration(limits: Limits, start: Array, end: Array) -> float:
    """Return the duration of half cosines of all channels from one level to another [s]."""
    distances = zip(limits.values(), (end - start).tolist(), strict=True)
    return PEAK * max(abs(distance) / limit.rate for limit, distance in distances)
