"""Runs that could be recorded next, simple enough to be said in a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mckibben.arrays import Array
from mckibben.excitation.gap import between, lasting, listing, value

SAMPLES = 1500
"""Of a run."""

SHAPE = np.array([0.0, 1.0, 0.0, 1.0, 0.0])
TURNS = np.array([0.0, 1.0, 0.1, 0.9, 0.2, 0.8, 0.3, 0.7, 0.4, 0.6, 0.5])
HOLDS = np.array([0.0, 0.3, 0.3, 1.0, 0.7, 0.7, 1.0, 0.3, 0.3, 0.0, 0.7, 0.7])
WAYS: Array = np.arange(5, dtype=np.float64)
"""Instants of `SHAPE`, in crossings of the range."""

HELD = 30.0
"""How long a hold is [s]."""


@dataclass(frozen=True)
class Proposal:
    """A run.

    Parameters
    ----------
    words : str
        What to do, without a full stop.
    inputs : array, shape (n, k)
        Driven inputs, then what schedules.
    sample_time : float or None
        [s].
    """

    words: str
    inputs: Array
    sample_time: float | None


@dataclass(frozen=True)
class Reach:
    """What may be asked of an input: its name, unit, range, and usual speed (None without time)."""

    name: str
    unit: str
    low: float
    high: float
    speed: float | None


def proposals(
    driven: Sequence[Reach], scheduling: Sequence[Reach], sample_time: float | None
) -> Iterator[Proposal]:
    """Give runs over the range of some inputs: turns, slow and fast cycles, holds, other loads.

    Inputs go one after another, the others at their lowest; in the last run at random and at once.

    Parameters
    ----------
    driven, scheduling : sequence of Reach
        Inputs, and what schedules, which stays in the middle of its range but in a run of its own.
    sample_time : float, optional
        That the model is bound to [s]; default, what gives `SAMPLES`.
    """
    names = listing([reach.name for reach in driven])
    over = listing(list(dict.fromkeys(between(r.low, r.high, r.unit) for r in driven)))
    turns = ", ".join(
        value(driven[0].low + share * (driven[0].high - driven[0].low)) for share in TURNS[1:8]
    )
    speeds = [reach.speed for reach in driven]
    middle = [0.5 * (reach.low + reach.high) for reach in scheduling]
    crossing = max(((r.high - r.low) / r.speed for r in driven if r.speed), default=None)
    in_turn = " in turn" if len(driven) > 1 else ""

    def made(words: str, shape: Array, times: Array, levels: Sequence[float]) -> Proposal:
        total = times[-1] * len(driven)
        known = None if crossing is None else (sample_time or total / SAMPLES)
        step = total / SAMPLES if known is None else known
        t = np.arange(0.0, times[-1], step)
        share = np.interp(t, times, shape)
        inputs = np.zeros((t.size * len(driven), len(driven)))
        for place in range(len(driven)):
            inputs[place * t.size : (place + 1) * t.size, place] = share
        low, span = (
            np.array(x) for x in zip(*((r.low, r.high - r.low) for r in driven), strict=True)
        )
        beside = np.tile(np.array(levels, dtype=float), (len(inputs), 1))
        lasts = "" if known is None else f" ({lasting(total)})"
        return Proposal(f"{words}{lasts}", np.hstack([low + span * inputs, beside]), known)

    cycle = crossing or 1.0
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(TURNS)))])
    yield made(
        f"Turn {names}{in_turn} at {turns} {driven[0].unit}".rstrip(), TURNS, cycle * way, middle
    )
    if crossing is not None and all(speeds):
        unit = driven[0].unit
        for factor in (0.2, 5.0):
            speed = value(float(f"{factor * float(speeds[0] or 0.0):.0e}"), f"{unit}/s")
            words = f"Cycle {names}{in_turn} twice over {over} at {speed}"
            yield made(words, SHAPE, cycle / factor * WAYS, middle)
        times, at = [0.0], 0.0
        for one, other in pairwise(HOLDS):
            at += HELD if one == other else max(0.02 * HELD, 0.2 * cycle * abs(other - one))
            times.append(at)
        levels = [
            value(driven[0].low + share * (driven[0].high - driven[0].low), unit)
            for share in (0.3, 0.7)
        ]
        words = f"Hold {names}{in_turn} at {listing(levels)}, from below and from above"
        yield made(f"{words}, for {HELD:g} s each", HOLDS, np.array(times), middle)
    for place, reach in enumerate(scheduling):
        for level in (
            (reach.low, reach.high)
            if reach.high > reach.low
            else (0.5 * reach.low, 1.5 * reach.low)
        ):
            moved = [*middle]
            moved[place] = level
            words = f"Turn {names}{in_turn} at {turns} {driven[0].unit} with {reach.name} at "
            yield made(f"{words}{value(level, reach.unit)}", TURNS, cycle * way, moved)
    if len(driven) > 1:
        yield _random(driven, names, over, middle, 10 * cycle, crossing is not None, sample_time)


def _random(
    driven: Sequence[Reach],
    names: str,
    over: str,
    middle: Sequence[float],
    seconds: float,
    timed: bool,
    sample_time: float | None,
) -> Proposal:
    rng = np.random.default_rng(0)
    step = sample_time or seconds / SAMPLES
    t = np.arange(0.0, seconds, step)
    knots = np.linspace(0.0, seconds, 25)
    columns = [
        r.low + (r.high - r.low) * np.interp(t, knots, rng.uniform(size=knots.size)) for r in driven
    ]
    beside = np.tile(np.array(middle, dtype=float), (t.size, 1))
    words = f"Move {names} at random and at once, each over {over}"
    lasts = f" ({lasting(seconds)})" if timed else ""
    return Proposal(
        f"{words}{lasts}", np.hstack([np.column_stack(columns), beside]), step if timed else None
    )
