"""What depends on time: creep in holds, drift between cycles, dependence on rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mckibben.characterization.loops import Cycle, Loop
from mckibben.characterization.tracks import Scale, Track
from mckibben.signals.reversals import swing_threshold

HELD = 0.005
"""Share of its range within which an input counts as held."""

HELD_TRAVEL = 0.5
"""A hold lasts at least as long as the input, when it moves, takes for this share of its range."""

SETTLED = 0.1
"""Share of a hold that is left out at its start, so that the lag of a jump is not taken for creep."""

CLEAR = 20
"""A step this many times the noise shows movement."""

ALIKE = 0.05
"""Share of the amplitude by which the extremes of two cycles may differ for these to be compared."""

REPEATED = 0.02
"""The same of cycles whose outputs are compared."""

SPEED_RATIO = 1.5
"""Speeds must differ this much for dependence on rate to be judged."""

FEWEST, SURE = 4, 0.99
"""Cycles, and level of the interval of what they tell of speed."""

WEAK, STRONG = 0.05, 0.2
"""Change of the loop width at twice the speed, relative to its mean: from here weak, strong."""

LEAST = 1.0
"""Loop width that changes are compared with where there is hardly a loop [% of output range]."""


def creep(tracks: Sequence[Track], scale: Scale) -> tuple[float | None, float | None]:
    """Return how far the output creeps in a hold of the input, and over what time [s].

    Positive where it goes on the way it was going. A hold keeps the input within 0.5 % of its range,
    or its noise, for as long as it otherwise takes to cross half of its range, and at least ten
    samples. The first tenth of it is left out; the means over the second tenth and the last are
    compared. Medians over the holds that are at least half as long as the longest. None without time
    or holds.
    """
    found = []
    for track in tracks:
        if track.sample_time is None:
            continue
        settled = swing_threshold(track.u_noise, scale.u_span, track.u.size)
        for start, stop in holds(track, scale):
            before = track.u[max(0, start - (stop - start)) : start]
            if before.size == 0 or np.ptp(before) < settled:
                continue
            came_from = float(before[np.argmax(np.abs(before - track.u[start]))])
            way = scale.sign * np.sign(track.u[start] - came_from)
            part = max(1, round(SETTLED * (stop - start)))
            early, late = (track.y[at : at + part].mean() for at in (start + part, stop - part))
            lasted = track.sample_time * (stop - start - 2 * part)
            found.append((lasted, float(way * (late - early))))
    if not found:
        return None, None
    times, moves = np.array(found).T
    long = times >= 0.5 * times.max()
    return float(np.median(moves[long])), float(np.median(times[long]))


def drift(loops: Sequence[Loop]) -> float | None:
    """Return the change of the output from one cycle to the next of the same amplitude.

    Mean over both branches at the same inputs, median over the pairs of cycles that follow each other
    and whose extremes differ by at most a fiftieth of the amplitude: what else is remembered is then
    the same. None where there is no such pair.
    """
    changes = []
    for one, other in pairwise(loops):
        follows = one.cycle.recording == other.cycle.recording and one.ends == other.begins
        closed = one.closed and other.closed
        if follows and closed and _alike(one.cycle, other.cycle, REPEATED):
            common = (one.levels >= other.levels[0]) & (one.levels <= other.levels[-1])
            later = [
                np.interp(one.levels[common], other.levels, curve)
                for curve in (other.up, other.down)
            ]
            sooner = [one.up[common], one.down[common]]
            changes.append(float(np.mean(np.subtract(later, sooner))))
    return float(np.median(changes)) if changes else None


@dataclass(frozen=True)
class RateDependence:
    """How the loop width depends on speed.

    Parameters
    ----------
    growth : float or None
        How much wider the loop is at twice the speed [% of output range].
    verdict : str
        "none", "weak", "strong" or "unknown".
    speeds : (float, float) or None
        The slowest and the fastest mean speed compared [input unit/s].
    """

    growth: float | None = None
    verdict: str = "unknown"
    speeds: tuple[float, float] | None = None


def rate_dependence(loops: Sequence[Loop]) -> RateDependence:
    """Return how much wider the loop is at twice the speed, and a verdict.

    A line through e_w over the logarithm of the mean speed, of the closed cycles between like extremes
    that differ most in speed. The verdict is "none", "weak" or "strong" as twice the speed changes the
    width by less than 5 %, less than 20 %, or more of its mean; "unknown" where the speeds differ by
    less than half, there are fewer than four cycles, or the change is within its 99 % interval.
    """
    from scipy.special import stdtrit

    timed = [loop.cycle for loop in loops if loop.cycle.rate is not None and loop.closed]
    if not timed:
        return RateDependence()
    # Any cycle may be the one to compare with; of very many, fifty will do.
    wanted = timed[:: max(1, len(timed) // 50)]
    groups = [[cycle for cycle in timed if _alike(one, cycle)] for one in wanted]
    rates = [np.array([cycle.rate for cycle in group], dtype=float) for group in groups]
    widest = int(np.argmax([np.ptp(np.log2(rate)) for rate in rates]))
    speed, widths = np.log2(rates[widest]), np.array([cycle.width for cycle in groups[widest]])
    if np.ptp(speed) < np.log2(SPEED_RATIO):
        return RateDependence()
    growth, offset = np.polyfit(speed, widths, 1)
    left = widths - (offset + growth * speed)
    freedom = max(1, speed.size - 2)
    doubt = np.sqrt(left @ left / freedom / np.sum((speed - speed.mean()) ** 2))
    doubt *= stdtrit(freedom, 0.5 + SURE / 2)
    share = abs(growth) / max(float(widths.mean()), LEAST)
    if share < WEAK:
        verdict = "none"
    elif abs(growth) < doubt or speed.size < FEWEST:
        verdict = "unknown"
    else:
        verdict = "weak" if share < STRONG else "strong"
    ends = float(rates[widest].min()), float(rates[widest].max())
    return RateDependence(float(growth), verdict, ends)


def _alike(one: Cycle, other: Cycle, within: float = ALIKE) -> bool:
    limit = within * one.amplitude
    return abs(one.low - other.low) <= limit and abs(one.high - other.high) <= limit


def holds(track: Track, scale: Scale) -> list[tuple[int, int]]:
    """Return first and last samples between which the input is held; see `creep`."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    u = track.u
    speed = _speed(track)
    if speed == 0:
        return []
    length = max(10, int(np.ceil(HELD_TRAVEL * scale.u_span / speed)))
    if length > u.size:
        return []
    band = held_within(track, scale)
    swing = maximum_filter1d(u, length, mode="nearest") - minimum_filter1d(
        u, length, mode="nearest"
    )
    # The filters are centred: window i holds samples i - length // 2 on.
    begins = np.arange(u.size) - length // 2
    whole = (begins >= 0) & (begins + length <= u.size)
    quiet = begins[whole & (swing <= band)]
    if quiet.size == 0:
        return []
    breaks = np.flatnonzero(np.diff(quiet) > 1)
    firsts = quiet[np.concatenate([[0], breaks + 1])]
    lasts = quiet[np.concatenate([breaks, [quiet.size - 1]])]
    return [(int(a), int(b) + length) for a, b in zip(firsts, lasts, strict=True)]


def held_within(track: Track, scale: Scale) -> float:
    """Return how far an input moves that counts as held."""
    return max(HELD * scale.u_span, swing_threshold(track.u_noise, 0.0, track.u.size))


def _speed(track: Track) -> float:
    """Return how fast the input moves when it moves [input unit/sample].

    The mean is weighted with the way covered, so that holds and slow turns do not count, and taken
    over steps that are long enough to stand out of the noise.
    """
    stride = track.window
    while True:
        steps = np.abs(np.diff(track.u[::stride]))
        step = float(np.sum(steps**2) / np.sum(steps)) if steps.any() else 0.0
        if step > CLEAR * track.u_noise or 16 * stride > track.u.size:
            return step / stride
        stride *= 2
