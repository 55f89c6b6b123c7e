"""From samples that are missing and times with gaps to pieces on one uniform grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.files import timebase
from mckibben.files.converting import UNIT_OF_TIME, Times
from mckibben.files.notices import listed
from mckibben.files.quality import Mask, runs
from mckibben.files.request import FEWEST, Source
from mckibben.files.timebase import Span

Channels = dict[str, Array]

LONGEST_BRIDGE = 100
"""Most samples to which gaps are interpolated, over those there are."""

LONGEST_STEP = 5.0
"""Longest sample time [s] that is believed of times without a certain unit."""


@dataclass(frozen=True)
class Piece:
    """Samples on a uniform grid: the step [s], None without time, the start [s], and what is bridged."""

    samples: Channels
    step: float | None
    start: float
    bridged: Mask

    @property
    def meta(self) -> dict[str, Any]:
        """The first and last times of bridged samples, as ``meta`` lists them."""
        times = self.start + (self.step or 1.0) * (runs(self.bridged) - [0, 1])
        return {"bridged": times.tolist()} if times.size else {}


def pieces(
    channels: Channels, times: Times | None, step: float | None, start: float, source: Source
) -> list[Piece]:
    """Return the stretches of channels without gaps, or all with gaps bridged, on one uniform grid.

    Parameters
    ----------
    channels : dict
        Samples, NaN where they are missing; those that are not needed are then left out.
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
    channels = {name: samples for name, samples in channels.items() if name in missing}
    order = np.arange(next(iter(channels.values())).size, dtype=float)
    time = order if times is None else times.values
    holes = np.logical_or.reduce(list(missing.values()))
    spans: list[Span] = [(0, time.size)]
    if not holes.any():
        pass
    elif source.request.gaps == "split":
        spans = [(int(first), int(last)) for first, last in runs(~holes)]
        holes = np.zeros_like(holes)
    else:
        channels, span = _interpolated(channels, missing, time, source)
        spans = [span]
    if times is not None:
        return _on_grid(channels, times, spans, holes, source)
    return [
        Piece(_cut(channels, span), step, start + (step or 1.0) * span[0], holes[slice(*span)])
        for span in _long_enough(spans, source)
    ]


def _missing(channels: Channels, source: Source) -> dict[str, Mask]:
    """Return which samples are missing in the channels that are used; refuse them by the policy."""
    found: dict[str, Mask] = {}
    for name, samples in channels.items():
        missing = ~np.isfinite(samples)
        n = int(missing.sum())
        if n and not source.request.needs(name):
            source.warn(f"channel {name!r} is left out: {n} of its samples are missing")
            continue
        if n == missing.size:
            remedy = f"name a column that holds numbers with --column {name}=COLUMN"
            raise source.error("all of its samples are missing", remedy, name, 0)
        if n and source.request.gaps == "error":
            problem = f"{n} of {missing.size} samples are missing or not finite"
            remedy = "use --gaps interpolate to bridge them or --gaps split to cut them out"
            raise source.error(problem, remedy, name, int(np.argmax(missing)))
        found[name] = missing
    if not found:
        problem = "every column has samples missing"
        raise source.error(problem, "use --gaps interpolate or split")
    return found


def _interpolated(
    channels: Channels, missing: dict[str, Mask], time: Array, source: Source
) -> tuple[Channels, Span]:
    """Return channels with missing samples interpolated, and the span in which that is possible."""
    inside = [np.flatnonzero(~mask)[[0, -1]] for mask in missing.values()]
    start, stop = int(max(first for first, _ in inside)), int(min(last for _, last in inside)) + 1
    channels = dict(channels)
    for name, mask in missing.items():
        if mask.any():
            channels[name] = np.interp(time, time[~mask], channels[name][~mask])
            n = mask[start:stop].sum()
            source.warn(f"channel {name!r}: {n} missing sample(s) were interpolated")
    if start > 0 or stop < time.size:
        source.warn(
            f"{start} row(s) at the start and {time.size - stop} at the end were cut off, "
            "where samples are missing and there is nothing to interpolate from"
        )
    return channels, (start, stop)


def _on_grid(
    channels: Channels, times: Times, spans: list[Span], holes: Mask, source: Source
) -> list[Piece]:
    """Return the spans on one grid: as they are where times are uniform, else resampled."""
    time = times.values
    cuts = [int(at) for at in timebase.gaps(time) if any(a < at < b for a, b in spans)]
    lengths = [times.seconds(time[at] - time[at - 1]) for at in cuts]
    total = sum(lengths)
    if cuts and source.request.gaps == "error":
        others = f" ({len(cuts)} gaps in all, together {total:.3g} s)" if len(cuts) > 1 else ""
        raise source.error(
            f"there is a gap of {lengths[0]:.6g} s before this row{others}",
            "use --gaps split to cut there or --gaps interpolate to bridge them",
            "time",
            cuts[0],
        )
    if source.request.gaps == "split":
        spans, cuts = _split(spans, cuts), []
    spans = _long_enough(spans, source)
    step = timebase.common_step(time, _split(spans, cuts))
    seconds = times.seconds(step.size)
    if seconds > LONGEST_STEP and not times.certain:
        problem = f"its steps are {seconds:.6g} s: is time in ms?"
        raise source.error(problem, UNIT_OF_TIME, "time", 0)
    if step.jitter is not None:
        rms, worst = (times.seconds(deviation) for deviation in step.jitter)
        source.warn(
            f"the time is not uniform: its steps deviate from {seconds:.6g} s by {rms:.3g} s rms "
            f"({100 * rms / seconds:.3g} %) and {worst:.3g} s at worst "
            f"({100 * worst / seconds:.3g} %); the samples were interpolated onto a uniform grid"
        )
    if cuts:
        gaps = f"{len(cuts)} gap(s)"
        if (time[-1] - time[0]) / step.size > LONGEST_BRIDGE * time.size:
            problem = f"{gaps} of {total:.6g} s in all are too long to interpolate over"
            raise source.error(problem, "use --gaps split", "time")
        source.warn(f"{gaps} in time, {total:.6g} s in all, were interpolated over")
    found = []
    for start, stop in spans:
        samples, t, bridged = _cut(channels, (start, stop)), time[start:stop], holes[start:stop]
        if cuts or step.jitter is not None:
            grid = timebase.grid(t, step.size)
            samples = {name: np.interp(grid, t, values) for name, values in samples.items()}
            # a sample of the grid is bridged where either neighbour is, or both enclose a gap
            after = np.clip(np.searchsorted(t, grid - 1e-9 * step.size), 1, t.size - 1)
            gap = np.isin(after + start, cuts) & (grid < t[after] - 1e-6 * step.size)
            gap &= grid > t[after - 1] + 1e-6 * step.size
            bridged = bridged[after] | bridged[after - 1] | gap
        found.append(Piece(samples, seconds, times.seconds(t[0]), bridged))
    return found


def _long_enough(spans: list[Span], source: Source) -> list[Span]:
    """Return the spans that are not too short to be of use."""
    fewest = FEWEST if len(spans) > 1 else source.request.fewest
    long = [span for span in spans if span[1] - span[0] >= fewest]
    if not long:
        raise source.error(
            f"no stretch without gaps has {fewest} samples",
            "use --gaps interpolate, or give a recording with fewer gaps",
        )
    if len(long) < len(spans):
        rows = [f"{source.table.row(start)}" for start, stop in spans if stop - start < fewest]
        source.warn(
            f"{len(rows)} of {len(spans)} stretches between gaps have fewer than {fewest} samples and "
            f"were left out: they begin in row {listed(rows)}"
        )
    return long


def _split(spans: list[Span], cuts: Sequence[int]) -> list[Span]:
    ends = [[start, *(at for at in cuts if start < at < stop), stop] for start, stop in spans]
    return [pair for edges in ends for pair in pairwise(edges)]


def _cut(channels: Channels, span: Span) -> Channels:
    return {name: samples[slice(*span)] for name, samples in channels.items()}
