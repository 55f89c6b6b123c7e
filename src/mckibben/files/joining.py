"""Recordings of one run: pieces one after the other, or the channels of several loggers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.channels import by_name
from mckibben.errors import DataError
from mckibben.files.clocks import on_one
from mckibben.files.headers import unit_of
from mckibben.files.request import GAPS_BRIDGED, Request, Source
from mckibben.files.table import Column, Table
from mckibben.recording import SAME_TIME, Recording

MEETS = 0.02
"""Largest difference of two ends that meet, as a share of a channel's range, beside some steps."""

STEPS_BETWEEN = 3.0
"""The same in median steps of the channel; and the longest gap of pieces in sample times."""

AWAY = 0.2
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
    asked = {*request.columns, *request.units, *request.calibration, *(request.channels or ())}
    if missing := sorted(asked - {*joint, "time"}):
        problem = f"it is in none of the files; there are {', '.join(joint)}"
        remedy = f"name its column with `columns[{missing[0]}]=COLUMN`"
        raise DataError(problem, file=joint.source, channel=missing[0], remedy=remedy)
    return joint


def _joined(recordings: Sequence[Recording], request: Request) -> Recording:
    if len(recordings) < 2:
        return recordings[0]
    names = [set(one.channels) for one in recordings]
    if all(some == names[0] for some in names):
        return _in_sequence(_in_order(_dated(recordings)), request)
    twice = {some for k, one in enumerate(names) for other in names[:k] for some in one & other}
    shared = sorted(name for name in twice if unit_of(name) is not None or name in request.columns)
    if shared:
        problem = "it is in several files, but not in all of them"
        remedy = "join pieces with the same channels, or loggers with different ones"
        raise DataError(problem, file=recordings[0].source, channel=shared[0], remedy=remedy)
    own = [one.select([name for name in one if name not in twice]) for one in recordings]
    return _side_by_side(_dated(own), request)


def continues(before: Recording, after: Recording) -> bool:
    """Return whether a recording begins where another ends, away from where that began."""
    if list(before.channels) != list(after.channels) or not _same_step(before, after):
        return False
    if _follows(before, after):
        return True
    drives = by_name([before])[0]
    whole = True
    for name, samples in before.channels.items():
        width = float(np.ptp(np.concatenate([samples, after[name]])))
        near = MEETS * width + STEPS_BETWEEN * float(np.median(np.abs(np.diff(samples))))
        if abs(after[name][0] - samples[-1]) > near:
            return False
        whole &= name not in drives or abs(samples[-1] - samples[0]) < AWAY * width
    return not whole


def pieces_of_one(recordings: Sequence[Recording]) -> list[tuple[Recording, Recording]]:
    """Return the pairs of successive recordings of which one continues the other."""
    return [(one, other) for one, other in pairwise(recordings) if continues(one, other)]


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


def _dated(recordings: Sequence[Recording]) -> list[Recording]:
    """Return recordings whose start times are from the first date, if all state one."""
    import pandas as pd

    dates = [one.meta.get("began") for one in recordings]
    if not all(dates):
        return list(recordings)
    instants = [pd.Timestamp(str(date)) for date in dates]
    first = min(instants)
    return [
        _starting(one, (instant - first).total_seconds())
        for one, instant in zip(recordings, instants, strict=True)
    ]


def _starting(recording: Recording, start: float) -> Recording:
    samples, units = dict(recording.channels), dict(recording.units)
    return Recording(samples, recording.sample_time, units, start, recording.meta)


def _in_order(recordings: Sequence[Recording]) -> list[Recording]:
    """Return pieces in the order of their times; as given where these overlap."""
    by_time = sorted(recordings, key=lambda one: one.start_time)
    apart = all(before.time[-1] < after.time[0] for before, after in pairwise(by_time))
    return by_time if apart else list(recordings)


def _in_sequence(pieces: list[Recording], request: Request) -> Recording:
    first = pieces[0]
    for one in pieces[1:]:
        if not _same_step(first, one):
            problem = (
                f"it has {one.step:g} s between samples, and {first.source} has {first.step:g} s"
            )
            remedy = "resample them first, with `resample`"
            raise DataError(problem, file=one.source, remedy=remedy)
    times = np.concatenate([one.time for one in pieces])
    if first.sample_time is None or np.any(np.diff(times) <= 0):  # each counts from its own start
        return _together(first, pieces, {n: _end_to_end(pieces, n) for n in first.channels})
    steps = np.diff(times)
    at = int(np.argmax(steps))
    if steps[at] > STEPS_BETWEEN * first.step and request.gaps != "interpolate":
        problem = f"there is a gap of {steps[at]:.6g} s between the pieces, at {times[at]:.6g} s"
        raise DataError(problem, file=first.source, options=GAPS_BRIDGED[:1])
    grid = first.start_time + first.step * np.arange(round((times[-1] - times[0]) / first.step) + 1)
    samples = {n: np.interp(grid, times, _end_to_end(pieces, n)) for n in first.channels}
    return _together(first, pieces, samples)


def _end_to_end(pieces: Sequence[Recording], name: str) -> Array:
    return np.concatenate([one[name] for one in pieces])


def _side_by_side(loggers: list[Recording], request: Request) -> Recording:
    columns: dict[str, Column] = {}
    for one in loggers:
        if one.sample_time is None:
            remedy = "state its rate, or save a column of times"
            raise DataError("it has no time", file=one.source, remedy=remedy)
        for name, values in one.channels.items():
            columns[name] = Column(name, values, one.units[name], times=one.time)
    request = replace(request, channels=list(columns))
    source = Source(
        Table(tuple(columns.values())), request, Path(loggers[0].source or "recordings")
    )
    found, _ = on_one(columns, source)
    samples = {name: one.values for name, one in found.items() if one.values is not None}
    start = float(samples.pop("time")[0])
    slowest = max(loggers, key=lambda one: one.step)
    step = slowest.step if request.step is None else request.step
    units = {name: unit for one in loggers for name, unit in one.units.items() if name in samples}
    joint = Recording(samples, step, units, start, slowest.meta)
    return _together(joint, loggers, samples)


def _together(
    first: Recording, several: Sequence[Recording], samples: dict[str, Array]
) -> Recording:
    """Return a recording of joined samples, with the notes and the names of all files."""
    meta = {**first.meta, "joined": [one.source or one.name for one in several]}
    meta["notes"] = [*dict.fromkeys(note for one in several for note in one.notes)]
    meta["name"] = several[0].name
    units = {name: first.units[name] for name in samples}
    return Recording(samples, first.sample_time, units, first.start_time, meta)
