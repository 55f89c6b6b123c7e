"""NI TDMS: one recording for each group, with the units, starts and increments in its properties."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.errors import DataError
from mckibben.files.headers import channel_of, parse
from mckibben.files.table import MOST_TEXT, Column, Table, column
from mckibben.system.extras import demand

_NUMBERS = "biufmM"
"""Kinds of samples that are numbers or instants."""


@dataclass(frozen=True)
class _Clock:
    """When the samples of a channel were taken.

    Parameters
    ----------
    step, offset : float
        Between two samples, and of the first one after the start [s].
    start : numpy.datetime64, optional
        In absolute time.
    """

    step: float
    offset: float
    start: np.datetime64 | None

    def begin(self, starts: Sequence[np.datetime64]) -> float:
        """Return the time of the first sample since the first of the starts [s]."""
        late = self.start - min(starts) if self.start is not None else np.timedelta64(0)
        return self.offset + float(late / np.timedelta64(1, "us")) / 1e6


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the groups of a TDMS file that hold channels."""
    demand("nptdms", "tdms", "TDMS", file=path)
    from nptdms import TdmsFile

    with _quiet(), TdmsFile.open(file) as tree:
        if tree.file_status.incomplete_final_segment:
            raise DataError(
                "it is damaged: its last segment is cut off",
                file=path,
                remedy="record or export it again",
            )
        meta = _plain(tree.properties)
        groups = [group for group in tree.groups() if any(len(c) for c in group.channels())]
        if not groups:
            raise DataError("no channel in it has samples", file=path, remedy="record it again")
        return [
            _table(group, meta, name=group.name if len(groups) > 1 else None) for group in groups
        ]


def _table(group: Any, meta: Mapping[str, Any], name: str | None) -> Table:
    columns: dict[str, Column] = {}
    clocks: dict[str, _Clock] = {}
    unread: dict[str, str] = {}
    for channel in group.channels():
        place, kind = channel.name, channel.dtype.kind
        if not len(channel):
            unread[place] = "no samples"
        elif kind not in _NUMBERS and not _is_time(place):
            unread[place] = "complex numbers" if kind == "c" else "text"
        else:
            unit = channel.properties.get("unit_string") or None
            columns[place] = column(place, channel[:], unit)
            if (clock := _clock(channel.properties)) is not None:
                clocks[place] = clock
    meta = {**meta, **_plain(group.properties)}
    if len(set(clocks.values())) <= 1:
        clock = next(iter(clocks.values()), None)
        step, start = (None, 0.0) if clock is None else (clock.step, clock.offset)
        kept = tuple(columns.values())
        return Table(kept, None, step, start, meta=meta, unread=unread, name=name)
    starts = [clock.start for clock in clocks.values() if clock.start is not None]
    clocked: list[Column] = []
    for place, each in columns.items():
        clock = None if _is_time(place) else clocks.get(place)
        if clock is None or each.values is None or (starts and clock.start is None):
            unread[place] = "its start and increment are not stated, and others differ in them"
        else:
            samples = np.arange(each.values.size, dtype=np.float64)
            times = clock.begin(starts) + clock.step * samples
            clocked.append(replace(each, times=times))
    return Table(tuple(clocked), meta=meta, unread=unread, name=name)


def _is_time(header: str) -> bool:
    return channel_of(parse(header)) == "time"


def _clock(properties: Mapping[str, Any]) -> _Clock | None:
    step = properties.get("wf_increment")
    offset = properties.get("wf_start_offset", 0.0)
    if not isinstance(step, (int, float)) or not (math.isfinite(step) and step > 0):
        return None
    start = properties.get("wf_start_time")
    return _Clock(float(step), float(offset), start if isinstance(start, np.datetime64) else None)


@contextmanager
def _quiet() -> Iterator[None]:
    """Prevent nptdms from printing what is said by errors here."""
    from nptdms.log import log_manager

    handler = log_manager.console_handler
    level = handler.level
    handler.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        handler.setLevel(level)


def _plain(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return the properties that JSON holds."""
    return {
        name: value
        for name, value in properties.items()
        if isinstance(value, (int, bool))
        or (isinstance(value, str) and len(value) <= MOST_TEXT)
        or (isinstance(value, float) and math.isfinite(value))
    }
