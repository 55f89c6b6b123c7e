"""What depends on time: creep in holds, and dependence of the loop width on speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.loops import Loop, alike
from mckibben.diagnosis.tracks import Range
from mckibben.signals.holds import STILL

SETTLED = 0.1
"""Share of a hold that is left out at its start, so that the lag of a jump is not taken for creep."""

ALIKE = 0.05
"""Share of the amplitude by which the extremes of two cycles may differ for these to be compared."""

SPEED_RATIO = 1.5
"""Ratio of speeds from which on dependence on rate is judged."""

WEAK, STRONG = 0.05, 0.2
"""Change of the loop width at twice the speed, relative to its mean: from here weak, strong."""

LEAST = 1.0
"""Loop width that changes are compared with where there is hardly a loop [% of output range]."""


def creep(u: Array, y: Array, held: Sequence[slice], span: float) -> list[tuple[int, float]]:
    """Return for how many samples the output creeps in each hold, and how far the way of the input.

    The first tenth of a hold is left out; the means over the second tenth and the last are compared.
    Holds into which the input did not move are left out.
    """
    found = []
    for hold in held:
        lasts = hold.stop - hold.start
        before = u[max(0, hold.start - lasts) : hold.start]
        if before.size == 0 or np.ptp(before) < 2 * STILL * span:
            continue
        way = np.sign(u[hold.start] - before[np.argmax(np.abs(before - u[hold.start]))])
        part = max(1, round(SETTLED * lasts))
        early, late = (y[at : at + part].mean() for at in (hold.start + part, hold.stop - part))
        found.append((lasts - 2 * part, float(way * (late - early))))
    return found


@dataclass(frozen=True)
class RateDependence:
    """How much wider the loop is at twice the speed [% of output range], between which speeds.

    ``verdict`` is "none", "weak" or "strong" as that is less than 5 %, less than 20 % or more of the
    mean width, with its whole 95 % interval on one side; else "unknown".
    """

    growth: float | None = None
    limits: Range | None = None
    verdict: str = "unknown"
    speeds: Range | None = None


def rate_dependence(loops: Sequence[Loop]) -> RateDependence:
    """Return how the loop width depends on the logarithm of the mean speed, by a straight line.

    Of the closed cycles between like extremes that differ most in speed; the first of a recording, which
    starts from an unknown memory, apart.
    """
    from scipy.special import stdtrit

    timed = [
        loop.cycle
        for loop in loops
        if loop.cycle.rate is not None and loop.closed and not loop.first
    ]
    # Any cycle may be the one to compare with; of very many, fifty will do.
    wanted = timed[:: max(1, len(timed) // 50)]
    groups = [[cycle for cycle in timed if alike(one, cycle, ALIKE)] for one in wanted]
    rates = [np.log2([cycle.rate or 0.0 for cycle in group]) for group in groups]
    widest = int(np.argmax([np.ptp(rate) for rate in rates])) if rates else 0
    if not rates or rates[widest].size < 3 or np.ptp(rates[widest]) < np.log2(SPEED_RATIO):
        return RateDependence()
    speed, widths = rates[widest], np.array([cycle.width for cycle in groups[widest]])
    growth, offset = np.polyfit(speed, widths, 1)
    left, freedom = widths - (offset + growth * speed), speed.size - 2
    half = np.sqrt(left @ left / freedom / np.sum((speed - speed.mean()) ** 2))
    half *= stdtrit(freedom, 0.975)
    mean = max(float(widths.mean()), LEAST)
    least, most = max(abs(growth) - half, 0.0) / mean, (abs(growth) + half) / mean
    verdict = "unknown"
    if most < WEAK:
        verdict = "none"
    elif least > 0:
        verdict = "weak" if abs(growth) / mean < STRONG else "strong"
    ends = float(2 ** speed.min()), float(2 ** speed.max())
    return RateDependence(
        float(growth), (float(growth - half), float(growth + half)), verdict, ends
    )
