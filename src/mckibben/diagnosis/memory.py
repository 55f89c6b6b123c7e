"""Dead zones after reversals, creep in holds, and loop width by speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.loops import Loop
from mckibben.diagnosis.tracks import Range, Scale, Track
from mckibben.recording import Recording
from mckibben.signals.holds import STILL, holds, shortest_hold

MOVED = 0.02
"""Output change, relative to its range, above which the output has moved."""

DENSE = 8
"""Smallest number of samples of an interpolated branch."""

SETTLED = 0.1
"""Share of a hold that is discarded at its start, so that lag does not count as creep."""

ALIKE, SPEED_RATIO = 0.05, 1.5
"""Cycles are compared if their extremes differ by at most this share of the amplitude, and their
speeds by at least this ratio.
"""


def dead_zones(tracks: Sequence[Track], scale: Scale) -> tuple[list[float], list[float]]:
    """Return the dead zones after upper and after lower reversals [input unit].

    The change of the input from a reversal until the output moves back, extrapolated linearly from the
    changes at which it has moved by one and by two thresholds. The threshold is 2 % of the output
    range, six times the noise, or two steps of the sensor, whichever is largest. For a play operator of
    radius r, 2 r.
    """
    upper: list[float] = []
    lower: list[float] = []
    for track in tracks:
        threshold = max(MOVED * scale.y.span, 6 * track.y_noise, 2 * scale.y.step)
        for k in range(1, track.turns.size - 1):
            u, y = (x[track.turns[k] : track.turns[k + 1] + 1] for x in (track.u, track.y))
            if u.size <= DENSE:
                continue
            way = float(np.sign(u[-1] - u[0]))
            travel, moved = way * (u - u[0]), scale.sign * way * (y - y[0])
            once, twice = (_first_reach(travel, moved, limit * threshold) for limit in (1, 2))
            if once is not None and twice is not None:
                (upper if way < 0 else lower).append(max(0.0, 2 * once - twice))
    return upper, lower


def _first_reach(wanted: Array, x: Array, limit: float) -> float | None:
    """Return ``wanted`` where ``x`` first reaches a limit, interpolated; None if it never does."""
    i = int(np.argmax(x >= limit))
    if not x[i] >= limit:
        return None
    if i == 0:
        return float(wanted[0])
    share = (limit - x[i - 1]) / (x[i] - x[i - 1])
    return float(wanted[i - 1] + share * (wanted[i] - wanted[i - 1]))


def creep(
    runs: Sequence[Recording], given: str, wanted: str, scale: Scale
) -> list[tuple[float, float]]:
    """Return the times [s] and creep [output unit] of the holds at least half as long as the longest.

    The first tenth of a hold is left out; the means over the second tenth and the last are compared,
    positive where the output went on as it was going. Holds into which the input did not move are left
    out.
    """
    span, found = scale.u.span, []
    for run in runs:
        u, y = run[given], run[wanted]
        if run.sample_time is None:
            continue
        for hold in holds(u[:, np.newaxis], [span], shortest_hold(u, span)):
            lasts = hold.stop - hold.start
            before = u[max(0, hold.start - lasts) : hold.start]
            if before.size == 0 or np.ptp(before) < 2 * STILL * span:
                continue
            came = u[hold.start] - before[np.argmax(np.abs(before - u[hold.start]))]
            part = max(1, round(SETTLED * lasts))
            early, late = (y[at : at + part].mean() for at in (hold.start + part, hold.stop - part))
            crept = scale.sign * float(np.sign(came) * (late - early))
            found.append((run.sample_time * (lasts - 2 * part), crept))
    longest = max((time for time, _ in found), default=0.0)
    return [(time, crept) for time, crept in found if time >= 0.5 * longest]


def rate_dependence(loops: Sequence[Loop]) -> tuple[float, Range, Range] | None:
    """Return the increase of loop width at twice the speed [%], its 95 % interval, and the speeds.

    By a straight line over the logarithm of the mean speed, of three or more closed cycles between like
    extremes that differ most in speed, without the first of a recording, which starts from an unknown
    memory.
    """
    from scipy.special import stdtrit

    timed = [
        (loop.cycle, np.log2(loop.cycle.rate))
        for loop in loops
        if loop.cycle.rate is not None and loop.closed and not loop.first
    ]
    # Any cycle may be the one to compare with; of very many, fifty will do.
    groups = [
        [(rate, cycle.width) for cycle, rate in timed if one.like(cycle, ALIKE)]
        for one, _ in timed[:: max(1, len(timed) // 50)]
    ]
    if not groups:
        return None
    speed, widths = np.transpose(max(groups, key=lambda group: np.ptp([rate for rate, _ in group])))
    if speed.size < 3 or np.ptp(speed) < np.log2(SPEED_RATIO):
        return None
    _, place, count = np.unique(np.round(4 * speed), return_inverse=True, return_counts=True)
    # every speed weighs the same, however many cycles have it
    found, spread = np.polyfit(speed, widths, 1, w=1 / np.sqrt(count[place]), cov=True)
    growth = float(found[0])
    half = float(np.sqrt(spread[0, 0]) * stdtrit(speed.size - 2, 0.975))
    ends = float(2 ** speed.min()), float(2 ** speed.max())
    return growth, (growth - half, growth + half), ends
