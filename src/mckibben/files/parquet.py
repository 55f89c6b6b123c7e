"""Parquet files: columns of numbers, times and text."""

from __future__ import annotations

from io import BufferedReader
from pathlib import Path

from mckibben.files.table import Column, Table, column
from mckibben.files.tree import without_numbers
from mckibben.system.extras import demand


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the one table of a Parquet file."""
    demand("pyarrow", "parquet", "Parquet", file=path)
    import pyarrow as pa
    import pyarrow.parquet as pq

    frame = pq.ParquetFile(file).read()
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
