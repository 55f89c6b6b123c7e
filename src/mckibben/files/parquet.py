"""Parquet files: own ones with metadata in the schema, others by header rules."""

from __future__ import annotations

from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.files import own
from mckibben.files.notices import warn
from mckibben.files.table import Column, Table, column
from mckibben.files.tree import without_numbers
from mckibben.recording import Recording
from mckibben.system.atomic import digest, replacing
from mckibben.system.extras import demand

demand("pyarrow", "parquet", "Parquet")

_KEY = b"mckibben"


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the one table of a Parquet file: its numbers, times and text."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    frame = pq.ParquetFile(file).read()
    text = (frame.schema.metadata or {}).get(_KEY)
    if text is not None and (described := _own(frame, text, path)):
        return [described]
    columns: list[Column] = []
    unread: dict[str, str] = {}
    is_a = pa.types
    for name, cells in zip(frame.column_names, frame.columns, strict=True):
        if is_a.is_dictionary(cells.type):
            cells = cells.cast(cells.type.value_type)
        kind = cells.type
        if is_a.is_string(kind) or is_a.is_large_string(kind) or is_a.is_string_view(kind):
            columns.append(Column(name, None, texts=[text or "" for text in cells.to_pylist()]))
        elif is_a.is_boolean(kind) or is_a.is_decimal(kind):
            columns.append(column(name, cells.cast(pa.float64()).to_numpy()))
        elif is_a.is_integer(kind) or is_a.is_floating(kind) or is_a.is_temporal(kind):
            columns.append(column(name, cells.to_numpy()))
        else:
            unread[name] = f"a column of type {kind}"
    if not columns:
        raise without_numbers(unread, path)
    return [Table(tuple(columns), unread=unread)]


def write(recording: Recording, path: Path) -> None:
    """Write a recording as Parquet, with its description in the schema."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    description = own.describe(recording, _samples(recording.channels), path)
    time = {} if recording.sample_time is None else {"time": recording.time}
    frame = pa.table({**time, **recording.channels})
    frame = frame.replace_schema_metadata({_KEY: description})
    with replacing(path) as new:
        pq.write_table(frame, new)


def _own(frame: Any, text: bytes, path: Path) -> Table | None:
    """Return the described table of a file, or None if the description is not by this package."""
    description = own.parse(text)
    if isinstance(description, str):
        warn(path, f"the description in it is ignored, as it is not by mckibben ({description})")
        return None
    if description.units.keys() <= set(frame.column_names):
        values = {name: frame[name].to_numpy() for name in description.units}
        if digest(_samples(values)) == description.sha256:
            return description.table(values)
    raise own.changed(path, "the key 'mckibben' of its schema's metadata")


def _samples(channels: Any) -> bytes:
    arrays = (np.asarray(values) for values in channels.values())
    return b"".join(values.astype("<f8").tobytes() for values in arrays)
