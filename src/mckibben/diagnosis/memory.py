"""Memory and rate: dead zones, minor loops, creep in holds, loop width by speed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.loops import Loop
from mckibben.diagnosis.tracks import Range, Scale, Track
from mckibben.recording import Recording
from mckibben.signals.holds import STILL, holds, shortest_hold

MOVED = 0.02
"""Output change, relative to its range, above which the output has moved."""

SAME, HUNTED, MINOR = 0.01, 0.05, 0.9
"""Shares of the input range: hysteresis of a level crossing; amplitude of a regulator's hunting;
largest minor loop.
"""

DENSE, SETTLED = 8, 0.1
"""Smallest number of samples of an interpolated branch; share of a hold that is discarded at its
start, so that lag does not count as creep.
"""

ALIKE, SPEED_RATIO = 0.05, 1.5
"""Cycles are compared if their extremes differ by at most this share of the amplitude, and their
speeds by at least this ratio.
"""


def dead_zones(tracks: Sequence[Track], scale: Scale) -> tuple[list[float], list[float]]:
    """Return the dead zones after upper and after lower reversals [input unit].

    The input's way from the reversal to where the output begins to move back: a line through where it
    has moved by a threshold, and by twice that, is taken back to no movement. The threshold is 2 % of
    the output range, six times the noise or two steps of the sensor, whichever is most. For a play
    operator of radius r, 2 r.
    """
    upper: list[float] = []
    lower: list[float] = []
    for track in tracks:
        threshold = max(MOVED * scale.y.span, 6 * track.y_noise, 2 * scale.y.step)
        for k in range(1, track.turns.size - 1):
            part, way = _branch(track, k)
            u, y = track.u[part], track.y[part]
            if u.size <= DENSE:
                continue
            travel, moved = way * (u - u[0]), scale.sign * way * (y - y[0])
            once, twice = (_first_reach(travel, moved, limit * threshold) for limit in (1, 2))
            if once is not None and twice is not None:
                (upper if way < 0 else lower).append(max(0.0, 2 * once - twice))
    return upper, lower


def minor_loops(heights: Array, tolerance: float) -> Iterator[tuple[int, int]]:
    """Yield the minor loops between turning points at such heights, inner ones before outer ones.

    Of each the numbers of the turning point where the input went away from a level, and of the one from
    which it came back to it: it went beyond by more than a tolerance.
    """
    open_turns: list[int] = [0]
    for k in range(1, heights.size):
        way = np.sign(heights[k] - heights[k - 1])
        while len(open_turns) >= 2 and way * (heights[k] - heights[open_turns[-2]]) > tolerance:
            if len(open_turns) >= 3:
                yield open_turns[-2], k - 1
                del open_turns[-2:]
            else:
                del open_turns[0]
        open_turns.append(k)


def minor_loop_errors(tracks: Sequence[Track], scale: Scale) -> list[float]:
    """Return the closure errors of minor loops [% of the output range].

    The output where the input is back at the level of departure, against the output at departure, of
    loops of at least 5 % of the input range with eight samples a branch. Zero for every model of
    Preisach type.
    """
    found = []
    for track in tracks:
        heights = track.u[track.turns]
        for departure, back in minor_loops(heights, SAME * scale.u.span):
            part, way = _branch(track, back)
            u, y, level = track.u[part], track.y[part], heights[departure]
            size = abs(u[0] - level) / scale.u.span
            if not HUNTED <= size <= MINOR or u.size < DENSE:
                continue
            returned = _first_reach(y, way * u, way * level)
            if returned is not None:
                missed = abs(returned - float(track.y[track.turns[departure]]))
                found.append(100 * missed / scale.y.span)
    return found


def _branch(track: Track, k: int) -> tuple[slice, float]:
    """Return the samples from a turning point to the next, and the direction."""
    start, stop = track.turns[k : k + 2]
    return slice(start, stop + 1), float(np.sign(track.u[stop] - track.u[start]))


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
