"""Loops: output over input along rising and falling branches, and what can be read off them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.characterization.tracks import SAMPLED, STILL, Scale, Track
from mckibben.metrics import loop_area
from mckibben.signals.reversals import whole_cycles

SHARES = np.linspace(0.02, 0.98, 49)
"""Input levels of a curve, as shares of its range; the middle one is mid input."""

MIDDLE = SHARES.size // 2

WINDOW = 0.025
"""Samples this close to a level, as a share of the range, make the curve there."""

FEWEST = 8
"""Samples that a branch must have for its shape to be known."""

EQUAL = 0.98
"""Amplitudes from this share of the largest on are as large."""

AS_HIGH, VENTED = 0.05, 0.7
"""Shares of the amplitude within which repeats turn, and that they have at least."""

CLOSED, ENOUGH = 0.02, 0.8
"""Shares of the amplitude within which a loop that ends where it began does, and which a closed one has
at least to stand for one that is not."""

PART = 0.5
"""Share of the other branch that a branch at either end of a recording must have to make a loop."""

SLIGHT = 1.0
"""Loop width below which a loop has no shape worth measuring [% of the output range]."""


@dataclass(frozen=True)
class Cycle:
    """One cycle of the input, minimum to minimum, of at least a tenth of the input range.

    The first and the last of a recording may lack half of a branch, as where a muscle is vented part of
    the way: what is told of them is between the levels that both branches cover.

    Parameters
    ----------
    recording : int
        Number of its recording, or of its stretch of one, from 0.
    low, high : float
        The input levels that both branches cover.
    rate : float or None
        Mean speed of the input, up and down [input unit/s]; None without time.
    width : float
        Loop width e_w [% of the cycle's output range].
    """

    recording: int
    low: float
    high: float
    rate: float | None
    width: float

    @property
    def amplitude(self) -> float:
        """High less low."""
        return self.high - self.low


@dataclass(frozen=True)
class Loop:
    """The curves of one cycle.

    Parameters
    ----------
    cycle : Cycle
    levels : array, shape (49,)
        Input levels.
    up, down : array, shape (49,)
        Output along the rising and the falling branch, at the levels.
    span : float
        Range of the output.
    area : float
        Area enclosed, input times output.
    begins, ends : int
        Its first and last sample.
    closed : bool
        Whether it ends where it began, so that its branches are those of one loop.
    """

    cycle: Cycle
    levels: Array
    up: Array
    down: Array
    span: float
    area: float
    begins: int
    ends: int
    closed: bool

    @property
    def mid_width(self) -> float:
        """Distance of the branches at mid input, unit of the output."""
        return float(abs(self.down[MIDDLE] - self.up[MIDDLE]))

    @property
    def asymmetry(self) -> float | None:
        """How far the loop is from its own image, turned by half a turn [% of the output range].

        Root mean square over the levels of up(mid + s) + down(mid - s) less its mean. Zero for every
        loop of a classical Prandtl-Ishlinskii model; a bent or saturating loop has more. None where it
        is not closed.
        """
        if not self.closed:
            return None
        sums = self.up + self.down[::-1]
        return 100 * float(np.std(sums)) / self.span

    @property
    def width_centroid(self) -> float | None:
        """Where the loop is wide: centroid of its width over the input, -1 low, 0 mid, 1 high.

        None where it is too narrow to tell.
        """
        widths = np.abs(self.down - self.up)
        if 100 * widths.mean() < SLIGHT / 2 * self.span:
            return None
        return float(np.sum((2 * SHARES - 1) * widths) / np.sum(widths))


def loops_of(tracks: Sequence[Track], scale: Scale) -> list[Loop]:
    """Return the cycles with at least eight samples on each branch, in order of time.

    Minor loops within a branch are left out of it.
    """
    found = []
    for number, track in enumerate(tracks):
        for piece in whole_cycles(track.u, track.major_turns, PART):
            loop = _loop(number, track, piece, STILL * scale.u_span)
            if loop is not None:
                found.append(loop)
    return found


def largest_of(loops: Sequence[Loop]) -> list[Loop]:
    """Return the largest loop, and those of recordings that repeat it, from the narrowest to the widest.

    Of equally large ones of a recording it is the last: the first often starts from a memory that never
    comes again. A repeat turns as high, and may be vented to another end.
    """
    most = max((loop.cycle.amplitude for loop in loops), default=0.0)
    closed = [loop for loop in loops if loop.closed]
    if any(loop.cycle.amplitude >= ENOUGH * most for loop in closed):
        loops = closed
    found: dict[int, Loop] = {}
    for number in {loop.cycle.recording for loop in loops}:
        own = [loop for loop in loops if loop.cycle.recording == number]
        limit = EQUAL * max(loop.cycle.amplitude for loop in own)
        found[number] = next(loop for loop in reversed(own) if loop.cycle.amplitude >= limit)
    if not found:
        return []
    largest = max((loop.cycle for loop in found.values()), key=lambda cycle: cycle.amplitude)
    repeats = (
        loop
        for loop in found.values()
        if loop.cycle.amplitude >= VENTED * largest.amplitude
        and abs(loop.cycle.high - largest.high) <= AS_HIGH * largest.amplitude
    )
    return sorted(repeats, key=lambda loop: loop.cycle.width)


def curve(u: Array, y: Array, levels: Array, half: float) -> Array:
    """Return the output at input levels: a line fitted to the samples near each level.

    Between samples further apart than that it is interpolated; beyond them it is NaN.

    Parameters
    ----------
    u, y : array, shape (n,)
        Samples in any order, n at least 1.
    levels : array, shape (k,)
    half : float
        Samples at most this far from a level are near.
    """
    order = np.argsort(u, kind="stable")
    x, z = u[order], y[order]
    first = np.searchsorted(x, levels - half)
    stop = np.searchsorted(x, levels + half, side="right")
    centre, middle = 0.5 * (x[0] + x[-1]), float(z.mean())
    v, w = x - centre, z - middle
    count = stop - first
    sums = [_sums(q, first, stop) / np.maximum(count, 1) for q in (v, w, v * v, v * w)]
    mean_v, mean_w, mean_vv, mean_vw = sums
    spread = mean_vv - mean_v**2
    # A line needs samples on some length of input; the mean is all that a cluster gives.
    wide = spread > (0.1 * half) ** 2
    slope = np.where(wide, mean_vw - mean_v * mean_w, 0.0) / np.where(wide, spread, 1.0)
    fitted = middle + mean_w + slope * (levels - centre - mean_v)
    # no line is drawn on beyond its samples: what is near may be one cluster, far to one side
    last = x.size - 1
    amid = (x[np.minimum(first, last)] <= levels) & (levels <= x[np.clip(stop - 1, 0, last)])
    near = (count >= 3) & wide & amid
    found = np.where(near, fitted, np.interp(levels, x, z))
    found[(levels < x[0]) | (levels > x[-1])] = np.nan
    return np.asarray(found)


def pooled_curves(tracks: Sequence[Track], scale: Scale) -> tuple[Array, Array, Array]:
    """Return levels over the input range, and the mean output there, rising and falling.

    All samples count, whatever branch they are on; the first sample of a branch counts for the branch
    that led to it. NaN where the input never went that way.
    """
    levels = scale.u_low + SHARES * scale.u_span
    ways = [np.sign(np.diff(track.u[track.major_turns])) for track in tracks]
    ways = [
        np.repeat(way, np.diff(track.major_turns)) for way, track in zip(ways, tracks, strict=True)
    ]
    curves = []
    for direction in (1, -1):
        chosen = [way == direction for way in ways]
        u = np.concatenate([t.u[1:][c] for t, c in zip(tracks, chosen, strict=True)])
        y = np.concatenate([t.y[1:][c] for t, c in zip(tracks, chosen, strict=True)])
        empty = np.full(levels.size, np.nan)
        curves.append(curve(u, y, levels, WINDOW * scale.u_span) if u.size else empty)
    return levels, curves[0], curves[1]


def unexplained(
    tracks: Sequence[Track], levels: Array, rising: Array, falling: Array
) -> float | None:
    """Return the share of the output's variance that its branches leave; None without both of them.

    Small where the output follows the input, however wide its loop; large where it swings by itself.
    """
    known = np.isfinite(rising) & np.isfinite(falling)
    if not known.any():
        return None
    every = -(-sum(track.u.size for track in tracks) // SAMPLED)
    apart, outputs = [], []
    for track in tracks:
        u, y = track.u[::every], track.y[::every]
        ways = np.sign(np.diff(track.u[track.major_turns]))
        branch = np.searchsorted(track.major_turns, every * np.arange(u.size), side="right") - 1
        up = ways[np.minimum(branch, ways.size - 1)] > 0
        curves = (np.interp(u, levels[known], branch_y[known]) for branch_y in (rising, falling))
        apart.append(y - np.where(up, *curves))
        outputs.append(y)
    return float(np.mean(np.concatenate(apart) ** 2) / np.var(np.concatenate(outputs)))


def _loop(number: int, track: Track, piece: slice, tolerance: float) -> Loop | None:
    u, y = track.u[piece], track.y[piece]
    top = int(np.argmax(u))
    rise, fall = np.arange(top + 1), np.arange(top, u.size)
    rise = rise[u[rise] >= np.maximum.accumulate(u[rise]) - tolerance]
    fall = fall[u[fall] <= np.minimum.accumulate(u[fall]) + tolerance]
    if min(rise.size, fall.size) < FEWEST:
        return None
    low, high = float(max(u[0], u[-1])), float(u[top])
    levels = low + SHARES * (high - low)
    half = WINDOW * (high - low)
    up, down = curve(u[rise], y[rise], levels, half), curve(u[fall], y[fall], levels, half)
    if not np.isfinite(up + down).all():
        return None
    covered = u >= low
    span = float(np.ptp(y[covered]))
    if span == 0:
        return None
    rate = None
    if track.sample_time is not None:
        rate = (2 * u[top] - u[0] - u[-1]) / (track.sample_time * (u.size - 1))
    width = 100 * float(abs(down[MIDDLE] - up[MIDDLE])) / span
    cycle = Cycle(number, low, high, None if rate is None else float(rate), width)
    closed = bool(abs(u[-1] - u[0]) <= CLOSED * (high - low))
    area = loop_area(u[covered], y[covered])
    return Loop(cycle, levels, up, down, span, area, piece.start, piece.stop - 1, closed)


def _sums(q: Array, first: NDArray[np.intp], stop: NDArray[np.intp]) -> Array:
    total = np.concatenate([[0.0], np.cumsum(q)])
    return np.asarray(total[stop] - total[first])
