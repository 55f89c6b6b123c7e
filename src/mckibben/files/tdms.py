"""NI TDMS: one recording for each group, with units and time base from the properties."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mckibben.errors import DataError
from mckibben.files.table import Column, Table, column, of_equal_length, refuse_huge

_Waveform = tuple[float | None, float]


def read(path: Path) -> list[Table]:
    """Read the groups of a TDMS file that hold channels."""
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise DataError(
            "TDMS needs a library that is not installed",
            file=path,
            remedy="pip install mckibben[tdms]",
        ) from None

    with _quiet(), path.open("rb") as raw, TdmsFile.open(raw) as file:
        if file.file_status.incomplete_final_segment:
            raise DataError(
                "it is damaged: its last segment is cut off",
                file=path,
                remedy="record or export it again",
            )
        refuse_huge(sum(len(c) for group in file.groups() for c in group.channels()), path)
        meta = _plain(file.properties)
        groups = [group for group in file.groups() if any(len(c) for c in group.channels())]
        if not groups:
            raise DataError("no channel in it has samples", file=path, remedy="record it again")
        return [
            _table(group, path, meta, name=group.name if len(groups) > 1 else None)
            for group in groups
        ]


def _table(group: Any, path: Path, meta: dict[str, Any], name: str | None) -> Table:
    channels = {channel.name: channel for channel in group.channels() if len(channel)}
    columns: dict[str, Column] = {
        place: column(place, channel[:], channel.properties.get("unit_string") or None)
        for place, channel in channels.items()
    }
    table = of_equal_length(columns, path, meta=meta | _plain(group.properties), name=name)
    grids = {_waveform(channels[kept.header]) for kept in table.columns}
    stated = {grid for grid in grids if grid[0] is not None}
    if len(stated) > 1:
        raise DataError(
            f"the channels of group {group.name!r} have several time bases",
            file=path,
            remedy="save channels of one time base in one group",
        )
    step, start = next(iter(stated), (None, 0.0))
    return Table(
        table.columns, sample_time=step, start_time=start, meta=table.meta, name=table.name
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep nptdms from printing what is said by errors here."""
    from nptdms.log import log_manager

    handler = log_manager.console_handler
    level = handler.level
    handler.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        handler.setLevel(level)


def _waveform(channel: Any) -> _Waveform:
    step = channel.properties.get("wf_increment")
    start = channel.properties.get("wf_start_offset", 0.0)
    usable = isinstance(step, (int, float)) and math.isfinite(step) and step > 0
    return (float(step), float(start)) if usable else (None, 0.0)


def _plain(properties: Any) -> dict[str, Any]:
    """Return the properties that JSON holds."""
    return {
        name: value
        for name, value in properties.items()
        if isinstance(value, (str, int, bool))
        or (isinstance(value, float) and math.isfinite(value))
    }
