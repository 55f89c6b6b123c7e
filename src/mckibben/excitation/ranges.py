"""Range: what tests reach and recordings do not, what is clipped, and how recordings begin."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.free_run import PERIODIC
from mckibben.excitation.gap import Gap, between, counted, listing, value
from mckibben.excitation.seen import Seen

BEYOND = 0.05
"""Share of the range by which a test must go beyond it."""

CLIPPED = 10
"""Samples in a row at exactly the largest value, of a channel with noise, from which it is clipped."""

MOST = 100_000
"""Samples in which the least step of a sensor is looked for."""

UNKNOWN_START = 0.25
"""Share of the samples before the input first comes to an end of its range, at which memory is known."""


def ranges(seen: Seen) -> Iterator[Gap]:
    """Give inputs that go further elsewhere, that are clipped, or that begin anywhere."""
    for name in seen.moving:
        yield from _beyond(seen, name)
    channels = (*seen.moving, *(name for name in seen.outputs if seen.scales[name].moves))
    for name in dict.fromkeys(channels):
        yield from _clipped(seen, name)
    yield from _start(seen)


def _beyond(seen: Seen, name: str) -> Iterator[Gap]:
    scale, unit = seen.scales[name], seen.unit(name)
    tests = [recording[name] for recording in seen.tests if name in recording]
    if not tests:
        return
    low, high = min(float(u.min()) for u in tests), max(float(u.max()) for u in tests)
    over, under = high - scale.high, scale.low - low
    if max(over, under) <= BEYOND * scale.span:
        return
    ends = [value(low, unit)] if under > BEYOND * scale.span else []
    ends += [value(high, unit)] if over > BEYOND * scale.span else []
    yield Gap(
        "range",
        f"What the muscle does at {listing(ends)} cannot be told: {name} stays within "
        f"{between(scale.low, scale.high, unit)}, and the test goes beyond.",
        f"Record cycles of {name} over {between(min(low, scale.low), max(high, scale.high), unit)}.",
        "every model: none is known beyond what it was fitted to",
        0.85,
        {"low": low, "high": high, "lowest": scale.low, "highest": scale.high},
        (name,),
    )


def _clipped(seen: Seen, name: str) -> Iterator[Gap]:
    """Give that a channel whose noise always shows is without any at an end of its range."""
    values = seen.pooled(name)
    steps = np.abs(np.diff(values[:MOST]))
    noise = seen.scales[name].noise
    if noise == 0 or noise < steps[steps > 0].min(initial=np.inf):
        return
    for end, word in ((float(values.max()), "above"), (float(values.min()), "below")):
        longest = max(_longest(r[name] == end) for r in seen.recordings)
        if longest >= CLIPPED:
            yield Gap(
                "clipped",
                f"What happens {word} {value(end, seen.unit(name))} cannot be told: {name} is "
                f"stuck there for up to {counted(longest, 'sample')}, without noise, as at a limit.",
                f"Record with a sensor of a wider range, or keep {name} "
                f"{'below' if word == 'above' else 'above'} that.",
                "every model near that end: the time spent there pulls gains and thresholds",
                0.6,
                {"at": end, "samples": longest},
                (name,),
            )


def _longest(stuck: Array) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], stuck.astype(np.int8), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _start(seen: Seen) -> Iterator[Gap]:
    """Give that most samples follow a start whose memory is not known."""
    if len(seen.moving) != 1:
        return
    (name,) = seen.moving
    scale = seen.scales[name]
    unknown = []
    for recording in seen.recordings:
        if recording.meta.get(PERIODIC):
            continue
        share = (recording[name] - scale.low) / scale.span
        known = np.flatnonzero((share < BEYOND) | (share > 1 - BEYOND))
        unknown.append(int(known[0]) if known.size else share.size)
    total = sum(len(recording) for recording in seen.recordings)
    if sum(unknown) <= UNKNOWN_START * total:
        return
    first = value(float(seen.recordings[0][name][0]), seen.unit(name))
    yield Gap(
        "start",
        f"How the memory began cannot be told for {value(100 * sum(unknown) / total)} % of the samples: "
        f"{name} begins inside its range (at {first}) and only then comes to an end of it.",
        f"Begin every recording with a cycle over {between(scale.low, scale.high, seen.unit(name))}.",
        "memory at the start (all models with hysteresis), and small thresholds through it",
        0.3,
        {"share": sum(unknown) / total},
        (name,),
    )
