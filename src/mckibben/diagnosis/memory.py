"""Memory: what the output does after a reversal, and after a minor loop."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.tracks import Scale, Track

MOVED = 0.02
"""Output change, as a share of its range, from which the output is taken to have moved."""

SAME = 0.01
"""Share of the input range beyond which a level is passed."""

HUNTED = 0.05
"""Share of the input range over which a regulator hunts: what turns back by less is no minor loop."""

DENSE = 8
"""Samples that a branch must have for the output on it to be read between samples."""


def dead_zones(tracks: Sequence[Track], scale: Scale) -> tuple[list[float], list[float]]:
    """Return the dead zones after upper and after lower reversals [input unit].

    The input's way from the reversal to where the output begins to move back: a line through where it
    has moved by a threshold, and by twice that, is taken back to no movement. The threshold is 2 % of
    the output range, six times the noise or two steps of the sensor, whichever is most. For a play
    operator of radius r, 2 r.
    """
    upper: list[float] = []
    lower: list[float] = []
    coarse = 2 * scale.y_step if scale.y_step > 1e-3 * scale.y_span else 0.0
    for track in tracks:
        threshold = max(MOVED * scale.y_span, 6 * track.y_noise, coarse)
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
    """Yield the minor loops between turning points, inner ones before those around them.

    Of each the turning point where the input went away from a level, and the one from which it came
    back to it.

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
