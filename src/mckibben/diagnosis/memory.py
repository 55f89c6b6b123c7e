"""Creep in holds, and loop width by speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.diagnosis.loops import Loop
from mckibben.diagnosis.tracks import Range, Scale
from mckibben.recording import Recording
from mckibben.signals.holds import STILL, holds, shortest_hold

SETTLED = 0.1
"""Share of a hold that is discarded at its start, so that lag does not count as creep."""

ALIKE, SPEED_RATIO = 0.05, 1.5
"""Cycles are compared if their extremes differ by at most this share of the amplitude, and their
speeds by at least this ratio.
"""


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
