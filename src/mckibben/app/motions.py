"""Motions to wish for: points of time and value, ready-made or drawn, and their reference."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import Recording

Points = list[tuple[float, float]]
"""Time [s] and value, times rising."""

MOTIONS = {"steps": "Steps", "sine": "Sine", "triangle": "Triangle", "random": "Random"}
"""Ready-made motions."""

A_CYCLE = 40
"""Points of a cycle of a sine."""

MOST_POINTS = 2000
"""Of a motion."""

MOST_SAMPLES = 1_000_000
"""Of a reference."""


def motion(
    kind: str, seconds: float, first: float, other: float, cycles: int = 2, seed: int = 0
) -> Points:
    """Return a ready-made motion between two ends.

    Parameters
    ----------
    kind : str
        One of `MOTIONS`. Steps go there and back by quarters; of random ones there are as many as four
        times the cycles, and they lead in straight lines from one to the next.
    seconds : float
    first, other : float
        Where it begins, and where it turns.
    cycles : int
    seed : int
        Of the random ones.

    Raises
    ------
    DataError
        If there is no room for it.
    """
    if not (seconds > 0 and first != other and 1 <= cycles <= MOST_POINTS // A_CYCLE):
        raise DataError(
            f"there is no motion of {seconds:g} s between {first:g} and {other:g} in {cycles} cycles",
            remedy=f"give a time, two ends, and 1 to {MOST_POINTS // A_CYCLE} cycles",
        )
    if kind == "sine":
        shares: Array = np.linspace(0.0, 1.0, A_CYCLE * cycles + 1)
        levels: Array = np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * cycles * shares))
    elif kind == "triangle":
        shares = np.linspace(0.0, 1.0, 2 * cycles + 1)
        levels = np.asarray(np.arange(len(shares)) % 2.0, dtype=np.float64)
    elif kind == "random":
        rng = np.random.default_rng(seed)
        shares = np.linspace(0.0, 1.0, 4 * cycles + 1)
        levels = np.concatenate([[0.0], rng.uniform(0.0, 1.0, len(shares) - 1)])
    else:
        stairs = np.tile([0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25], cycles)
        stairs = np.append(stairs, 0.0)
        ends = np.arange(len(stairs) + 1) / len(stairs)
        shares = np.sort(np.concatenate([ends[:-1], ends[1:] - 1e-3 / len(stairs)]))
        levels = np.repeat(stairs, 2)
    values = first + (other - first) * levels
    return [(float(t), float(y)) for t, y in zip(seconds * shares, values, strict=True)]


def snapped(time: float, value: float, every: float, grid: float) -> tuple[float, float]:
    """Return a point on the grid of time and value."""
    return round(round(time / every) * every, 9), round(round(value / grid) * grid, 9)


def grid_of(low: float, high: float, most: int = 6) -> float:
    """Return a round distance between lines that has at most so many of them between two ends."""
    raw = max(high - low, 1e-12) / most
    power = 10.0 ** np.floor(np.log10(raw))
    return float(next(power * step for step in (1, 2, 5, 10) if power * step >= raw * (1 - 1e-9)))


def with_point(points: Points, time: float, value: float) -> Points:
    """Return points with one more, in order of time; one at the same time gives way."""
    others = [point for point in points if abs(point[0] - time) > 1e-9]
    return sorted([*others, (time, value)])


def parsed(text: str) -> Points:
    """Return pairs of numbers, one a line.

    Raises
    ------
    DataError
        On a line that is not two numbers, and on too many lines.
    """
    points: Points = []
    lines = [part.strip() for part in text.splitlines() if part.strip()]
    if len(lines) > MOST_SAMPLES // 10:
        raise DataError("these are too many points", remedy="load them as a file")
    for row, line in enumerate(lines, start=1):
        words = line.replace(",", " ").replace(";", " ").split()
        try:
            time, value = map(float, words)
        except ValueError:
            raise DataError(
                f"{line!r:.40} is not a time and a value",
                row=row,
                remedy="write two numbers a line",
            ) from None
        if not np.isfinite([time, value]).all():
            raise DataError(f"{line!r:.40} has no end", row=row, remedy="write two numbers")
        points.append((time, value))
    return points


def unparsed(points: Points) -> str:
    """Return points as text, one a line."""
    return "\n".join(f"{time:.7g} {value:.6g}" for time, value in points)


def reference_recording(
    points: Mapping[str, Points],
    step: float,
    held: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
) -> Recording:
    """Return straight lines through points, for every channel, beside what is held.

    Channels that end before the longest hold their last value.

    Parameters
    ----------
    points : mapping of str to list of (float, float)
        Time [s] and value, by channel.
    step : float
        Time between samples [s].
    held : mapping of str to float, optional
        Channels that stay at a number.
    units : mapping of str to str, optional
        Of channels whose names do not say it.

    Raises
    ------
    DataError
        If a channel has fewer than two points, or their times do not increase.
    """
    arrays = {}
    if not step > 0:
        raise DataError("there is no time between steps", remedy="give one, such as 0.02 s")
    for name, own in points.items():
        if len(own) < 2:
            raise DataError(
                "a reference needs two points or more", channel=name, remedy="draw some"
            )
        times, values = np.array(own, dtype=float).T
        if np.any(np.diff(times) <= 0) or not np.isfinite(values).all():
            raise DataError(
                "the times of the reference do not increase",
                channel=name,
                remedy="give points from left to right",
            )
        arrays[name] = times, values
    first = min(times[0] for times, _ in arrays.values())
    last = max(times[-1] for times, _ in arrays.values())
    if (last - first) / step > MOST_SAMPLES:
        raise DataError("the reference is too long", remedy="shorten it, or take longer steps")
    grid = np.arange(first, last + 0.5 * step, step)
    channels = {name: np.interp(grid, *own) for name, own in arrays.items()}
    channels |= {name: np.full(len(grid), value) for name, value in (held or {}).items()}
    return Recording(channels, step, {n: u for n, u in (units or {}).items() if n in channels})


def of_file(
    path: Path,
    found: Sequence[Recording],
    units: Mapping[str, str],
    wanted: Collection[str],
    held: Collection[str],
) -> Recording:
    """Return a reference that was read from a file.

    Parameters
    ----------
    path : Path
    found : sequence of Recording
        What is in it.
    units : mapping
        Of channels.
    wanted, held : collection of str
        Channels that it must have, and may have.

    Raises
    ------
    DataError
        If there is none in it.
    """
    if len(found) != 1:
        raise DataError("it holds several recordings", file=path, remedy="give a file of one")
    (given,) = found
    if given.sample_time is None:
        remedy = "add a column time_s, or draw the motion"
        raise DataError("it has no time", file=path, remedy=remedy)
    names = {name: f"reference_{name}" for name in (*wanted, *held)}
    names = {name: other if other in given else name for name, other in names.items()}
    channels = {name: given[own] for name, own in names.items() if own in given}
    for name in wanted:
        if name not in channels:
            raise DataError(
                "the model wants a reference for it, and the file has no such column",
                file=path,
                channel=name,
                remedy=f"name a column {name}_{units[name]}",
            )
    own = {name: units[name] for name in channels if name in units}
    return Recording(channels, given.sample_time, own).with_meta(name=given.name)


def thinned(times: Array, values: Array, most: int = 400) -> Points:
    """Return a curve as few points, which still touch its ends."""
    from mckibben.report.drawing import over_time

    x, y = over_time(np.asarray(times, float), np.asarray(values, float), most)
    return [(float(a), float(b)) for a, b in zip(x, y, strict=True) if np.isfinite(b)]
