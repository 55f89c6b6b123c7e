"""Channels that were not sampled together: found, and put on the times of the slowest requested one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array, Rows
from mckibben.files.headers import names_channel, parse, unit_of
from mckibben.files.request import Source
from mckibben.files.table import Column
from mckibben.files.timebase import GAP
from mckibben.files.units import find
from mckibben.recording import base_name

FEWEST_RENEWALS = 20
"""Changes of a channel by which the rate at which it is renewed is recognised."""

REGULAR = 0.9
"""Share of the changes of a channel that are on a grid of its own, at least."""

WAYS, PULLS = ("mm", "rad", ""), ("N", "N*m")
"""Units of what muscles move, and of what they pull."""

FOLLOWS = 0.5
"""Correlation of the changes of a slow sensor and of a drive, at least."""

CAUSES = ("pressure", "voltage", "command")
"""Quantities that drive muscles."""

SET = ("voltage", "command", "reference")
"""Quantities that are set from outside: they hold until they are set anew."""

DRIVES = {*CAUSES, *SET}
"""Quantities that may jump."""


def apart(named: Mapping[str, Column], time: Array) -> tuple[dict[str, Column], dict[str, float]]:
    """Return columns with times of their own where not all were sampled in every row.

    Either rows are messages, most of which lack a channel; or an output keeps its value for several
    rows while the drive changes, as a slow sensor in the file of a fast logger.

    Parameters
    ----------
    named : mapping of str to Column
        Of one length.
    time : ndarray, shape (n,)
        Times of the rows [s], increasing, but rows of different channels may have the same.

    Returns
    -------
    named : dict of str to Column
    renewed : dict of str to float
        Channel -> the rows after which it is renewed, of the second kind.
    """
    numbers = {
        name: column.values
        for name, column in named.items()
        if column.values is not None and column.flaw is None
    }
    present = {name: np.isfinite(values) for name, values in numbers.items()}
    present = {name: mask for name, mask in present.items() if mask.any()}
    renewed: dict[str, float] = {}
    if present and np.logical_and.reduce(list(present.values())).mean() < 0.5:
        rows = {name: np.flatnonzero(mask) for name, mask in present.items()}
    else:
        drives = [values for name, values in numbers.items() if base_name(name) in CAUSES]
        outputs = {name: x for name, x in numbers.items() if _is_output(name, named[name])}
        renewals = {name: _renewals(x, drives) for name, x in outputs.items()}
        rows = {name: at for name, at in renewals.items() if at is not None}
        renewed = {name: time.size / at.size for name, at in rows.items()}
    if not rows:
        return dict(named), {}
    columns = dict(named)
    for name, values in numbers.items():
        at = rows.get(name, np.arange(time.size))
        is_held = columns[name].held or base_name(name) in SET
        columns[name] = replace(columns[name], values=values[at], times=time[at], held=is_held)
    return columns, renewed


def _is_output(name: str, column: Column) -> bool:
    """Return whether a column is a length, an angle, a force or a torque, by name or by unit."""
    if base_name(name) in SET:
        return False
    unit = find(column.unit or parse(column.label).unit or "")
    return bool({unit_of(name), unit and unit.target} & {"mm", "rad", *PULLS})


def _renewals(values: Array, drives: Sequence[Array]) -> Rows | None:
    """Return the rows in which a slow sensor was read, or None for one that was read in every row.

    Its changes are on a grid of more than one row, unlike each other in size, as those of a coarse
    one are not; and a drive, with which it changes, changes as much in the rows between.
    """
    steps = np.diff(values)
    changes = np.flatnonzero(steps) + 1
    if changes.size < FEWEST_RENEWALS:
        return None
    sizes, gaps = np.abs(steps[changes - 1]), np.diff(changes)
    pitch = float(gaps[gaps <= 1.5 * np.median(gaps)].mean())
    missed = np.maximum(1.0, np.rint(gaps / pitch))
    on_grid = np.abs(gaps - pitch * missed) < min(1.0, 0.25 * pitch)
    coarse = np.median(sizes) < 1.5 * np.quantile(sizes, 0.05)
    if pitch < 1.5 or np.mean(on_grid) < REGULAR or coarse:
        return None
    count = np.append(0.0, np.cumsum(missed))
    inside = np.interp(np.arange(count[-1] + 1), count, changes)
    before = changes[0] - pitch * np.arange(int(changes[0] / pitch), 0, -1)
    after = changes[-1] + pitch * np.arange(1, int((values.size - 1 - changes[-1]) / pitch) + 1)
    rows: Rows = np.rint(np.concatenate([before, inside, after])).astype(np.intp)
    return rows if any(_moves_between(values, drive, rows) for drive in drives) else None


def _moves_between(values: Array, drive: Array, rows: Rows) -> bool:
    """Return whether a drive moves steadily between rows in which a signal is renewed, and with it."""
    steps, within = np.diff(drive[rows]), drive[rows[1:] - 1] - drive[rows[:-1]]
    share = 1.0 - 1.0 / np.mean(np.diff(rows))
    is_large = np.abs(steps) >= np.quantile(np.abs(steps), 0.5)
    if not steps.any() or np.median(within[is_large] / steps[is_large]) < 0.5 * share:
        return False
    follows = np.corrcoef(np.diff(values[rows]), steps)[0, 1]
    return bool(abs(follows) > FOLLOWS)


def rates(named: Mapping[str, Column]) -> dict[str, float]:
    """Return the samples a second of columns with times of their own."""
    clocks = {n: np.diff(c.times) for n, c in named.items() if c.times is not None}
    usual = {n: steps[steps <= 1.5 * np.median(steps)] for n, steps in clocks.items() if steps.size}
    return {name: float(f"{1 / steps.mean():.4g}") for name, steps in usual.items() if steps.mean()}


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
    if not request.names_channels:
        meant |= {name for name in long if unit_of(name) is None and names_channel(name)}
    if any(unit_of(name) in WAYS for name in meant):  # then a force is a load, as a temperature is
        meant -= {name for name in meant if unit_of(name) in PULLS and not request.asks_for(name)}
    meant |= {name for name in long if request.asks_for(name)}
    meant -= {name for name, column in named.items() if column.held}
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
        stated = ", ".join(f"{name} {rate:g}" for name, rate in list(rates(named).items())[:10])
        source.warn(
            f"channels have separate times (samples a second: {stated}); they were put on the "
            f"{whose}, by interpolation"
        )
    columns: dict[str, Column] = {"time": Column("time", grid, "s")}
    left_out: list[str] = []
    for name, column in named.items():
        own_times = clocks.get(name)
        if own_times is None and column.values is not None:
            values = np.full(grid.size, column.values[0])  # a constant that the folder describes
            columns[name] = replace(column, values=values)
        elif own_times is not None and (name in needed or _spans(own_times, grid)):
            columns[name] = replace(column, values=_at(column, own_times, grid), times=None)
        else:
            left_out.append(column.header)
    return columns, left_out


def _spans(times: Array, grid: Array) -> bool:
    """Return whether increasing times cover a grid, but for one of their steps at its ends."""
    steps = np.diff(times)
    if not steps.size or steps.min() <= 0:
        return False
    step = float(np.median(steps))
    return bool(times[0] <= grid[0] + step and times[-1] >= grid[-1] - step)


def _at(column: Column, times: Array, grid: Array) -> Array:
    """Return a column at other times, NaN outside its own, but for one of its steps."""
    if column.values is None or column.flaw is not None:
        return np.full(grid.size, np.nan)
    if np.array_equal(times, grid):
        return column.values
    before = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, times.size - 1)
    if column.held:
        return np.where((grid >= times[0]) & (grid <= times[-1]), column.values[before], np.nan)
    samples: Array = np.interp(grid, times, column.values)
    steps = np.diff(times)
    step = float(np.median(steps))
    samples[(grid <= times[0] - step) | (grid >= times[-1] + step)] = np.nan
    widest = max(GAP * step, float(np.median(np.diff(grid))))
    samples[(np.append(steps, 0.0)[before] > widest) & (grid > times[before])] = np.nan
    return samples
