"""NI TDMS: one recording for each group, with units and time base from the properties."""

from __future__ import annotations

import logging
import math
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mckibben.errors import DataError
from mckibben.files.limits import MOST_TEXT, Budget
from mckibben.files.table import Column, Table, column, of_equal_length
from mckibben.system.extras import demand

_LEAD = struct.Struct("<4sIIQQ")
_META_DATA, _NEW_LIST, _BIG_ENDIAN = 1 << 1, 1 << 2, 1 << 6

_Waveform = tuple[float | None, float]


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the groups of a TDMS file that hold channels."""
    demand("nptdms", "tdms", "TDMS", file=path)
    from nptdms import TdmsFile

    budget = Budget(file, path)
    _count_segments(file, budget)
    with _quiet(), TdmsFile.open(file) as tree:
        if tree.file_status.incomplete_final_segment:
            raise DataError(
                "it is damaged: its last segment is cut off",
                file=path,
                remedy="record or export it again",
            )
        for group in tree.groups():
            budget.parts(len(group))
            budget.samples(sum(len(channel) for channel in group.channels()))
        meta = _plain(tree.properties)
        groups = [group for group in tree.groups() if any(len(c) for c in group.channels())]
        if not groups:
            raise DataError("no channel in it has samples", file=path, remedy="record it again")
        return [
            _table(group, path, budget, meta, name=group.name if len(groups) > 1 else None)
            for group in groups
        ]


def _count_segments(file: BufferedReader, budget: Budget) -> None:
    """Count the objects of all segments, from their lead-ins alone."""
    objects, at = 1, 0
    while len(lead := file.read(_LEAD.size)) == _LEAD.size:
        tag, contents, _, length, _ = _LEAD.unpack(lead)
        if tag != b"TDSm":
            break
        if contents & _META_DATA:
            count = file.read(4)
            order: Literal["big", "little"] = "big" if contents & _BIG_ENDIAN else "little"
            kept = 1 if contents & _NEW_LIST else objects
            objects = max(kept, int.from_bytes(count, order))
            if contents & _BIG_ENDIAN:
                length = int.from_bytes(length.to_bytes(8, "little"), "big")
        budget.pieces(objects)
        at += _LEAD.size + length
        if at >= os.fstat(file.fileno()).st_size:
            break
        file.seek(at)
    file.seek(0)


def _samples(channel: Any, budget: Budget) -> NDArray[Any]:
    """Return the samples of a channel, read piece by piece to see how many there are."""
    values: NDArray[Any] = np.empty(len(channel), dtype=channel.dtype)
    at = 0
    for piece in channel.data_chunks():
        budget.pieces(1)
        values[at : at + len(piece)] = piece[:]
        at += len(piece)
    return values[:at]


def _table(group: Any, path: Path, budget: Budget, meta: dict[str, Any], name: str | None) -> Table:
    channels = {channel.name: channel for channel in group.channels() if len(channel)}
    columns: dict[str, Column] = {
        place: column(
            place, _samples(channel, budget), channel.properties.get("unit_string") or None
        )
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
        if isinstance(value, (int, bool))
        or (isinstance(value, str) and len(value) <= MOST_TEXT)
        or (isinstance(value, float) and math.isfinite(value))
    }
