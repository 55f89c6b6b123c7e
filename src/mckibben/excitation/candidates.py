"""Stretches of motion to choose from: holds, loops, steps, pulls apart and random motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.excitation.limits import Limits, at_rates

WAVES = 8
"""Sines in a stretch of random motion."""

FASTEST = 0.25
"""Highest frequency of random motion, were rates no limit [Hz]."""

SPEEDS = (1.0, 0.3, 0.1)
"""Shares of the highest rate that stretches go at."""


@dataclass(frozen=True)
class Stretch:
    """What commands go for, over a stretch of time.

    Parameters
    ----------
    what : str
        In words.
    targets : array, shape (n, channels)
    speed : float
        Share of the highest rate that they are gone for at.
    """

    what: str
    targets: Array
    speed: float = 1.0


Program = Callable[[float, float, float, int, float, np.random.Generator], Array]


def _level(low: float, high: float, rng: np.random.Generator) -> float:
    """Return a level; the ends, where much is known only from there, are as likely as all between."""
    return float(
        np.clip(rng.uniform(low - 0.25 * (high - low), high + 0.25 * (high - low)), low, high)
    )


def _held(
    here: float, low: float, high: float, n: int, step: float, rng: np.random.Generator
) -> Array:
    del here, step
    return np.full(n, _level(low, high, rng))


def _looped(
    here: float, low: float, high: float, n: int, step: float, rng: np.random.Generator
) -> Array:
    """Go to and fro between two levels, of which the first is here, so many times."""
    del step
    other, turns = _level(low, high, rng), int(rng.integers(1, 4))
    back = here if rng.random() < 0.5 else _level(low, high, rng)
    phase = np.arange(n) / n * 2 * turns
    saw = np.abs((phase + 1.0) % 2.0 - 1.0)
    begin = np.where(phase < 1.0, here, back)
    return np.asarray(begin + (other - begin) * (1.0 - np.abs(1.0 - saw)))


def _stepped(
    here: float, low: float, high: float, n: int, step: float, rng: np.random.Generator
) -> Array:
    del here, step
    count = int(rng.integers(2, 5))
    levels = np.array([_level(low, high, rng) for _ in range(count)])
    return np.asarray(levels[np.arange(n) * count // n])


def _random(
    here: float, low: float, high: float, n: int, step: float, rng: np.random.Generator
) -> Array:
    del here
    return random_motion(n, step, low, high, FASTEST * rng.choice([0.3, 1.0, 2.0]), rng)


PROGRAMS: dict[str, Program] = {
    "hold": _held,
    "loops": _looped,
    "steps": _stepped,
    "random motion": _random,
}


def random_motion(
    n: int, step: float, low: float, high: float, fastest: float, rng: np.random.Generator
) -> Array:
    """Return a sum of sines of random phases that now and then reaches its ends, shape (n,)."""
    time = step * np.arange(n)[:, np.newaxis]
    frequencies = rng.uniform(0.02 * fastest, fastest, WAVES)
    waves = np.cos(2 * np.pi * (frequencies * time + rng.random(WAVES))).sum(axis=1)
    # the sum is about Gaussian, of deviation 2; at 0.3 of it the ends are reached every so often
    share = np.clip(0.5 + 0.3 * waves / np.sqrt(WAVES / 2), 0.0, 1.0)
    return np.asarray(low + (high - low) * share)


def stretches(
    here: Array, limits: Limits, n: int, step: float, count: int, rng: np.random.Generator
) -> list[Stretch]:
    """Return so many stretches of n samples to choose from, from where commands are."""
    low, high, _, _ = at_rates(limits)
    names = [name for name, limit in limits.items() if limit.span > 0]
    places = list(limits)
    found = []
    for number in range(count):
        kind = list(PROGRAMS)[number % len(PROGRAMS)]
        speed = float(rng.choice(SPEEDS, p=(0.4, 0.4, 0.2))) if kind != "random motion" else 1.0
        way = rng.random()
        alone = rng.choice(names) if len(names) > 1 and way < 0.35 else None
        targets = np.tile(here, (n, 1))
        for name in names:
            place = places.index(name)
            if alone is not None and name != alone:
                if way < 0.15:  # the others at some level, not where they happen to be
                    targets[:, place] = _level(low[place], high[place], rng)
                continue
            program = PROGRAMS[kind] if way < 0.7 else PROGRAMS[rng.choice(list(PROGRAMS))]
            targets[:, place] = program(here[place], low[place], high[place], n, step, rng)
        moved = alone if alone is not None else "all" if len(names) > 1 else names[0]
        mixed = alone is None and len(names) > 1 and way >= 0.7
        found.append(Stretch(f"{'mixed motion' if mixed else kind} of {moved}", targets, speed))
    return found


def random_plan(
    limits: Limits, n: int, length: int, step: float, rng: np.random.Generator
) -> list[Stretch]:
    """Return random motion of all channels over n stretches, as one would record without a plan."""
    low, high, rate, _ = at_rates(limits)
    columns = []
    for place in range(low.size):
        span = max(high[place] - low[place], 1e-12)
        fastest = min(FASTEST, rate[place] / (np.pi * span))
        columns.append(random_motion(n * length, step, low[place], high[place], fastest, rng))
    whole = np.column_stack(columns)
    return [Stretch("random motion of all", part) for part in np.split(whole, n)]
