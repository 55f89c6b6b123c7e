"""Hysteresis loops: recordings prepared for them, their curves and shape, dead zones, creep, rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import NARROWEST, Array
from mckibben.errors import DataError
from mckibben.metrics import loop_area
from mckibben.numerics.statistics import student
from mckibben.recording import FEWEST_SAMPLES, Recording
from mckibben.signals.holds import STILL, holds, shortest_hold
from mckibben.signals.reversals import (
    branches_between,
    noise_level,
    reversals,
    swing_threshold,
    whole_cycles,
)

Range = tuple[float, float]

NOISE_SHARE, ROUNDING = 1e-3, 1e-12
"""Shares of the range: noise below the first is not averaged; below the second it is rounding."""

MAJOR_SWING_SHARE = 0.1
"""Smallest swing of the input, as a share of its range, that separates cycles."""


@dataclass(frozen=True)
class Spread:
    """Extremes of a channel over all recordings, and its sensor noise.

    Noise is the standard deviation of a sample, NaN for unknown; a step is the least distance between
    two readings.
    """

    low: float
    high: float
    noise: float
    step: float

    @property
    def span(self) -> float:
        """Range."""
        return self.high - self.low

    @classmethod
    def of(cls, signals: Sequence[Array], source: str | None, channel: str) -> Spread:
        """Return that of the pieces of a channel, which must vary."""
        readings = np.unique(np.concatenate(signals))
        low, high = float(readings[0]), float(readings[-1])
        span = high - low
        if span < NARROWEST:
            raise DataError(
                f"it {f'moves by {span:.3g} in all' if span else f'is constant at {low:g}'}, so "
                "hysteresis cannot be measured",
                file=source,
                channel=channel,
                remedy="record while it moves, check its column and unit, or name another channel",
            )
        levels = [noise_level(signal, span) for signal in signals if signal.size > 1]
        known_levels = [level for level in levels if not np.isnan(level)]
        noise = float(np.median(known_levels)) if known_levels else float("nan")
        steps = np.diff(readings)
        step = float(steps[steps > ROUNDING * span].min())
        return cls(low, high, 0.0 if noise < ROUNDING * span else noise, step)


@dataclass(frozen=True)
class Scale:
    """Input and output over all recordings; the sign is -1 if the output falls with the input."""

    u: Spread
    y: Spread
    sign: float = 1.0


@dataclass(frozen=True)
class Track:
    """One recording: input and output, (n,) each, as moving averages where there is noise.

    ``y_noise`` is the noise that is left, 0 where unknown. ``turns`` are the first sample, the turning
    points of the input and the last sample, ``major_turns`` the same without swings below a tenth of
    the input range. A ``periodic`` recording starts at its lowest input.
    """

    u: Array
    y: Array
    sample_time: float | None
    y_noise: float
    turns: NDArray[np.int64]
    major_turns: NDArray[np.int64]
    periodic: bool

    @property
    def branches(self) -> list[tuple[slice, int]]:
        """Samples between major turning points, with 1 if the input rises, else -1."""
        pieces = branches_between(self.u, self.major_turns)
        return [(slice(start, stop), direction) for start, stop, direction in pieces]


def prepare(
    recordings: Sequence[Recording], input_name: str, output_name: str
) -> tuple[Scale, list[Track]]:
    """Return the common scale of recordings, and each of them prepared for measurement.

    Raises
    ------
    DataError
        On no recordings, a missing channel, fewer than ten samples, or a channel that hardly moves.
    """
    if not recordings:
        problem = "there are none to characterize"
        raise DataError(problem, parameter="recordings", remedy="give at least one")
    us, ys = ([recording[name] for recording in recordings] for name in (input_name, output_name))
    source, n = recordings[0].source, sum(map(len, recordings))
    if n < FEWEST_SAMPLES:
        raise DataError(
            f"{n} samples are too few to characterize",
            file=source,
            channel=input_name,
            remedy=f"record at least {FEWEST_SAMPLES}, better whole cycles with 50 or more each",
        )
    scale = Scale(Spread.of(us, source, input_name), Spread.of(ys, source, output_name))
    tracks = [
        _track(u, y, recording.sample_time, scale)
        for u, y, recording in zip(us, ys, recordings, strict=True)
    ]
    # what the output does along the branches: neither drift nor another level between runs turns it
    travel = sum(
        direction * float(track.y[part][-1] - track.y[part][0])
        for track in tracks
        for part, direction in track.branches
    )
    return replace(scale, sign=-1.0 if travel < 0 else 1.0), tracks


def _track(u: Array, y: Array, sample_time: float | None, scale: Scale) -> Track:
    periodic = _closes(u, scale.u.noise) and _closes(y, scale.y.noise)
    if periodic:  # one loop wherever its record begins
        if u[0] == u[-1] and y[0] == y[-1]:
            u, y = u[:-1], y[:-1]
        start = int(np.argmin(u))
        u, y = (np.append(np.roll(x, -start), x[start]) for x in (u, y))
    noisy = any(spread.noise > NOISE_SHARE * spread.span for spread in (scale.u, scale.y))
    # so many samples take the input over 1 % of its range
    window = max(1, shortest_hold(u, scale.u.span) // 50 - 1) | 1 if noisy else 1
    if window > 1:
        from scipy.ndimage import uniform_filter1d

        u, y = (np.asarray(uniform_filter1d(x, window, mode="nearest")) for x in (u, y))
    u_noise, y_noise = (
        float(np.nan_to_num(spread.noise)) / np.sqrt(window) for spread in (scale.u, scale.y)
    )
    threshold = swing_threshold(u_noise, scale.u.span, u.size)
    turns = reversals(u, threshold)
    major_turns = reversals(u, max(threshold, MAJOR_SWING_SHARE * scale.u.span))
    return Track(u, y, sample_time, y_noise, turns, major_turns, periodic)


def _closes(x: Array, noise: float) -> bool:
    """Return whether a signal is periodic: its end continues at its beginning."""
    usual_step = float(np.quantile(np.abs(np.diff(x)), 0.99)) if x.size > FEWEST_SAMPLES else 0.0
    return bool(abs(x[0] - x[-1]) <= max(1.5 * usual_step, 4 * np.nan_to_num(noise)))


SHARES = np.linspace(0.02, 0.98, 49)
"""Input levels of a curve, as shares of the input range; the middle one is mid input."""

WINDOW, FEWEST_IN_WINDOW = 0.025, 8
"""Half width of the window of a curve's point, as a share of the range; smallest number of samples
in it.
"""

LARGEST_SHARE, CLOSURE_SHARE = 0.9, 0.02
"""Share of the largest amplitude above which a cycle is a largest one; largest closure error of a
closed loop, relative to its amplitude.
"""

BRANCH_SHARE, NARROW_SHARE = 0.5, 0.005
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


LOOP_FIGURES = (
    "loop_width",
    "mid_width",
    "loop_area",
    "loop_area_share",
    "asymmetry",
    "width_centroid",
)
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
        for piece in whole_cycles(track.u, track.major_turns, BRANCH_SHARE)
    )
    return [
        loop for place_of_piece in pieces if (loop := _loop(*place_of_piece, scale)) is not None
    ]


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
    widths, closed = np.abs(down - up), bool(abs(u[-1] - u[0]) <= CLOSURE_SHARE * amplitude)
    mid = float(widths[SHARES.size // 2])
    seconds = None if track.sample_time is None else track.sample_time * (u.size - 1)
    rate = None if seconds is None else float((2 * u[top] - u[0] - u[-1]) / seconds)
    area, wide = loop_area(u[covered], y[covered]), widths.mean() >= NARROW_SHARE * span
    asymmetry = 100 * float(np.std(up + down[::-1])) / span if closed else None
    centroid = float((2 * SHARES - 1) @ widths / widths.sum()) if wide else None
    first = piece.start <= track.major_turns[1] and not track.periodic
    width, share = 100 * mid / span, 100 * area / (amplitude * span)
    figures = dict(zip(LOOP_FIGURES, (width, mid, area, share, asymmetry, centroid), strict=True))
    cycle = Cycle(number, low, high, rate, width)
    return Loop(cycle, levels, up, down, piece.start, piece.stop - 1, closed, first, figures)


def largest_of(loops: Sequence[Loop]) -> list[Loop]:
    """Return the largest loops, closed ones if there are any.

    The first of a recording, which starts from an unknown memory, counts where there is no other.
    """
    largest = max((loop.cycle.amplitude for loop in loops), default=0.0)
    large = [loop for loop in loops if loop.cycle.amplitude >= LARGEST_SHARE * largest]
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
    is_averaged, inside = count > 2, (x[0] <= levels) & (levels <= x[-1])
    inputs = np.where(is_averaged, means[0], levels)[inside]
    outputs = np.where(is_averaged, means[1], np.interp(levels, x, z))[inside]
    # the ends as they are, so that nothing is cut off within half a window of them
    inputs, order_of_inputs = np.unique(np.concatenate([inputs, x[[0, -1]]]), return_index=True)
    outputs = np.concatenate([outputs, z[[0, -1]]])[order_of_inputs]
    return np.interp(levels, inputs, outputs, left=np.nan, right=np.nan)


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
    is_known = np.isfinite(x)
    count = np.where(is_known.any(axis=axis), is_known.sum(axis=axis), np.nan)
    return np.asarray(np.where(is_known, x, 0.0).sum(axis=axis) / count)


def branches_of(tracks: Sequence[Track], scale: Scale) -> Branches:
    """Return the curves of all major branches with at least three samples.

    The first of five or more of a recording, which starts from an unknown memory, is left out.
    """
    levels, half = scale.u.low + SHARES * scale.u.span, _half(scale, scale.u.span)
    pieces = [
        (curve(track.u[part], track.y[part], levels, half), direction, number)
        for number, track in enumerate(tracks)
        for part, direction in track.branches[len(track.branches) > 4 and not track.periodic :]
        if part.stop - part.start >= 3
    ]
    curves, directions, owners = zip(*pieces, strict=True) if pieces else ((), (), ())
    shape = (len(pieces), levels.size)
    return Branches(levels, np.reshape(curves, shape), np.array(directions), np.array(owners))


def gap_of(branches: Branches, sign: float) -> tuple[float | None, Range | None, float | None]:
    """Return the gap between falling and rising branches, its 95 % interval, and p without a loop.

    Every branch is compared with the mean of those before and after, so that drift cancels. The error
    is that of branches which differ as much as those of one direction do: a t-test. That direction
    counts in which they differ less, as branches of loops that turn at different peaks differ after the
    peak. Of fewer than four branches, which drift would part as well, there is no interval.
    """
    from scipy.special import fdtrc

    curves, same = branches.curves, np.diff(branches.owners) == 0
    directions, inner = branches.ways[:, np.newaxis], same[1:] & same[:-1]
    middle, before, after = curves[1:-1], curves[:-2], curves[2:]
    repeats = np.where(np.isfinite(middle), after - before, np.nan)
    pairs, gaps, rising, falling = (
        means[np.isfinite(means)]
        for means in (
            _mean((directions[1:] * (curves[:-1] - curves[1:]))[same], axis=1),
            _mean((directions[1:-1] * (0.5 * (before + after) - middle))[inner], axis=1),
            *(
                _mean(repeats[inner & (branches.ways[1:-1] == direction)], axis=1)
                for direction in (1, -1)
            ),
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
    half = error * student(freedom)
    p = float(fdtrc(1.0, freedom, (gap / error) ** 2)) if error > 0 else float(gap == 0)
    return gap, (gap - half, gap + half), p


def gains_of(branches: Branches, loops: Sequence[Loop], scale: Scale) -> list[float]:
    """Return the mean slope of rising and falling output at mid input, over a fifth of the range.

    Of the largest loops where they cover the input range, else of all branches.
    """
    curves = [
        (loop.levels, loop.up, loop.down)
        for loop in loops
        if loop.cycle.amplitude >= LARGEST_SHARE * scale.u.span
    ] or [(branches.levels, *branches.means)]
    centre, tenth = 0.5 * (scale.u.low + scale.u.high), 0.1 * scale.u.span
    ends, gains = [centre - tenth, centre + tenth], []
    for u, up, down in curves:
        known = np.isfinite(up + down)
        if known.any() and u[known][0] <= ends[0] and u[known][-1] >= ends[1]:
            low, high = np.interp(ends, u[known], 0.5 * (up + down)[known])
            gains.append(float(high - low) / (2 * tenth))
    return gains


def explained(tracks: Sequence[Track]) -> float:
    """Return the share of the output's variance that input and direction explain, by means over bins."""
    u, y = (np.concatenate([getattr(track, name) for track in tracks]) for name in "uy")
    rising = np.concatenate([np.gradient(track.u) > 0 for track in tracks])
    ends = np.quantile(u, np.linspace(0, 1, BINS + 1)[1:-1])
    bins = 2 * np.searchsorted(ends, u) + rising
    count, total = np.bincount(bins), np.bincount(bins, y)
    unexplained = np.var(y - (total / np.maximum(count, 1))[bins])
    return float(1 - unexplained / np.var(y)) if np.ptp(y) > 0 else 0.0


def drift(loops: Sequence[Loop]) -> list[float]:
    """Return the changes of the output from one closed cycle to the next between the same extremes."""
    changes = []
    for cycle, next_cycle in pairwise(loops):
        follows = (
            cycle.cycle.recording == next_cycle.cycle.recording and cycle.ends == next_cycle.begins
        )
        if (
            follows
            and cycle.closed
            and next_cycle.closed
            and cycle.cycle.like(next_cycle.cycle, CLOSURE_SHARE)
        ):
            common = (cycle.levels >= next_cycle.levels[0]) & (
                cycle.levels <= next_cycle.levels[-1]
            )
            later = [
                np.interp(cycle.levels[common], next_cycle.levels, x)
                for x in (next_cycle.up, next_cycle.down)
            ]
            changes.append(
                float(np.mean(np.subtract(later, [cycle.up[common], cycle.down[common]])))
            )
    return changes


MOVED_SHARE = 0.02
"""Output change, relative to its range, above which the output has moved."""

FEWEST_IN_BRANCH = 8
"""Smallest number of samples of an interpolated branch."""

SETTLING_SHARE = 0.1
"""Share of a hold that is discarded at its start, so that lag does not count as creep."""

LIKE_SHARE, SPEED_RATIO = 0.05, 1.5
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
        threshold = max(MOVED_SHARE * scale.y.span, 6 * track.y_noise, 2 * scale.y.step)
        for k in range(1, track.turns.size - 1):
            u, y = (x[track.turns[k] : track.turns[k + 1] + 1] for x in (track.u, track.y))
            if u.size <= FEWEST_IN_BRANCH:
                continue
            direction = float(np.sign(u[-1] - u[0]))
            travel, moved = direction * (u - u[0]), scale.sign * direction * (y - y[0])
            once, twice = (_first_reach(travel, moved, limit * threshold) for limit in (1, 2))
            if once is not None and twice is not None:
                (upper if direction < 0 else lower).append(max(0.0, 2 * once - twice))
    return upper, lower


def _first_reach(values: Array, x: Array, limit: float) -> float | None:
    """Return ``wanted`` where ``x`` first reaches a limit, interpolated; None if it never does."""
    index = int(np.argmax(x >= limit))
    if not x[index] >= limit:
        return None
    if index == 0:
        return float(values[0])
    share = (limit - x[index - 1]) / (x[index] - x[index - 1])
    return float(values[index - 1] + share * (values[index] - values[index - 1]))


def creep(
    runs: Sequence[Recording], drive: str, response: str, scale: Scale
) -> list[tuple[float, float]]:
    """Return the times [s] and creep [output unit] of the holds at least half as long as the longest.

    The first tenth of a hold is left out; the means over the second tenth and the last are compared,
    positive where the output went on as it was going. Holds into which the input did not move are left
    out.
    """
    span, changes = scale.u.span, []
    for run in runs:
        u, y = run[drive], run[response]
        if run.sample_time is None:
            continue
        for hold in holds(u[:, np.newaxis], [span], shortest_hold(u, span)):
            length = hold.stop - hold.start
            before = u[max(0, hold.start - length) : hold.start]
            if before.size == 0 or np.ptp(before) < 2 * STILL * span:
                continue
            approach = u[hold.start] - before[np.argmax(np.abs(before - u[hold.start]))]
            part = max(1, round(SETTLING_SHARE * length))
            early, late = (
                y[start : start + part].mean() for start in (hold.start + part, hold.stop - part)
            )
            crept = scale.sign * float(np.sign(approach) * (late - early))
            changes.append((run.sample_time * (length - 2 * part), crept))
    longest = max((time for time, _ in changes), default=0.0)
    return [(time, crept) for time, crept in changes if time >= 0.5 * longest]


def rate_dependence(loops: Sequence[Loop]) -> tuple[float, Range, Range] | None:
    """Return the increase of loop width at twice the speed [%], its 95 % interval, and the speeds.

    By a straight line over the logarithm of the mean speed, of three or more closed cycles between like
    extremes that differ most in speed, without the first of a recording, which starts from an unknown
    memory.
    """
    timed = [
        (loop.cycle, np.log2(loop.cycle.rate))
        for loop in loops
        if loop.cycle.rate is not None and loop.closed and not loop.first
    ]
    # Any cycle may be the one to compare with; of very many, fifty will do.
    groups = [
        [(rate, cycle.width) for cycle, rate in timed if reference.like(cycle, LIKE_SHARE)]
        for reference, _ in timed[:: max(1, len(timed) // 50)]
    ]
    if not groups:
        return None
    speed, widths = np.transpose(max(groups, key=lambda group: np.ptp([rate for rate, _ in group])))
    if speed.size < 3 or np.ptp(speed) < np.log2(SPEED_RATIO):
        return None
    _, speed_number, count = np.unique(np.round(4 * speed), return_inverse=True, return_counts=True)
    # every speed weighs the same, however many cycles have it
    coefficients, spread = np.polyfit(
        speed, widths, 1, w=1 / np.sqrt(count[speed_number]), cov=True
    )
    growth = float(coefficients[0])
    half = float(np.sqrt(spread[0, 0])) * student(speed.size - 2)
    ends = float(2 ** speed.min()), float(2 ** speed.max())
    return growth, (growth - half, growth + half), ends
