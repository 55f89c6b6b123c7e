"""Missing samples and time gaps: pieces on one uniform grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array, Mask, Rows, true_runs
from mckibben.files import timebase
from mckibben.files.notices import listed
from mckibben.files.request import GAPS_BRIDGED, Source
from mckibben.files.timebase import Times
from mckibben.files.units import convert
from mckibben.recording import FEWEST_SAMPLES

Channels = dict[str, Array]


@dataclass(frozen=True)
class Piece:
    """Samples on a uniform grid: the step [s], None without time, and the start [s].

    ``bridged`` has the first and the last time of each run of samples that were interpolated.
    """

    samples: Channels
    step: float | None
    start: float
    bridged: list[list[float]]


def pieces(
    channels: Channels, times: Times | None, step: float | None, start: float, source: Source
) -> list[Piece]:
    """Return the segments of channels without gaps, or with gaps bridged, on one uniform grid.

    Parameters
    ----------
    channels : dict
        Samples, NaN where they are missing; those that are not needed are left out where that is not
        bridged.
    times : Times or None
        None where ``step`` is stated or there is no time.
    step, start : float
        Of the samples, where there are no times [s].
    source : Source

    Raises
    ------
    DataError
        If a sample is missing or there is a gap in time, and the policy is to refuse; if no stretch is
        long enough; or if steps are so long that the unit of the times is in doubt.
    """
    missing = _missing(channels, source)
    needed = [mask for name, mask in missing.items() if source.request.needs(name)]
    holes = np.logical_or.reduce(needed or list(missing.values()))
    time = np.arange(holes.size, dtype=float) if times is None else times.values
    split = source.request.gaps == "split"
    inside = ~holes if split else _enclosed(missing, source)
    steps = np.diff(time)
    gap = np.append(False, steps > timebase.GAP * np.median(steps))
    begins = inside & (gap | ~np.append(False, inside[:-1]))
    ends = inside & (np.append(gap[1:], True) | ~np.append(inside[1:], False))
    stretches = np.column_stack([np.flatnonzero(begins), np.flatnonzero(ends) + 1])
    cuts = stretches[len(stretches) if split else 1 :, 0]
    if times is not None and cuts.size:
        _judge_gaps(cuts, times, source)
    full = stretches.reshape(1, -1)[:, [0, -1]] if stretches.size else stretches
    spans = _long_enough(stretches if split else full, source)
    size, jitter = 1.0, None
    if times is not None:
        size, jitter = timebase.common_step(time, spans if split else stretches)
        step = _judged_step(size, jitter, times, source)
        if cuts.size and (time[-1] - time[0]) / size > 100 * time.size:
            problem = "its gaps are too long to bridge"
            raise source.error(problem, "", "time", options=[{"gaps": "split"}])
    result = []
    for first, after in spans:
        t, bridged = time[first:after], holes[first:after] & (not split)
        grid = t
        if cuts.size or jitter is not None:
            grid = t[0] + size * np.arange(int((t[-1] - t[0]) / size + 1e-6) + 1)
            # a sample of the grid is bridged where either neighbour is, or both enclose a gap
            right = np.clip(np.searchsorted(t, grid - 1e-9 * size), 1, t.size - 1)
            between = (grid < t[right] - 1e-6 * size) & (grid > t[right - 1] + 1e-6 * size)
            bridged = bridged[right] | bridged[right - 1] | (np.isin(right + first, cuts) & between)
        samples = {
            name: channels[name][first:after]
            if grid is t and not mask.any()
            else np.interp(grid, time[~mask], channels[name][~mask])
            for name, mask in missing.items()
        }
        pitch = 1.0 if step is None else step  # without time, samples are numbered
        begin = start + pitch * first if times is None else times.seconds(t[0])
        marked = begin + pitch * (true_runs(bridged) - [0, 1])
        result.append(Piece(samples, step, float(begin), marked.tolist()))
    return result


def _missing(channels: Channels, source: Source) -> dict[str, Mask]:
    """Return which samples are missing in the channels used; raise an error as the policy requires."""
    found: dict[str, Mask] = {}
    for name, samples in channels.items():
        missing = ~np.isfinite(samples)
        n, inside = int(missing.sum()), _within(missing)
        bridged = source.request.gaps == "interpolate" and inside.sum() == n
        if n and not (bridged or source.request.needs(name)):
            source.warn(f"channel {name!r} is left out: {n} of its samples are missing")
            continue
        if n == missing.size:
            remedy = f"name a column that holds numbers with `columns[{name}]=COLUMN`"
            raise source.error("all of its samples are missing", remedy, name, 0)
        if inside.any() and source.request.gaps == "error":
            problem = f"{inside.sum()} of {missing.size} samples are missing or not finite"
            remedy = "use `raw` where they are numbers that were measured"
            raise source.error(problem, remedy, name, int(np.argmax(inside)), GAPS_BRIDGED)
        found[name] = missing
    if not found:
        problem = "every column has samples missing"
        raise source.error(problem, options=GAPS_BRIDGED)
    return found


def _within(missing: Mask) -> Mask:
    """Return which missing samples have others before and after them."""
    before = np.logical_or.accumulate(~missing)
    after = np.logical_or.accumulate(~missing[::-1])[::-1]
    return missing & before & after


def _enclosed(missing: dict[str, Mask], source: Source) -> Mask:
    """Return where every channel has samples before and after, with a note on interpolation."""
    inside = np.logical_and.reduce([~mask | _within(mask) for mask in missing.values()])
    for name, mask in missing.items():
        if n := (mask & inside).sum():
            source.warn(f"channel {name!r}: {n} missing sample(s) were interpolated")
    if not inside.all():
        source.warn(
            f"{inside.argmax()} row(s) at the start and {inside[::-1].argmax()} at the end were cut "
            "off, where samples are missing and there is nothing to interpolate from"
        )
    return inside


def _judge_gaps(cuts: Rows, times: Times, source: Source) -> None:
    """Raise an error for gaps in time, or note that they are bridged."""
    lengths = convert(times.values[cuts] - times.values[cuts - 1], times.unit, "s")
    total = f"{len(cuts)} gap{'s' * (len(cuts) > 1)} in time, {lengths.sum():.6g} s in all"
    if source.request.gaps == "error":
        problem = f"there is a gap of {lengths[0]:.6g} s before this row ({total})"
        raise source.error(problem, "", "time", int(cuts[0]), GAPS_BRIDGED)
    source.warn(f"bridged by straight lines: {total}")


def _judged_step(
    size: float, jitter: tuple[float, float] | None, times: Times, source: Source
) -> float:
    """Return the step in seconds; raise an error for a doubtful unit, and note jitter."""
    seconds = times.seconds(size)
    if seconds > 5.0 and not times.certain:
        raise timebase.doubtful_unit(f"its steps are {seconds:.6g} s", times.values, source)
    if jitter is not None:
        rms, worst = (f"{times.seconds(x):.3g} s ({100 * x / size:.3g} %)" for x in jitter)
        source.warn(
            f"the time is not uniform: its steps deviate from {seconds:.6g} s by {rms} rms and "
            f"{worst} at worst; the samples were interpolated onto a uniform grid"
        )
    return seconds


def _long_enough(spans: timebase.Spans, source: Source) -> timebase.Spans:
    """Return the spans of sufficient length."""
    fewest = FEWEST_SAMPLES if len(spans) > 1 else source.request.fewest
    long = spans[spans[:, 1] - spans[:, 0] >= fewest]
    if not long.size:
        raise source.error(
            f"no stretch without gaps has {fewest} samples",
            "give a recording with fewer gaps",
            options=[{"gaps": "interpolate"}],
        )
    if len(long) < len(spans):
        rows = [f"{source.table.row(first)}" for first in np.setdiff1d(spans[:, 0], long[:, 0])]
        source.warn(
            f"{len(rows)} of {len(spans)} stretches between gaps have fewer than {fewest} samples and "
            f"were left out: they begin in row {listed(rows)}"
        )
    return long
