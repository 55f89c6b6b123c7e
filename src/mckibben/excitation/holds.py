"""Creep: whether inputs are held, and for how long compared with how slow creep can be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mckibben.excitation.gap import Gap, lasting, value
from mckibben.excitation.seen import Hold, Seen

SLOW = 100.0
"""Rubber and braid creep over seconds to minutes: creep up to this time constant should be told [s]."""

SLOWEST = 600.0
"""The same where creep is seen to go on [s]."""

PER_HOLD = 5.0
"""Time constant of creep that a hold tells, per length of the hold: its beginning is seen."""

PER_RUN = 0.5
"""The same per length of a run without holds, in which creep shows as cycles that drift."""

MOVES_ON = 0.005
"""Share of its range by which an output that still moves does so in the second half of a hold."""

SETTLED = 3.0
"""Lags of valves and air are over by then: what still moves later creeps [s]."""

CLEAR = 4.0
"""Standard errors of a mean that movement stands out by."""

EFFECT = "slow lags and what relaxes (cpi, balance), and where the output is after a rest"


def holds(seen: Seen) -> Iterator[Gap]:
    """Give that creep may be slower than runs without holds, or holds, tell."""
    if not seen.timed or not seen.moving:
        return
    held = max((hold.seconds for hold in seen.holds), default=0.0)
    told = max(PER_RUN * seen.duration, PER_HOLD * held)
    long = [hold for hold in seen.holds if hold.seconds >= max(SETTLED, 0.5 * held)]
    moved, lasted, name = max(
        (
            (_left(seen, hold, output), hold.seconds, output)
            for hold in long
            for output in seen.outputs
        ),
        default=(0.0, 0.0, ""),
    )
    if told >= (SLOWEST if moved > 0 else SLOW):
        return
    if PER_HOLD * held <= PER_RUN * seen.duration:
        kept = "no hold is longer than " + value(held, "s") if held else "no input is ever held"
        why = f"{kept}, and no recording is longer than {value(seen.duration, 's')}"
    else:
        why = f"no hold is longer than {value(held, 's')}"
    if moved > 0:
        way = value(moved * seen.scales[name].span, seen.unit(name))
        why = f"in the second half of a hold of {value(lasted, 's')} {name} still moves {way}"
    yield Gap(
        "creep",
        f"Creep slower than about {lasting(told)} cannot be told: {why}.",
        _remedy(seen, 60.0 if moved > 0 else 30.0),
        EFFECT,
        0.6 if moved > 0 else 0.55,
        {"hold": held, "duration": seen.duration, "told": told, "moved": moved},
    )


def _remedy(seen: Seen, wait: float) -> str:
    name = seen.moving[0]
    scale, unit = seen.scales[name], seen.unit(name)
    levels = [value(scale.low + share * scale.span, unit) for share in (0.3, 0.7)]
    return (
        f"Hold {name} at {levels[0]} and at {levels[1]}, come to from below and from above, for "
        f"{lasting(wait)} each ({lasting(4 * (wait + 5))})."
    )


def _left(seen: Seen, hold: Hold, name: str) -> float:
    """Return the share of its range that an output moves in the second half of a hold; 0 for none."""
    y = seen.recordings[hold.recording][name][hold.start : hold.stop]
    scale = seen.scales[name]
    if not scale.moves:
        return 0.0
    part = max(1, y.size // 10)
    middle, end = y[y.size // 2 : y.size // 2 + part], y[-part:]
    moved = abs(float(end.mean() - middle.mean()))
    threshold = max(MOVES_ON * scale.span, CLEAR * float(np.sqrt(2 / part)) * scale.noise)
    return moved / scale.span if moved > threshold else 0.0
