"""Channels with separate times, resampled to the slowest requested one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.files.headers import unit_of
from mckibben.files.request import Source
from mckibben.files.table import Column
from mckibben.files.timebase import GAP


def on_one(named: Mapping[str, Column], source: Source) -> tuple[dict[str, Column], list[str]]:
    """Return columns of one length, with a time column, and the headers of those left out.

    The grid is that of the slowest requested or standard channel; temperatures count only where they
    are requested. Other columns are interpolated linearly, and counts by the last sample. Samples are
    missing in gaps, and before a column begins and after it ends. Columns with this grid do not change.

    Raises
    ------
    DataError
        If times go back, or the needed columns have no time in common.
    """
    clocks = {name: column.times for name, column in named.items() if column.times is not None}
    if not clocks:
        return dict(named), []
    request = source.request
    long = {name: times for name, times in clocks.items() if times.size > 1}
    meant = {*request.columns, *request.described.channels}
    meant |= {name for name in long if unit_of(name) not in (None, "degC")}
    meant |= {name for name in long if request.asks_for(name)}
    needed = {name: times for name, times in long.items() if name in meant} or long
    if not needed:
        raise source.error("no channel in it has two samples", "give a longer recording")
    for name, times in needed.items():
        if (back := np.flatnonzero(~(np.diff(times) > 0))).size:
            at = int(back[0])
            problem = f"its time goes from {times[at]:.10g} s to {times[at + 1]:.10g} s"
            remedy = "sort its samples by time, and leave one for each instant"
            raise source.error(problem, remedy, name, at + 1)
    steps = {name: float(np.median(np.diff(times))) for name, times in needed.items()}
    slowest = max(steps, key=lambda name: steps[name])
    start = max(times[0] for times in needed.values())
    stop = min(times[-1] for times in needed.values())
    if request.step is None:
        whose, grid = f"times of {slowest!r}", needed[slowest]
        grid = grid[(grid >= start) & (grid <= stop)]
    else:
        rate = request.rate or 1.0 / request.step
        whose, count = f"{rate:g} a second", int((stop - start) * rate + 1e-6) + 1
        grid = start + np.arange(max(0, count)) / rate
    if grid.size < 2:
        spans = [f"{name} from {t[0]:.6g} to {t[-1]:.6g} s" for name, t in needed.items()]
        problem = f"its channels have no time in common: {'; '.join(spans[:10])}"
        remedy = "record them together, or name other columns with `columns[CHANNEL]=COLUMN`"
        raise source.error(problem, remedy, slowest)
    if any(not np.array_equal(times, grid) for times in needed.values()):
        rates = ", ".join(f"{name} {1 / step:.4g}" for name, step in list(steps.items())[:10])
        source.warn(
            f"channels have separate times (samples a second: {rates}); they were put on the "
            f"{whose}, by interpolation"
        )
    columns: dict[str, Column] = {"time": Column("time", grid, "s")}
    left_out: list[str] = []
    for name, column in named.items():
        own = clocks.get(name)
        if own is None and name != "time" and column.values is not None:
            values = np.full(grid.size, column.values[0])  # a constant that the folder describes
            columns[name] = replace(column, values=values)
        elif own is not None and (name in needed or _spans(own, grid)):
            columns[name] = replace(column, values=_at(column, own, grid), times=None)
        else:
            left_out.append(column.header)
    return columns, left_out


def _spans(times: Array, grid: Array) -> bool:
    within = times.size > 1 and times[0] <= grid[0] and times[-1] >= grid[-1]
    return bool(within and np.all(np.diff(times) > 0))


def _at(column: Column, times: Array, grid: Array) -> Array:
    """Return a column at other times, NaN outside its own."""
    if column.values is None or column.flaw is not None:
        return np.full(grid.size, np.nan)
    if np.array_equal(times, grid):
        return column.values
    before = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, times.size - 1)
    if column.held:
        return np.where((grid >= times[0]) & (grid <= times[-1]), column.values[before], np.nan)
    found: Array = np.interp(grid, times, column.values, left=np.nan, right=np.nan)
    steps = np.append(np.diff(times), 0.0)
    widest = max(GAP * float(np.median(np.diff(times))), float(np.median(np.diff(grid))))
    found[(steps[before] > widest) & (grid > times[before])] = np.nan
    return found
