"""Coupling: whether muscles move apart, and together, and over how much of their joint range."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from mckibben.arrays import Array
from mckibben.excitation.gap import Gap, between, lasting, listing, value
from mckibben.excitation.seen import Seen

AS_ONE = 0.95
"""Correlation of two inputs from which they move as one."""

OFF = 0.1
"""Share of its range by which an input that is off its rest stands off it."""

TOGETHER = 0.02
"""Share of the samples in which inputs must be off their rest together, to have been seen so."""

COVERED = 0.5
"""Share of the joint range from which recordings are said to cover it."""

NEAR = 0.1
"""Distance from a sample up to which the joint range is covered, over the range of every input."""

MOST = 20_000
"""Samples looked at."""

EFFECT = (
    "springs that couple (balance), coupling of sdchm and coupled-pi, rules of networks (tsfnn)"
)


def coupling(seen: Seen) -> Iterator[Gap]:
    """Give muscles that rest, that move as one, or that never move together."""
    resting = [name for name in seen.inputs if name not in seen.moving]
    if resting and len(seen.inputs) > 1:
        yield _resting(seen, resting)
    if len(seen.moving) < 2:
        return
    shares = _shares(seen)
    tied = _tied(seen, shares)
    if tied:
        yield _as_one(seen, *tied[0])
        return
    apart = _apart(seen, shares)
    if apart is not None:
        yield apart
        return
    covered = _covered(seen)
    if covered < COVERED:
        yield Gap(
            "joint range",
            f"What {listing(seen.moving)} do together is seen in {value(100 * covered)} % of their "
            "joint range.",
            _random(seen),
            EFFECT,
            0.45,
            {"covered": covered},
        )


def _shares(seen: Seen) -> Array:
    """Return inputs as shares of their ranges, thinned, shape (n, k)."""
    columns = [
        (seen.pooled(name) - seen.scales[name].low) / seen.scales[name].span for name in seen.moving
    ]
    return np.column_stack(columns)[:: max(1, columns[0].size // MOST)]


def _tied(seen: Seen, shares: Array) -> list[tuple[float, str, str]]:
    found = []
    together = np.corrcoef(shares.T)
    for one, other in combinations(range(len(seen.moving)), 2):
        if abs(together[one, other]) > AS_ONE:
            found.append((float(together[one, other]), seen.moving[one], seen.moving[other]))
    return found


def _apart(seen: Seen, shares: Array) -> Gap | None:
    """Return that inputs are never off their rest together: at all, or in pairs but never all."""
    off = np.abs(shares - _rests(shares)) > OFF
    often = {
        pair: float(off[:, list(pair)].all(axis=1).mean())
        for n in range(2, len(seen.moving) + 1)
        for pair in combinations(range(len(seen.moving)), n)
    }
    alone = [pair for pair in often if len(pair) == 2 and often[pair] < TOGETHER]
    every = tuple(range(len(seen.moving)))
    if len(alone) == len(every) * (len(every) - 1) // 2:
        names = listing(seen.moving)
        sentence = (
            f"What {names} do together cannot be told: only one of them is off its rest at a time."
        )
        severity = 0.85
    elif alone:
        names = listing([" with ".join(seen.moving[place] for place in pair) for pair in alone])
        sentence = f"What {names} does cannot be told: they are never off their rest together."
        severity = 0.7
    elif often[every] < TOGETHER:
        sentence = (
            f"What {listing(seen.moving)} do all at once cannot be told: some of them move together, "
            "but never all."
        )
        severity = 0.5
    else:
        return None
    return Gap("together", sentence, _random(seen), EFFECT, severity, {"together": often[every]})


def _rests(shares: Array) -> Array:
    """Return where inputs are most often, shape (k,)."""
    rests = []
    for column in shares.T:
        counts, edges = np.histogram(column, bins=50)
        place = int(counts.argmax())
        rests.append(0.5 * (edges[place] + edges[place + 1]))
    return np.array(rests)


def _covered(seen: Seen) -> float:
    """Return the share of the moving inputs' joint range that is near to a sample."""
    from scipy.spatial import cKDTree
    from scipy.stats.qmc import Halton

    samples = np.concatenate([recording.matrix(seen.moving) for recording in seen.recordings])
    low, span = samples.min(axis=0), np.ptp(samples, axis=0)
    known = ((samples - low) / np.where(span > 0, span, 1.0))[:: -(-len(samples) // MOST)]
    drawn = Halton(len(seen.moving), scramble=False).random(4096)
    return float(np.mean(cKDTree(known).query(drawn)[0] <= NEAR))


def _resting(seen: Seen, resting: list[str]) -> Gap:
    name = resting[0]
    level = value(float(seen.recordings[0][name].mean()), seen.unit(name))
    other = seen.moving[0] if seen.moving else None
    like = (
        f" over {between(seen.scales[other].low, seen.scales[other].high, seen.unit(other))}"
        if other
        else ""
    )
    does, rest = ("does", "it rests") if len(resting) == 1 else ("do", "they rest")
    return Gap(
        "resting",
        f"What {listing(resting)} {does} cannot be told: {rest} at {level} in every recording.",
        f"Record cycles of {listing(resting)}{like}, alone and with the others.",
        EFFECT,
        0.9,
        {"resting": len(resting)},
    )


def _as_one(seen: Seen, correlation: float, one: str, other: str) -> Gap:
    ranges = [
        f"{name} over {between(seen.scales[name].low, seen.scales[name].high, seen.unit(name))}"
        for name in (one, other)
    ]
    return Gap(
        "coupling",
        f"What {one} and {other} do apart cannot be told: they move as one (correlation "
        f"{correlation:.2f}).",
        f"Cycle {ranges[0]} while {other} rests, and {ranges[1]} while {one} rests, then both at random "
        f"({lasting(6 * _cycle(seen))}).",
        EFFECT,
        0.9,
        {"correlation": correlation},
    )


def _random(seen: Seen) -> str:
    ranges = [
        between(seen.scales[name].low, seen.scales[name].high, seen.unit(name))
        for name in seen.moving
    ]
    over = ranges[0] if len(set(ranges)) == 1 else listing(ranges)
    return (
        f"Move {listing(seen.moving)} at random and at once, each over {over} "
        f"({lasting(10 * len(seen.moving) * _cycle(seen))})."
    )


def _cycle(seen: Seen) -> float:
    """Return how long a usual cycle takes [s]; 10 s without time."""
    seconds = [
        2 * seen.scales[name].span / branch.slow
        for name in seen.moving
        for branch in seen.branches[name]
        if branch.slow
    ]
    return float(np.median(seconds)) if seconds else 10.0
