"""Channels that were sampled at times of their own, put on one clock: that of the slowest asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.headers import unit_of
from mckibben.files.notices import warn
from mckibben.files.request import Request
from mckibben.files.table import Column
from mckibben.files.timebase import GAP


def on_one(
    named: Mapping[str, Column], request: Request, path: Path
) -> tuple[dict[str, Column], list[str]]:
    """Return columns of one length, with one of times, and the headers of those left out.

    Between its samples a column is linear, or holds the last where it is one of counts; where it has a
    gap, or another one needed has not begun or is over, samples are missing. Columns that were sampled
    together stand as they are.

    Raises
    ------
    DataError
        If times go back, or those of columns that are needed have nothing in common.
    """
    if all(column.times is None for column in named.values()):
        return dict(named), []
    clocked = {
        name: column
        for name, column in named.items()
        if column.times is not None and column.times.size > 1
    }
    needed = _needed(clocked, request)
    if not needed:
        raise DataError(
            "no channel in it has two samples", file=path, remedy="give a longer recording"
        )
    for name, column in needed.items():
        _check(name, _times(column), path)
    steps = {name: float(np.median(np.diff(_times(column)))) for name, column in needed.items()}
    slowest = max(steps, key=lambda name: steps[name])
    grid = _grid(needed, slowest, request, path)
    if any(not np.array_equal(_times(column), grid) for column in needed.values()):
        rates = ", ".join(f"{name} {1 / step:.4g}" for name, step in list(steps.items())[:10])
        whose = f"times of {slowest!r}" if request.rate is None else f"{request.rate:g} a second"
        warn(
            path,
            f"channels have times of their own (samples a second: {rates}); they were put on the "
            f"{whose}, by interpolation",
        )
    columns: dict[str, Column] = {"time": Column("time", grid, "s")}
    left_out: list[str] = []
    for name, column in named.items():
        if column.times is None and name != "time" and column.values is not None:
            values = np.full(grid.size, column.values[0])  # a constant that the folder describes
            columns[name] = replace(column, values=values)
        elif name in clocked and (name in needed or _spans(column, grid)):
            columns[name] = replace(column, values=_at(column, grid), times=None)
        else:
            left_out.append(column.header)
    return columns, left_out


def _times(column: Column) -> Array:
    assert column.times is not None
    return column.times


def _needed(clocked: Mapping[str, Column], request: Request) -> dict[str, Column]:
    """Return what the common clock must suit: what is asked for, or else what has a meaning, or all.

    A temperature that nobody asks for does not slow the rest down.
    """
    told = {*request.columns, *request.described.channels}
    asked = {name: column for name, column in clocked.items() if request.asks_for(name)}
    known = {
        name: column
        for name, column in clocked.items()
        if name in told or unit_of(name) not in (None, "degC")
    }
    return asked or known or dict(clocked)


def _check(name: str, times: Array, path: Path) -> None:
    wrong = np.flatnonzero(~(np.diff(times) > 0))
    if wrong.size:
        at = int(wrong[0])
        raise DataError(
            f"its time goes from {times[at]:.10g} s to {times[at + 1]:.10g} s",
            file=path,
            channel=name,
            row=at + 2,
            remedy="sort its samples by time, and keep one for each instant",
        )


def _grid(needed: Mapping[str, Column], slowest: str, request: Request, path: Path) -> Array:
    start = max(float(_times(column)[0]) for column in needed.values())
    stop = min(float(_times(column)[-1]) for column in needed.values())
    if request.rate is None:
        times = _times(needed[slowest])
        grid = times[(times >= start) & (times <= stop)]
    else:
        grid = (
            start + np.arange(max(0, int((stop - start) * request.rate + 1e-6) + 1)) / request.rate
        )
    if grid.size < 2:
        spans = "; ".join(
            f"{name} from {_times(column)[0]:.6g} to {_times(column)[-1]:.6g} s"
            for name, column in list(needed.items())[:10]
        )
        raise DataError(
            f"its channels have no time in common: {spans}",
            file=path,
            channel=slowest,
            remedy="record them together, or name other columns with --column CHANNEL=COLUMN",
        )
    return grid


def _spans(column: Column, grid: Array) -> bool:
    times = _times(column)
    return bool(times[0] <= grid[0] and times[-1] >= grid[-1] and np.all(np.diff(times) > 0))


def _at(column: Column, grid: Array) -> Array:
    """Return a column at other times, NaN where it has none."""
    times = _times(column)
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
    inside = (steps[before] > widest) & (grid > times[before])
    found[inside] = np.nan
    return found
