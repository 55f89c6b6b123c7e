"""Memory and time: dead zones, minor loops, creep in holds, dependence of the loop width on speed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.loops import Loop, alike
from mckibben.diagnosis.tracks import Range, Scale, Track
from mckibben.signals.holds import STILL

MOVED = 0.02
"""Output change, as a share of its range, from which the output is taken to have moved."""

SAME = 0.01
"""Share of the input range beyond which a level is passed."""

HUNTED = 0.05
"""Share of the input range over which a regulator hunts: what turns back by less is no minor loop."""

DENSE = 8
"""Samples that a branch must have for the output on it to be read between samples."""

SETTLED = 0.1
"""Share of a hold that is left out at its start, so that the lag of a jump is not taken for creep."""

ALIKE = 0.05
"""Share of the amplitude by which the extremes of two cycles may differ for these to be compared."""

SPEED_RATIO = 1.5
"""Ratio of speeds from which on dependence on rate is judged."""


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
        threshold = max(MOVED * scale.y_span, 6 * track.y_noise, 2 * scale.y_step)
        turns, heights = track.turns, track.heights
        for k in range(1, turns.size - 1):
            if turns[k + 1] - turns[k] < DENSE:
                continue
            way = np.sign(heights[k + 1] - heights[k])
            piece = slice(turns[k], turns[k + 1] + 1)
            travel = way * (track.u[piece] - heights[k])
            moved = scale.sign * way * (track.y[piece] - track.y[turns[k]])
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
        heights, turns = track.heights, track.turns
        for departure, back in minor_loops(heights, SAME * scale.u_span):
            if abs(heights[back] - heights[departure]) < HUNTED * scale.u_span:
                continue
            returned = _output_at(track, back, float(heights[departure]))
            if returned is not None:
                found.append(100 * abs(returned - float(track.y[turns[departure]])) / scale.y_span)
    return found


def _output_at(track: Track, branch: int, level: float) -> float | None:
    """Return the output where a branch first reaches an input level, or None if it is too coarse."""
    start, stop = int(track.turns[branch]), int(track.turns[branch + 1]) + 1
    if stop - start < DENSE:
        return None
    u = track.u[start:stop]
    way = 1.0 if u[-1] > u[0] else -1.0
    return _first_reach(track.y[start:stop], way * u, way * level)


def _first_reach(wanted: Array, x: Array, limit: float) -> float | None:
    """Return ``wanted`` where ``x`` first reaches a limit, between samples; None if it never does."""
    i = int(np.argmax(x >= limit))
    if not x[i] >= limit:
        return None
    if i == 0:
        return float(wanted[0])
    share = (limit - x[i - 1]) / (x[i] - x[i - 1])
    return float(wanted[i - 1] + share * (wanted[i] - wanted[i - 1]))


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


Growth = tuple[float, Range, Range]
"""How much wider the loop is at twice the speed [%], its 95 % interval, and between which speeds."""


def rate_dependence(loops: Sequence[Loop]) -> Growth | None:
    """Return how the loop width depends on the logarithm of the mean speed, by a straight line.

    Of three or more closed cycles between like extremes that differ most in speed; the first of a
    recording, which starts from an unknown memory, apart.
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
        return None
    speed, widths = rates[widest], np.array([cycle.width for cycle in groups[widest]])
    growth, offset = (float(x) for x in np.polyfit(speed, widths, 1))
    left, freedom = widths - (offset + growth * speed), speed.size - 2
    error = float(np.sqrt(left @ left / freedom / np.sum((speed - speed.mean()) ** 2)))
    half = error * float(stdtrit(freedom, 0.975))
    ends = float(2 ** speed.min()), float(2 ** speed.max())
    return growth, (growth - half, growth + half), ends
