"""Hysteresis loops: output over input along rising and falling branches, and their shape."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.tracks import Range, Scale, Track
from mckibben.metrics import loop_area
from mckibben.signals.holds import STILL
from mckibben.signals.reversals import whole_cycles

SHARES = np.linspace(0.02, 0.98, 49)
"""Input levels of a curve, as shares of the input range; the middle one is mid input."""

WINDOW, FEWEST_IN_WINDOW = 0.025, 8
"""Half width of the window of a curve's point, as a share of the range; smallest number of samples
in it.
"""

LARGE, CLOSED = 0.9, 0.02
"""Share of the largest amplitude above which a cycle is a largest one; largest closure error of a
closed loop, relative to its amplitude.
"""

PART, SLIGHT = 0.5, 0.005
"""Share of the other branch that a branch at either end of a recording must have to make a loop; mean
width over the output range below which it is not measured where a loop is wide."""

BINS = 12
"""Number of bins of input, for explained variance."""


@dataclass(frozen=True)
class Cycle:
    """One cycle of the input, minimum to minimum, of at least a tenth of the input range.

    ``recording`` counts recordings, or stretches, from 0; ``low`` and ``high`` are the levels that both
    branches cover; ``rate`` is the mean speed of the input [input unit/s], None without time; ``width``
    is the loop width e_w [% of the cycle's output range].
    """

    recording: int
    low: float
    high: float
    rate: float | None
    width: float

    @property
    def amplitude(self) -> float:
        """Highest minus lowest input."""
        return self.high - self.low

    def like(self, other: Cycle, within: float) -> bool:
        """Return whether another cycle has the same extremes, within a share of the amplitude."""
        distance = max(abs(self.low - other.low), abs(self.high - other.high))
        return distance <= within * self.amplitude


FIGURES = ("loop_width", "mid_width", "loop_area", "loop_area_share", "asymmetry", "width_centroid")
"""Quantities of a loop, as in `Characterization`; asymmetry only of closed loops, centroid only of
wide ones.
"""


@dataclass(frozen=True)
class Loop:
    """The curves of one cycle: output ``up`` and ``down`` at input ``levels``, each of shape (49,).

    ``begins`` and ``ends`` are its first and last sample, ``first`` whether its recording begins with
    it, ``closed`` whether the input returns to where it began.
    """

    cycle: Cycle
    levels: Array
    up: Array
    down: Array
    begins: int
    ends: int
    closed: bool
    first: bool
    figures: Mapping[str, float | None]


def loops_of(tracks: Sequence[Track], scale: Scale) -> list[Loop]:
    """Return the cycles with at least eight samples on each branch, in order of time.

    Minor loops within a branch are left out of it.
    """
    pieces = (
        (number, track, piece)
        for number, track in enumerate(tracks)
        for piece in whole_cycles(track.u, track.major_turns, PART)
    )
    return [loop for each in pieces if (loop := _loop(*each, scale)) is not None]


def _loop(number: int, track: Track, piece: slice, scale: Scale) -> Loop | None:
    u, y, still = track.u[piece], track.y[piece], 0.5 * STILL * scale.u.span
    top = int(np.argmax(u))
    rise, fall = np.arange(top + 1), np.arange(top, u.size)
    rise = rise[u[rise] >= np.maximum.accumulate(u[rise]) - still]
    fall = fall[u[fall] <= np.minimum.accumulate(u[fall]) + still]
    low, high = float(max(u[0], u[-1])), float(u[top])
    covered, amplitude = u >= low, high - low
    span = float(np.ptp(y[covered]))
    if min(rise.size, fall.size) < FEWEST_IN_WINDOW or span == 0:
        return None
    levels, half = low + SHARES * amplitude, _half(scale, amplitude)
    up, down = (curve(u[part], y[part], levels, half) for part in (rise, fall))
    if not np.isfinite(up + down).all():
        return None
    widths, closed = np.abs(down - up), bool(abs(u[-1] - u[0]) <= CLOSED * amplitude)
    mid = float(widths[SHARES.size // 2])
    seconds = None if track.sample_time is None else track.sample_time * (u.size - 1)
    rate = None if seconds is None else float((2 * u[top] - u[0] - u[-1]) / seconds)
    area, wide = loop_area(u[covered], y[covered]), widths.mean() >= SLIGHT * span
    asymmetry = 100 * float(np.std(up + down[::-1])) / span if closed else None
    centroid = float((2 * SHARES - 1) @ widths / widths.sum()) if wide else None
    first = piece.start <= track.major_turns[1] and not track.periodic
    width, share = 100 * mid / span, 100 * area / (amplitude * span)
    figures = dict(zip(FIGURES, (width, mid, area, share, asymmetry, centroid), strict=True))
    cycle = Cycle(number, low, high, rate, width)
    return Loop(cycle, levels, up, down, piece.start, piece.stop - 1, closed, first, figures)


def largest_of(loops: Sequence[Loop]) -> list[Loop]:
    """Return the largest loops, closed ones if there are any.

    The first of a recording, which starts from an unknown memory, counts where there is no other.
    """
    most = max((loop.cycle.amplitude for loop in loops), default=0.0)
    large = [loop for loop in loops if loop.cycle.amplitude >= LARGE * most]
    closed = [loop for loop in large if loop.closed]
    return [loop for loop in closed if not loop.first] or closed or large


def curve(u: Array, y: Array, levels: Array, half: float) -> Array:
    """Return the output (k,) at input levels (k,), of samples (n,) in any order; NaN beyond them.

    Means over the samples within ``half`` of a level where there are three or more, interpolated from
    the mean inputs there.
    """
    order = np.argsort(u, kind="stable")
    x, z = u[order], y[order]
    first = np.searchsorted(x, levels - half)
    count = np.searchsorted(x, levels + half, side="right") - first
    sums = (np.concatenate([[0.0], np.cumsum(q)]) for q in (x, z))
    means = [(total[first + count] - total[first]) / np.maximum(count, 1) for total in sums]
    near, known = count > 2, (x[0] <= levels) & (levels <= x[-1])
    places = np.where(near, means[0], levels)[known]
    heights = np.where(near, means[1], np.interp(levels, x, z))[known]
    # the ends as they are, so that nothing is cut off within half a window of them
    places, which = np.unique(np.concatenate([places, x[[0, -1]]]), return_index=True)
    heights = np.concatenate([heights, z[[0, -1]]])[which]
    return np.interp(levels, places, heights, left=np.nan, right=np.nan)


def _half(scale: Scale, amplitude: float) -> float:
    """Return the half width of a curve's window: several steps of a coarse sensor."""
    steps = max(spread.step / spread.span for spread in (scale.u, scale.y))
    return max(WINDOW * amplitude, min(2 * steps, 0.25) * scale.u.span)


@dataclass(frozen=True)
class Branches:
    """All major branches: curves (m, 49) at common levels, directions (m,), recordings (m,)."""

    levels: Array
    curves: Array
    ways: Array
    owners: Array

    @property
    def means(self) -> tuple[Array, Array]:
        """Mean curves (49,) of both directions, NaN at levels that they do not cover."""
        rising, falling = (_mean(self.curves[self.ways == way], axis=0) for way in (1, -1))
        return rising, falling


def _mean(x: Array, axis: int) -> Array:
    """Return the mean of known values along an axis, NaN if there are none."""
    known = np.isfinite(x)
    count = np.where(known.any(axis=axis), known.sum(axis=axis), np.nan)
    return np.asarray(np.where(known, x, 0.0).sum(axis=axis) / count)


def branches_of(tracks: Sequence[Track], scale: Scale) -> Branches:
    """Return the curves of all major branches with at least three samples.

    The first of five or more of a recording, which starts from an unknown memory, is left out.
    """
    levels, half = scale.u.low + SHARES * scale.u.span, _half(scale, scale.u.span)
    found = [
        (curve(track.u[part], track.y[part], levels, half), way, number)
        for number, track in enumerate(tracks)
        for part, way in track.branches[len(track.branches) > 4 and not track.periodic :]
        if part.stop - part.start >= 3
    ]
    curves, ways, owners = zip(*found, strict=True) if found else ((), (), ())
    shape = (len(found), levels.size)
    return Branches(levels, np.reshape(curves, shape), np.array(ways), np.array(owners))


def gap_of(found: Branches, sign: float) -> tuple[float | None, Range | None, float | None]:
    """Return the gap between falling and rising branches, its 95 % interval, and p without a loop.

    Every branch is compared with the mean of those before and after, so that drift cancels. The error
    is that of branches which differ as much as those of one direction do: a t-test. That direction
    counts in which they differ less, as branches of loops that turn at different peaks differ after the
    peak. Of fewer than four branches, which drift would part as well, there is no interval.
    """
    from scipy.special import fdtrc, stdtrit

    curves, same = found.curves, np.diff(found.owners) == 0
    ways, inner = found.ways[:, np.newaxis], same[1:] & same[:-1]
    here, before, after = curves[1:-1], curves[:-2], curves[2:]
    again = np.where(np.isfinite(here), after - before, np.nan)
    pairs, gaps, rising, falling = (
        means[np.isfinite(means)]
        for means in (
            _mean((ways[1:] * (curves[:-1] - curves[1:]))[same], axis=1),
            _mean((ways[1:-1] * (0.5 * (before + after) - here))[inner], axis=1),
            *(_mean(again[inner & (found.ways[1:-1] == way)], axis=1) for way in (1, -1)),
        )
    )
    if not pairs.size:
        return None, None, None
    n, gap = gaps.size, sign * float(np.mean(gaps if gaps.size else pairs))
    if n < 2:
        return gap, None, None
    # of independent branches, gaps vary by 3/2, their mean by 4/n and repeats by 2 times their variance
    error, freedom = min(
        (float(np.sqrt(2 * np.mean(x**2) / n)), float(x.size)) for x in (rising, falling) if x.size
    )
    half = error * float(stdtrit(freedom, 0.975))
    p = float(fdtrc(1.0, freedom, (gap / error) ** 2)) if error > 0 else float(gap == 0)
    return gap, (gap - half, gap + half), p


def gains_of(found: Branches, loops: Sequence[Loop], scale: Scale) -> list[float]:
    """Return the mean slope of rising and falling output at mid input, over a fifth of the range.

    Of the largest loops where they cover the input range, else of all branches.
    """
    curves = [
        (loop.levels, loop.up, loop.down)
        for loop in loops
        if loop.cycle.amplitude >= LARGE * scale.u.span
    ] or [(found.levels, *found.means)]
    centre, fifth = 0.5 * (scale.u.low + scale.u.high), 0.1 * scale.u.span
    ends, gains = [centre - fifth, centre + fifth], []
    for u, up, down in curves:
        known = np.isfinite(up + down)
        if known.any() and u[known][0] <= ends[0] and u[known][-1] >= ends[1]:
            low, high = np.interp(ends, u[known], 0.5 * (up + down)[known])
            gains.append(float(high - low) / (2 * fifth))
    return gains


def explained(tracks: Sequence[Track]) -> float:
    """Return the share of the output's variance that input and direction explain, by means over bins."""
    u, y = (np.concatenate([getattr(track, name) for track in tracks]) for name in "uy")
    rising = np.concatenate([np.gradient(track.u) > 0 for track in tracks])
    ends = np.quantile(u, np.linspace(0, 1, BINS + 1)[1:-1])
    bins = 2 * np.searchsorted(ends, u) + rising
    count, total = np.bincount(bins), np.bincount(bins, y)
    left = np.var(y - (total / np.maximum(count, 1))[bins])
    return float(1 - left / np.var(y)) if np.ptp(y) > 0 else 0.0


def drift(loops: Sequence[Loop]) -> list[float]:
    """Return the changes of the output from one closed cycle to the next between the same extremes."""
    changes = []
    for one, other in pairwise(loops):
        follows = one.cycle.recording == other.cycle.recording and one.ends == other.begins
        if follows and one.closed and other.closed and one.cycle.like(other.cycle, CLOSED):
            common = (one.levels >= other.levels[0]) & (one.levels <= other.levels[-1])
            later = [np.interp(one.levels[common], other.levels, x) for x in (other.up, other.down)]
            changes.append(float(np.mean(np.subtract(later, [one.up[common], one.down[common]]))))
    return changes
