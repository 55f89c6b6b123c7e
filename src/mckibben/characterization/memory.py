"""Memory: what the output does after a reversal, and after a minor loop."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.characterization.tracks import Scale, Track

MOVED = 0.02
"""Output change, as a share of its range, from which the output is taken to have moved."""

BEYOND = 0.02
"""Share of the input range within which two turning points are the same."""

HUNTED = 0.05
"""Share of the input range over which a regulator hunts: what turns back by less is no minor loop."""

DENSE = 8
"""Samples that a branch must have for the output on it to be read between samples."""

MOST_EXCURSIONS = 1000
"""Excursions of one recording whose continuation is compared; each one searches all branches."""


@dataclass(frozen=True)
class Excursion:
    """A minor loop: the input turned at a level, went away and came back to it.

    Parameters
    ----------
    start : int
        Number of the turning point from which the interrupted branch came.
    departure : int
        Number of the turning point where the input turned away; its level is that of the return.
    back : int
        Number of the turning point where the branch begins on which the input came back.
    outer : int or None
        Number of the turning point before ``start`` that is remembered still.
    """

    start: int
    departure: int
    back: int
    outer: int | None


def dead_zones(tracks: Sequence[Track], scale: Scale) -> tuple[float | None, float | None]:
    """Return the dead zone after upper and after lower reversals, in units of the input.

    The input's way from the reversal to where the output begins to move back: a line through where
    it has moved by a threshold, and by twice that, is taken back to no movement. The threshold is 2 %
    of the output range or six times the noise, whichever is more. Medians over all reversals after
    which the output moved that far in at least eight samples; None where there is none. For a play
    operator of radius r, 2 r.
    """
    upper: list[float] = []
    lower: list[float] = []
    for track in tracks:
        threshold = max(MOVED * scale.y_span, 6 * track.y_noise)
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
    return _median(upper), _median(lower)


def excursions(heights: Array, tolerance: float) -> Iterator[Excursion]:
    """Yield the minor loops between turning points, inner ones before those around them.

    Parameters
    ----------
    heights : array, shape (m,)
        Input at the turning points.
    tolerance : float
        A level is passed when the input goes further than this beyond it.
    """
    open_turns: list[int] = [0]
    for k in range(1, heights.size):
        way = np.sign(heights[k] - heights[k - 1])
        while len(open_turns) >= 2 and way * (heights[k] - heights[open_turns[-2]]) > tolerance:
            if len(open_turns) >= 3:
                outer = open_turns[-4] if len(open_turns) >= 4 else None
                yield Excursion(open_turns[-3], open_turns[-2], k - 1, outer)
                del open_turns[-2:]
            else:
                del open_turns[0]
        open_turns.append(k)


def minor_loop_errors(tracks: Sequence[Track], scale: Scale) -> tuple[float | None, float | None]:
    """Return the closure error and the wiping-out error, in % of the output range.

    Closure: after a minor loop, the output where the input is back at the level of departure, against
    the output at departure. Wiping-out: further on, the output against that on branches from the same
    turning points without the minor loop. Medians of absolute differences over loops of at least 5 % of
    the input range, as a regulator hunts over less; None where the recordings have no such loops with at
    least eight samples a branch. Both are zero for every model of
    Preisach type, of which Prandtl-Ishlinskii models are some.
    """
    closure, wiping = [], []
    for track in tracks:
        heights, turns = track.heights, track.turns
        tolerance = 0.5 * BEYOND * scale.u_span
        away = HUNTED * scale.u_span
        loops = (
            each
            for each in excursions(heights, tolerance)
            if abs(heights[each.back] - heights[each.departure]) >= away
        )
        for count, found in enumerate(loops):
            returned = _output_at(track, found.back, float(heights[found.departure]))
            if returned is None:
                continue
            closure.append(abs(returned - float(track.y[turns[found.departure]])))
            if count < MOST_EXCURSIONS:
                left = _wiping_error(track, found, BEYOND * scale.u_span)
                if left is not None:
                    wiping.append(left)
    share = 100 / scale.y_span
    return tuple(  # type: ignore[return-value]
        None if value is None else share * value for value in (_median(closure), _median(wiping))
    )


def _wiping_error(track: Track, found: Excursion, tolerance: float) -> float | None:
    """Compare the output beyond the level of departure with branches that were not interrupted."""
    heights = track.heights
    origin, departure = float(heights[found.start]), float(heights[found.departure])
    way = 1.0 if departure > origin else -1.0
    end = float(heights[found.back + 1])
    if found.outer is not None:
        outer = float(heights[found.outer])
        end = way * min(way * end, way * outer)
    if way * (end - departure) < 2 * tolerance:
        return None
    level = 0.5 * (departure + end)
    same = np.abs(heights[:-1] - origin) <= tolerance
    same &= way * (heights[1:] - level) > 0
    if found.outer is not None:
        before = np.concatenate([[np.inf], heights[:-2]])
        same &= np.abs(before - outer) <= tolerance
    same[[found.start, found.back]] = False
    undisturbed = [
        output
        for branch in np.flatnonzero(same)
        if (output := _output_at(track, int(branch), level)) is not None
    ]
    here = _output_at(track, found.back, level)
    return None if here is None or not undisturbed else abs(here - float(np.mean(undisturbed)))


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
    reached = x >= limit
    i = int(np.argmax(reached))
    if not reached[i]:
        return None
    if i == 0:
        return float(wanted[0])
    share = (limit - x[i - 1]) / (x[i] - x[i - 1])
    return float(wanted[i - 1] + share * (wanted[i] - wanted[i - 1]))


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None
