"""Samples that are missing: blank cells, NaN and infinities."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.notices import warn
from mckibben.files.request import Request
from mckibben.files.table import Table
from mckibben.files.timebase import Span

Channels = dict[str, Array]


def treat(
    channels: Channels, time: Array, table: Table, request: Request, path: Path
) -> tuple[Channels, list[Span]]:
    """Return channels, and the spans of them that are whole, by the caller's policy for gaps.

    Raises
    ------
    DataError
        If a sample is missing that is needed, and the policy is to refuse; or none is left.
    """
    holes = {name: ~np.isfinite(samples) for name, samples in channels.items()}
    for name, missing in holes.items():
        if not missing.any():
            continue
        if missing.all() and request.needs(name):
            raise DataError(
                "all of its samples are missing",
                file=path,
                channel=name,
                row=table.row(0),
                remedy=f"name a column that holds numbers with --column {name}=COLUMN",
            )
        if not request.needs(name):
            warn(path, f"channel {name!r} is left out: {missing.sum()} of its samples are missing")
        elif request.gaps == "error":
            raise DataError(
                f"{missing.sum()} of {missing.size} samples are missing or not finite",
                file=path,
                channel=name,
                row=table.row(int(np.argmax(missing))),
                remedy="say --gaps interpolate to bridge them or --gaps split to cut them out",
            )
    whole = {name: channels[name] for name in channels if not holes[name].any()}
    mended = {name: holes[name] for name in channels if holes[name].any() and request.needs(name)}
    kept = {name: samples for name, samples in channels.items() if name in whole or name in mended}
    if not kept:
        raise DataError(
            "every column has samples missing", file=path, remedy="say --gaps interpolate or split"
        )
    if not mended:
        return kept, [(0, time.size)]
    if request.gaps == "split":
        return kept, _runs(~np.logical_or.reduce(list(mended.values())))
    start = max(int(np.argmin(missing)) for missing in mended.values())
    stop = min(missing.size - int(np.argmin(missing[::-1])) for missing in mended.values())
    for name, missing in mended.items():
        inside = int(missing[start:stop].sum())
        kept[name] = np.interp(time, time[~missing], channels[name][~missing])
        warn(path, f"channel {name!r}: {inside} missing sample(s) were interpolated")
    if start > 0 or stop < time.size:
        warn(
            path,
            f"{start} row(s) at the start and {time.size - stop} at the end were cut off, "
            "where samples are missing and there is nothing to interpolate from",
        )
    return kept, [(start, stop)]


def _runs(kept: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[Span]:
    """Return the spans of consecutive samples that are kept."""
    edges = np.flatnonzero(np.diff(kept.astype(np.int8), prepend=0, append=0))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]
