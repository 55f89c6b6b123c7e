"""Creep: whether inputs are held, and long enough for outputs to come to rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mckibben.excitation.gap import Gap, lasting, value
from mckibben.excitation.seen import Hold, Seen

SLOW = 10.0
"""Rubber and braid creep over seconds to minutes; of that, holds shorter than this show little [s]."""

MOVES_ON = 0.005
"""Share of its range by which an output that still moves does so in the second half of a hold."""

CLEAR = 4.0
"""Standard errors of a mean that movement stands out by."""

LONGER = 5.0
"""Times a hold in which the output still moves that would tell."""

EFFECT = "slow lags and what relaxes (cpi, balance), and where the output is after a rest"


def holds(seen: Seen) -> Iterator[Gap]:
    """Give that holds are absent, too short, or end before outputs rest."""
    if not seen.timed or not seen.moving:
        return
    longest = max(seen.holds, key=lambda hold: hold.seconds, default=None)
    if longest is None or longest.seconds < SLOW:
        yield _short(seen, longest)
        return
    moving = [(_left(seen, longest, name), name) for name in seen.outputs]
    share, name = max(moving)
    if share > 0:
        unit, half = seen.unit(name), longest.seconds / 2
        moved = value(share * seen.scales[name].span, unit)
        wanted = lasting(LONGER * longest.seconds)
        yield Gap(
            "creep",
            f"Creep slower than {value(longest.seconds, 's')} cannot be told: in the longest "
            f"hold {name} still moves {moved} over the last {value(half, 's')}.",
            f"Hold at two levels, come to from below and from above, for {wanted} each.",
            EFFECT,
            0.6,
            {"hold": longest.seconds, "moved": share * seen.scales[name].span, "share": share},
        )


def _short(seen: Seen, longest: Hold | None) -> Gap:
    seconds = 0.0 if longest is None else longest.seconds
    kept = (
        "no input is ever held"
        if longest is None
        else f"no hold is longer than {value(seconds, 's')}"
    )
    name = seen.moving[0]
    scale, unit = seen.scales[name], seen.unit(name)
    levels = [value(scale.low + share * scale.span, unit) for share in (0.3, 0.7)]
    wait = 30.0
    return Gap(
        "creep",
        f"Creep cannot be told apart from rate dependence and drift: {kept}.",
        f"Hold {name} at {levels[0]} and at {levels[1]}, come to from below and from above, for "
        f"{lasting(wait)} each ({lasting(4 * (wait + 5))}).",
        EFFECT,
        0.7,
        {"hold": seconds, "duration": seen.duration},
    )


def _left(seen: Seen, hold: Hold, name: str) -> float:
    """Return the share of its range that an output moves in the second half of a hold; 0 for none."""
    y = seen.recordings[hold.recording][name][hold.start : hold.stop]
    if seen.scales[name].span == 0:
        return 0.0
    part = max(1, y.size // 10)
    middle, end = y[y.size // 2 : y.size // 2 + part], y[-part:]
    moved = abs(float(end.mean() - middle.mean()))
    doubt = float(np.sqrt(2 / part)) * seen.scales[name].noise
    threshold = max(MOVES_ON * seen.scales[name].span, CLEAR * doubt)
    return moved / seen.scales[name].span if moved > threshold else 0.0
