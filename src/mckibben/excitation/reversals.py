"""Memory: whether inputs turn back at all, inside their range, and on both sides of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mckibben.excitation.gap import Gap, between, counted, lasting, value
from mckibben.excitation.seen import Seen

END = 0.1
"""Turning points this close to an end of the range, as a share of it, are at the end."""

FEWEST = 3
"""Turning points inside the range, on a side, from which minor loops are seen."""

NONE = "all of hysteresis: thresholds, weights, friction"
MINOR = (
    "how thresholds and weights are spread (pi, gpi, preisach), where friction breaks away (balance, "
    "multistate), and errors in minor loops"
)
SIDE = (
    "models whose rising and falling branches differ (gpi, eupi, preisach, gbw); those whose branches "
    "mirror each other know one from the other"
)


def reversals(seen: Seen) -> Iterator[Gap]:
    """Give inputs that never turn, or only at the ends of their range."""
    swinging = [name for name in seen.moving if seen.branches[name]]
    # an input that is held in every recording, at levels of its own, is not one that should turn
    for name in swinging or seen.moving:
        upper, lower = seen.turns[name]
        if upper.size + lower.size == 0:
            yield _never(seen, name)
            continue
        inner = [int(((turns > END) & (turns < 1 - END)).sum()) for turns in (upper, lower)]
        if max(inner) < FEWEST:
            yield _ends(seen, name, sum(inner))
        elif min(inner) < FEWEST:
            yield _side(seen, name, inner[0] < FEWEST)


def _never(seen: Seen, name: str) -> Gap:
    scale, unit = seen.scales[name], seen.unit(name)
    return Gap(
        "hysteresis",
        f"Hysteresis over {name} cannot be told: no recording turns it back by a tenth of its range.",
        f"Record three cycles of {name} over {between(scale.low, scale.high, unit)}"
        f"{_time(seen, name, 6)}.",
        NONE,
        0.6 if any(turns[0].size for turns in seen.turns.values()) else 0.95,
        {"reversals": 0},
        (name,),
    )


def _ends(seen: Seen, name: str, inner: int) -> Gap:
    upper, lower = seen.turns[name]
    n = upper.size + lower.size
    where = (
        "all are at the ends of its range"
        if inner == 0
        else f"{inner} of them {'is' if inner == 1 else 'are'} inside its range"
    )
    told = "cannot be told" if inner == 0 else "are too few to tell"
    return Gap(
        "minor loops",
        f"Minor loops {told}: {name} has {counted(n, 'turning point')}, and {where}.",
        _decaying(seen, name),
        MINOR,
        0.75 if inner == 0 else 0.55,
        {"reversals": n, "inside": inner},
        (name,),
    )


def _side(seen: Seen, name: str, above: bool) -> Gap:
    scale, unit = seen.scales[name], seen.unit(name)
    side, way = ("upper", "Falls") if above else ("lower", "Rises")
    turns = seen.turns[name][0 if above else 1]
    inside = int(((turns > END) & (turns < 1 - END)).sum())
    if inside:
        where = f"only {inside} of its {side} turning points {'is' if inside == 1 else 'are'} there"
    elif turns.size:
        low, high = (scale.low + float(turn) * scale.span for turn in (turns.min(), turns.max()))
        where = f"its {side} turning points are at {between(low, high, unit)}"
    else:
        where = f"it has no {side} turning point"
    return Gap(
        "one-sided loops",
        f"{way} that begin inside the range of {name} cannot be told: {where}.",
        _decaying(seen, name),
        SIDE,
        0.35,
        {"reversals": turns.size, "inside": inside},
        (name,),
    )


def _decaying(seen: Seen, name: str) -> str:
    scale, unit = seen.scales[name], seen.unit(name)
    steps = [value(scale.low + share * scale.span) for share in (0.9, 0.1, 0.8, 0.2, 0.7, 0.3, 0.6)]
    return f"Turn {name} at {', '.join(steps)} {unit}".rstrip() + f"{_time(seen, name, 5)}."


def _time(seen: Seen, name: str, ways: int) -> str:
    """Return how long so many ways over the range take at the usual speed, in brackets."""
    slow = [branch.slow for branch in seen.branches[name] if branch.slow]
    if not slow:
        return ""
    return f" ({lasting(ways * seen.scales[name].span / float(np.median(slow)))})"
