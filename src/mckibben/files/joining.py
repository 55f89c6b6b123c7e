"""Recordings of one run: pieces one after the other, or the channels of several loggers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise, permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.channels import by_name
from mckibben.errors import DataError
from mckibben.files.clocks import on_one, rates
from mckibben.files.headers import unit_of
from mckibben.files.instants import moment
from mckibben.files.notices import listed, warn
from mckibben.files.request import GAPS_BRIDGED, Request, Source
from mckibben.files.table import Column, Table
from mckibben.files.timebase import AT_ONE_MOMENT, YEARS_2001_TO_2049, begun
from mckibben.recording import SAME_TIME, Recording

MEETS = 0.02
"""Largest difference of two ends that meet, as a share of a channel's range, beside some steps."""

STEPS_BETWEEN = 3.0
"""The same in median steps of the channel; and the longest gap of pieces in sample times."""

MOST_PAIRED = 20
"""Recordings of which all pairs are compared."""

LEAST_RETURN = 0.2
"""Smallest distance between both ends of a piece, as a share of its range: a run from rest to rest is
whole.
"""


def joined(recordings: Sequence[Recording], request: Request) -> Recording:
    """Return one recording of the pieces of a run, or of the channels of several loggers.

    Pieces have the same channels, and follow each other by their times, or else as given. Channels of
    loggers are put on the times of the slowest; these begin at the dates of the files if all state
    one, or else at their first times. Columns of several that are no standard channels, such as counts
    of rows, are left out.

    Raises
    ------
    DataError
        If recordings share some channels only, pieces differ in sample time or overlap, or loggers
        have no time in common.
    """
    joint = _joined(recordings, request)
    stated = {*request.columns, *request.units, *request.calibration, *(request.channels or ())}
    if missing := sorted(stated - {*joint, "time"}):
        problem = f"it is in none of the files; there are {', '.join(joint)}"
        remedy = f"name its column with `columns[{missing[0]}]=COLUMN`"
        raise DataError(problem, file=joint.source, channel=missing[0], remedy=remedy)
    return joint


def _joined(recordings: Sequence[Recording], request: Request) -> Recording:
    if len(recordings) < 2:
        return recordings[0]
    names = [set(run.channels) for run in recordings]
    if all(some == names[0] for some in names):
        return _in_sequence(_in_order(_on_one_clock(recordings)), request)
    twice = {name for k, own in enumerate(names) for other in names[:k] for name in own & other}
    shared = sorted(name for name in twice if unit_of(name) is not None or name in request.columns)
    if shared:
        problem = "it is in several files, but not in all of them"
        remedy = "join pieces with the same channels, or loggers with different ones"
        raise DataError(problem, file=recordings[0].source, channel=shared[0], remedy=remedy)
    unshared = [run.select([name for name in run if name not in twice]) for run in recordings]
    if any(_moment(run) is None for run in unshared):
        warn(_path(unshared), AT_ONE_MOMENT)
    return _side_by_side(_on_one_clock(unshared), request)


class _Extent(NamedTuple):
    """First and last sample of a channel, its range, and its usual step."""

    first: float
    last: float
    low: float
    high: float
    step: float


def _extents(recording: Recording) -> dict[str, _Extent]:
    return {
        name: _Extent(x[0], x[-1], x.min(), x.max(), float(np.median(np.abs(np.diff(x)))))
        for name, x in recording.channels.items()
    }


def _meet(
    before: Mapping[str, _Extent], after: Mapping[str, _Extent], drives: Sequence[str]
) -> bool:
    """Return whether channels begin where others end, away from where a drive of these began."""
    meets = True
    for name, old in before.items():
        new = after[name]
        width = max(old.high, new.high) - min(old.low, new.low)
        if abs(new.first - old.last) > MEETS * width + STEPS_BETWEEN * old.step:
            return False
        meets &= name not in drives or abs(old.last - old.first) < LEAST_RETURN * width
    return not meets


def continued(recordings: Sequence[Recording]) -> Iterator[tuple[Recording, str]]:
    """Yield recordings of several files that may be one run with another, and why."""
    if len({run.source for run in recordings}) < 2:
        return
    extents = [(run, _extents(run), by_name([run])[0]) for run in recordings]
    pairs = permutations(extents, 2) if len(extents) <= MOST_PAIRED else pairwise(extents)
    for (before, ends, drives), (after, starts, _) in pairs:
        if before.source == after.source or list(ends) != list(starts):
            continue
        if _same_step(before, after) and (_follows(before, after) or _meet(ends, starts, drives)):
            yield after, f"it begins where {before.name} ends; if both are one run, use `join`"
    names = [{name for name in run if unit_of(name)} for run in recordings]
    if len(names) == 2 and all(names) and not names[0] & names[1]:
        yield recordings[1], "its channels are others; if it is of the same run, use `join`"


def _path(recordings: Sequence[Recording]) -> Path:
    return Path(recordings[0].source or recordings[0].name)


def _same_step(one: Recording, other: Recording) -> bool:
    if one.sample_time is None or other.sample_time is None:
        return one.sample_time is other.sample_time
    return abs(one.sample_time - other.sample_time) <= SAME_TIME * one.sample_time


def _follows(before: Recording, after: Recording) -> bool:
    """Return whether the times go on from one recording to another."""
    if before.sample_time is None:
        return False
    gap = after.start_time - before.time[-1]
    return 0.0 < gap <= STEPS_BETWEEN * before.sample_time


def _on_one_clock(recordings: Sequence[Recording]) -> list[Recording]:
    """Return recordings whose start times are from one moment, if all are known to be."""
    starts = begun([_moment(run) for run in recordings])
    if starts is None:
        return list(recordings)
    unknown = all(_moment(run) is None for run in recordings)
    pairs = zip(recordings, starts, strict=True)
    return list(recordings) if unknown else [_starting(run, start) for run, start in pairs]


def _moment(recording: Recording) -> float | None:
    """Return when a recording began [s], since 1970 or, without a date, midnight; None if unknown."""
    began, start = recording.meta.get("began"), recording.start_time
    if isinstance(began, str):
        return moment(began) + start
    return start if start > YEARS_2001_TO_2049[0] else None


def _starting(recording: Recording, start: float) -> Recording:
    samples, units = dict(recording.channels), dict(recording.units)
    return Recording(samples, recording.sample_time, units, start, recording.meta)


def _in_order(recordings: Sequence[Recording]) -> list[Recording]:
    """Return pieces in the order of their times; as given where these overlap."""
    by_time = sorted(recordings, key=lambda run: run.start_time)
    is_ordered = all(before.time[-1] < after.time[0] for before, after in pairwise(by_time))
    return by_time if is_ordered else list(recordings)


def _in_sequence(pieces: list[Recording], request: Request) -> Recording:
    first = pieces[0]
    for piece in pieces[1:]:
        if not _same_step(first, piece):
            problem = (
                f"it has {piece.step:g} s between samples, and {first.source} has {first.step:g} s"
            )
            remedy = "resample them first, with `resample`"
            raise DataError(problem, file=piece.source, remedy=remedy)
    times = np.concatenate([piece.time for piece in pieces])
    alike = all(
        piece.start_time <= first.start_time + STEPS_BETWEEN * first.step for piece in pieces
    )
    if not alike and np.any(np.diff(times) <= 0):
        problem = "its pieces overlap in time"
        raise DataError(problem, file=first.source, remedy="leave out what is there twice")
    if first.sample_time is None or np.any(np.diff(times) <= 0):  # each counts from its own start
        text = f"{len(pieces)} pieces without common times are one after the other, as given"
        warn(_path(pieces), text)
        return _together(first, pieces, {n: _end_to_end(pieces, n) for n in first.channels})
    steps = np.diff(times)
    gap_at = int(np.argmax(steps))
    if steps[gap_at] > STEPS_BETWEEN * first.step and request.gaps != "interpolate":
        problem = (
            f"there is a gap of {steps[gap_at]:.6g} s between the pieces, at {times[gap_at]:.6g} s"
        )
        remedy = "join fewer of them"
        raise DataError(problem, remedy=remedy, options=GAPS_BRIDGED[:1], file=first.source)
    grid = first.start_time + first.step * np.arange(round((times[-1] - times[0]) / first.step) + 1)
    samples = {n: np.interp(grid, times, _end_to_end(pieces, n)) for n in first.channels}
    joint = _together(first, pieces, samples)
    wide = np.flatnonzero(steps > STEPS_BETWEEN * first.step)
    if not wide.size:
        return joint
    bridged = [[float(times[k]), float(times[k + 1])] for k in wide]
    return joint.with_meta(bridged=[*joint.meta.get("bridged", []), *bridged])


def _end_to_end(pieces: Sequence[Recording], name: str) -> Array:
    return np.concatenate([piece[name] for piece in pieces])


def _side_by_side(loggers: list[Recording], request: Request) -> Recording:
    columns: dict[str, Column] = {}
    for one in loggers:
        if one.sample_time is None:
            remedy = "state its rate, or save a column of times"
            raise DataError("it has no time", file=one.source, remedy=remedy)
        for name, values in one.channels.items():
            columns[name] = Column(name, values, one.units[name], times=one.time)
    request = replace(request, channels=list(columns))
    source = Source(Table(tuple(columns.values())), request, _path(loggers))
    resampled, _ = on_one(columns, source)
    samples = {
        name: column.values for name, column in resampled.items() if column.values is not None
    }
    start = float(samples.pop("time")[0])
    slowest = max(loggers, key=lambda one: one.step)
    step = slowest.step if request.step is None else request.step
    units = {name: unit for one in loggers for name, unit in one.units.items() if name in samples}
    joint = Recording(samples, step, units, start, slowest.meta)
    return _together(joint, loggers, samples).with_meta(sampled=rates(columns))


def _together(
    first: Recording, several: Sequence[Recording], samples: dict[str, Array]
) -> Recording:
    """Return a recording of joined samples, with the notes and the names of all files."""
    meta = {**first.meta, "joined": [part.source or part.name for part in several]}
    meta["notes"] = [*dict.fromkeys(note for part in several for note in part.notes)]
    meta["name"] = listed([part.name for part in several], 3)
    for key in ("converted_units", "assumed_units", "ignored_columns", "bridged"):
        if values := [value for part in several for value in part.meta.get(key, ())]:
            meta[key] = values if key == "bridged" else [*dict.fromkeys(values)]
    units = {name: first.units[name] for name in samples}
    return Recording(samples, first.sample_time, units, first.start_time, meta)
