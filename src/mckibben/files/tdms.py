"""NI TDMS files: one recording per group, with units, starts and increments from properties."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import replace
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.errors import DataError
from mckibben.files.headers import is_time
from mckibben.files.table import Column, Table, column, plain_meta
from mckibben.system.extras import demand


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the groups with channels of a TDMS file."""
    demand("nptdms", "tdms", "TDMS", file=path)
    from nptdms import TdmsFile
    from nptdms.log import log_manager

    log_manager.console_handler.setLevel(logging.CRITICAL)  # errors are raised here
    with TdmsFile.open(file) as tree:
        if tree.file_status.incomplete_final_segment:
            raise DataError(
                "it is damaged: its last segment is cut off",
                file=path,
                remedy="record or export it again",
            )
        meta = plain_meta(tree.properties)
        groups = [group for group in tree.groups() if any(len(c) for c in group.channels())]
        if not groups:
            raise DataError("no channel in it has samples", file=path, remedy="record it again")
        return [_table(group, meta, group.name if len(groups) > 1 else None) for group in groups]


def _table(group: Any, meta: Mapping[str, Any], name: str | None) -> Table:
    columns: dict[str, Column] = {}
    clocks: dict[str, tuple[float, float, Any]] = {}
    unread: dict[str, str] = {}
    for channel in group.channels():
        header, kind, about = channel.name, channel.dtype.kind, channel.properties
        if not len(channel):
            unread[header] = "no samples"
        elif kind not in "biufmM" and not is_time(header):
            unread[header] = "complex numbers" if kind == "c" else "text"
        else:
            columns[header] = column(header, channel[:], about.get("unit_string") or None)
            step, offset = about.get("wf_increment"), about.get("wf_start_offset", 0.0)
            if isinstance(step, (int, float)) and 0 < step < math.inf:
                clocks[header] = (float(step), float(offset), about.get("wf_start_time"))
    meta = {**meta, **plain_meta(group.properties)}
    if len(set(clocks.values())) <= 1:
        step, offset, _ = next(iter(clocks.values()), (None, 0.0, None))
        all_columns = tuple(columns.values())
        return Table(all_columns, None, step, offset, meta=meta, unread=unread, name=name)
    first = min((began for *_, began in clocks.values() if began is not None), default=None)
    clocked: list[Column] = []
    for header, made in columns.items():
        step, offset, began = clocks.get(header, (None, 0.0, None))
        if is_time(header) or step is None or (first is not None and began is None):
            unread[header] = "its start and increment are not stated, and others differ in them"
        else:
            late = 0.0 if began is None else float((began - first) / np.timedelta64(1, "us")) / 1e6
            times = offset + late + step * np.arange(made.size, dtype=np.float64)
            clocked.append(replace(made, times=times))
    return Table(tuple(clocked), meta=meta, unread=unread, name=name)
