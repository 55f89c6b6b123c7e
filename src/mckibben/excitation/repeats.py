"""Repeats: whether anything is recorded twice, and whether anything is left to test on."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from mckibben.excitation.gap import Gap, lasting
from mckibben.excitation.seen import Branch, Seen

ALIKE = 0.05
"""Share of the range within which branches begin and end at the same levels."""

SPEED = 1.3
"""Times as fast that a repeated branch may be."""


def repeats(seen: Seen) -> Iterator[Gap]:
    """Give that nothing is repeated, and that there is no run to test on."""
    if seen.moving and not any(_repeats(seen, name) for name in seen.moving):
        yield Gap(
            "repeats",
            "Noise, drift and what a model lacks cannot be told apart: no cycle comes twice.",
            "Record one of the runs a second time"
            + (f" ({lasting(seen.duration)})." if seen.timed else "."),
            "what error is the best that any model can have",
            0.2,
        )
    if len(seen.recordings) == 1 and not seen.tests:
        yield Gap(
            "test",
            "How a model does on another run cannot be told: there is one recording, of which a part "
            "must be held out.",
            "Record a second run, with other turning points"
            + (f" ({lasting(0.5 * seen.duration)})." if seen.timed else "."),
            "errors on new data, and which model is chosen",
            0.15,
        )


def _repeats(seen: Seen, name: str) -> bool:
    """Tell whether two branches in a row come again."""
    from scipy.spatial import cKDTree

    reach = ALIKE * seen.scales[name].span
    pairs = [
        _signature(one, other, reach, seen.timed)
        for one, other in pairwise(seen.branches[name])
        if abs(one.end - other.start) <= reach
    ]
    if len(pairs) < 2:
        return False
    known = np.array(pairs)
    return bool(cKDTree(known).count_neighbors(cKDTree(known), 1.0, p=np.inf) > len(known))


def _signature(one: Branch, other: Branch, reach: float, timed: bool) -> list[float]:
    """Return levels and speeds, as multiples of what they may differ by."""
    speeds = [branch.slow for branch in (one, other) if timed and branch.slow is not None]
    levels = [level / reach for level in (one.start, one.end, other.end)]
    return levels + [float(np.log(speed) / np.log(SPEED)) for speed in speeds]
