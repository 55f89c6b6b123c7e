"""Parquet: ours with everything in the schema's metadata, others by the rules for headers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mckibben.atomic import replacing
from mckibben.files import stored
from mckibben.files.notices import warn
from mckibben.files.stored import Stored
from mckibben.files.table import Table, column, of_equal_length, refuse_huge
from mckibben.recording import Recording

_KEY = b"mckibben"


def read(path: Path) -> list[Table]:
    """Read the one table of a Parquet file."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        refuse_huge(file.metadata.num_rows * file.metadata.num_columns, path)
        frame = file.read()
    text = (frame.schema.metadata or {}).get(_KEY)
    own = None if text is None else _own(frame, text, path)
    if own is not None:
        return [own]
    columns = {name: column(name, _array(frame[i])) for i, name in enumerate(frame.column_names)}
    return [of_equal_length(columns, path, meta={})]


def write(recording: Recording, path: Path) -> None:
    """Write a recording as Parquet, with its description in the schema."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    description = Stored.describe(recording, _samples(recording.channels.values()), path)
    time = {} if recording.sample_time is None else {"time": recording.time}
    frame = pa.table({**time, **recording.channels})
    frame = frame.replace_schema_metadata({_KEY: description.to_json(path)})
    with replacing(path) as new:
        pq.write_table(frame, new)


def _own(frame: Any, text: bytes, path: Path) -> Table | None:
    description = stored.parse(text)
    if isinstance(description, str):
        problem = f"the description in it is not by this package ({description})"
    else:
        names = list(description.units)
        if set(names) <= set(frame.column_names):
            values = {name: _array(frame[name]) for name in names}
            if stored.digest(_samples(values.values())) == description.sha256:
                return description.table(values)
        problem = "the description in it is of other samples"
    warn(path, f"{problem}; it is ignored, and units are taken from the names of the columns")
    return None


def _array(cells: Any) -> np.ndarray[Any, Any]:
    array: np.ndarray[Any, Any] = cells.to_numpy()
    return array


def _samples(channels: Any) -> bytes:
    return b"".join(np.asarray(values).astype("<f8").tobytes() for values in channels)
