"""Parquet: ours with everything in the schema's metadata, others by the rules for headers."""

from __future__ import annotations

from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.files import pages, stored
from mckibben.files.limits import MOST_PARTS, Budget
from mckibben.files.notices import warn
from mckibben.files.stored import Stored
from mckibben.files.table import Column, Table, column, of_equal_length
from mckibben.recording import Recording
from mckibben.system.atomic import replacing
from mckibben.system.extras import demand
from mckibben.system.manifest import digest

demand("pyarrow", "parquet", "Parquet")

_KEY = b"mckibben"

MOST_WORDS = 2**26
"""Bytes of text that are read: that of some million instants."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the one table of a Parquet file: its numbers and times, and text where there is little."""
    import pyarrow.parquet as pq

    budget = Budget(file, path)
    parquet = pq.ParquetFile(file, thrift_container_size_limit=MOST_PARTS)
    about, schema = parquet.metadata, parquet.schema_arrow
    budget.parts(about.num_row_groups * about.num_columns)
    groups = [about.row_group(i) for i in range(about.num_row_groups)]
    rows = max(about.num_rows, sum(group.num_rows for group in groups))
    numbers = [field.name for field in schema if _is_number(field.type)]
    texts = {field.name for field in schema if _is_text(field.type)}
    # of groups, not of columns: PyArrow ends the process over some damaged descriptions of those
    size = sum(group.total_byte_size for group in groups)
    if texts and size - 9 * rows * len(numbers) > MOST_WORDS:
        warn(path, f"columns of text are not read, as there is more than {MOST_WORDS} bytes of it")
        texts = set()
    wanted = [field.name for field in schema if field.name in {*numbers, *texts}]
    budget.samples(rows * len(wanted))
    pages.look(file, set(wanted), 8 * budget.allowed + MOST_WORDS, budget)
    # words that are repeated stay one word each, however often they are
    parquet = pq.ParquetFile(file, metadata=about, read_dictionary=sorted(texts))
    frame = parquet.read(columns=None if len(wanted) == len(schema) else wanted)
    text = (frame.schema.metadata or {}).get(_KEY)
    own = None if text is None else _own(frame, text, path)
    if own is not None:
        return [own]
    unread = [""] * frame.num_rows
    columns = {field.name: Column(field.name, None, texts=unread) for field in schema}
    columns |= {name: _column(name, frame[i]) for i, name in enumerate(frame.column_names)}
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
            if digest(_samples(values.values())) == description.sha256:
                return description.table(values)
        problem = "the description in it is of other samples"
    warn(path, f"{problem}; it is ignored, and units are taken from the names of the columns")
    return None


def _is_number(kind: Any) -> bool:
    """Tell whether a column holds numbers, or instants or times that become some."""
    import pyarrow as pa

    is_a = pa.types
    if is_a.is_dictionary(kind):
        return _is_number(kind.value_type)
    kinds = (is_a.is_integer, is_a.is_floating, is_a.is_boolean, is_a.is_date)
    return any(is_it(kind) for is_it in (*kinds, is_a.is_timestamp, is_a.is_duration))


def _is_text(kind: Any) -> bool:
    import pyarrow as pa

    is_a = pa.types
    if is_a.is_dictionary(kind):
        return _is_text(kind.value_type)
    return bool(is_a.is_string(kind) or is_a.is_large_string(kind) or is_a.is_string_view(kind))


def _column(name: str, cells: Any) -> Column:
    import pyarrow as pa

    if not (pa.types.is_dictionary(cells.type) and _is_text(cells.type)):
        return column(name, _array(cells))
    texts: list[str] = []
    for chunk in cells.chunks:
        words = [word or "" for word in chunk.dictionary.to_pylist()]
        texts += ["" if at is None else words[at] for at in chunk.indices.to_pylist()]
    return Column(name, None, texts=texts)


def _array(cells: Any) -> np.ndarray[Any, Any]:
    array: np.ndarray[Any, Any] = cells.to_numpy()
    return array


def _samples(channels: Any) -> bytes:
    return b"".join(np.asarray(values).astype("<f8").tobytes() for values in channels)
